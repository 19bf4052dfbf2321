"""A run that a user function ended on purpose is a complete one, as long as it was."""

import exudyn_romerr as romerr
from models import floating


def test_what_a_user_function_ends_on_purpose_is_complete():
    scene = floating.pendulum(4, t_end=0.02)
    scene.mbs.SetPostStepUserFunction(lambda mbs, t: t < 0.01)
    monitor = romerr.attach(scene.mbs, [romerr.floating_body(scene.fem, scene.items)])
    scene.solve()
    report = monitor.report()
    said = "Until 0.01 of 0.02 s: a user function that returned False stopped it on purpose. Enough: "
    assert report.summary(1e9).splitlines()[1].startswith(said)
    assert all(body.on_purpose for body in report.bodies)
    assert monitor.report(-1).on_purpose
