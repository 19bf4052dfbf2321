"""What tests do with scenes of models/: monitors of their bodies, sensors by their names, what these show."""

from exudyn_romerr import attach, floating_body


def flexes(scene, **options):
    """The reduced bodies of a scene."""
    bodies = scene.bodies if hasattr(scene, "bodies") else [scene.items]
    fems = scene.fems if hasattr(scene, "fems") else [scene.fem] * len(bodies)
    return [floating_body(fem, items, **options) for fem, items in zip(fems, bodies, strict=True)]


def attached(scene, **options):
    """A monitor of the first body."""
    return attach(scene.mbs, flexes(scene)[0], **options)


def attached_all(scene, **options):
    """A monitor of the mechanism."""
    return attach(scene.mbs, flexes(scene), **options)


def named(scene, *names):
    """The scene, whose sensors, or some of them, are called as it calls them."""
    for name in names or scene.sensors:
        scene.mbs.SetSensorParameter(scene.sensors[name], "name", name)
    return scene


def shown(scene, *names):
    """What its sensors, or some of them, have stored: name -> (T, r)."""
    return {name: scene.mbs.GetSensorStoredData(scene.sensors[name])[:, 1:] for name in names or scene.sensors}


def observed(scene, **options):
    """The report of its first body, once it is solved."""
    monitor = attached(scene, **options)
    scene.solve()
    return monitor.report()


def observed_all(scene, **options):
    """The report of its mechanism, once it is solved."""
    monitor = attached_all(scene, **options)
    scene.solve()
    return monitor.report()
