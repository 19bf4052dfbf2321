"""Bad input for floating bodies: the type of error, and a message that names what is wrong and what to do."""

from contextlib import suppress
from types import SimpleNamespace

import exudyn as exu
import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from scipy.spatial.transform import Rotation

from exudyn_romerr import (
    AssumptionError,
    Basis,
    ElasticBody,
    InputError,
    Output,
    RunError,
    add_reduced_body,
    attach,
    floating_body,
    mass_orthogonal,
    mean_motion,
    node_displacement,
    node_velocity,
    relative_displacement,
)
from models import floating
from tests.helpers import mbs_scenes
from tests.helpers.bad_input import check_error, check_refused
from tests.helpers.observed import attached
from tests.mbs.floating.test_floating_scene import (
    HINGE,
    TIP,
    Quantity,
    add_joint,
    add_load,
    add_marker,
    add_node_marker,
    bar,
    settings,
    solve,
    supported,
    watched,
)

LEFT, RIGHT = (floating.interface(floating.load_fem("bar"), side) for side in ("left", "right"))


def reported(scene, **options):
    """Attach, solve some steps and ask for the report."""
    monitor = watched(scene, **options)
    solve(scene, h=1e-4, steps=3)
    return monitor.report()


def clamped(edit=lambda scene: None, **options):
    """A clamped bar with something wrong."""
    scene = supported(**options)
    edit(scene)
    return scene


# --- fem and items ----------------------------------------------------------


def scaled(fem, name, factor):
    """A fem of which one matrix is another."""
    setattr(fem, name, factor * getattr(fem, name))


def one_entry(fem, at, value):
    """A fem whose mass is another at one entry and its mirror image."""
    mass = fem.massMatrix.tolil()
    mass[at] = mass[at[::-1]] = value
    fem.massMatrix = mass.tocsr()


def body_of(items=None, fem=None, **options):
    scene = bar()
    return floating_body(scene.fem if fem is None else fem, scene.items if items is None else items, **options)


def edited(edit):
    """A bar whose fem was edited after the body was added."""
    scene = supported()
    edit(scene.fem)
    return scene


def moved_nodes(fem):
    fem.nodes = {"Position": 1.1 * fem.nodes["Position"]}


def fewer_nodes(fem):
    fem.nodes = {"Position": fem.nodes["Position"][:-1]}


def of_another_fem():
    scene = supported()
    scene.fem = floating.load_fem("rotor")
    return scene


def in_another_mbs(other):
    scene = bar()
    return attach(other, floating_body(scene.fem, scene.items), outputs=[TIP])


def with_user_function(scene):
    """The same body once more, and forces of 1 N by a user function."""
    scene.items = scene.cms.AddObjectFFRFreducedOrderWithUserFunctions(
        exu, scene.mbs, gravity=[0, 0, 0], UFforce=lambda *args: np.ones(17)
    )


NEEDED = "nRigidBody.*nGenericODE2.*oFFRFreducedOrder.*AddObjectFFRFreducedOrder"
BODIES = {
    "fem is a path": (lambda: body_of(fem="bar.npz"), "fem is a str; needed: the FEMinterface"),
    "fem is the interface of modes": (lambda: body_of(fem=bar().cms), "fem is a .*; needed: the FEMin"),
    "fem is empty": (lambda: body_of(fem=FEMinterface()), "fem.massMatrix is empty; import or compute"),
    "fem has no mass": (
        lambda: reported(edited(lambda fem: setattr(fem, "massMatrix", None))),
        "fem.massMatrix is empty",
    ),
    "fem has no stiffness": (
        lambda: reported(edited(lambda fem: setattr(fem, "stiffnessMatrix", np.zeros((0, 0))))),
        "fem.stiffnessMatrix is empty",
    ),
    "items are None": (lambda: body_of(items=False), NEEDED),
    "items are a number": (lambda: body_of(items=3), NEEDED),
    "items are empty": (lambda: body_of(items={}), NEEDED),
    "items lack the object": (
        lambda: body_of(items={"nRigidBody": 0, "nGenericODE2": 1}),
        r"items \(dict\) lacks 'oFFRFreducedOrder'; needed",
    ),
    "nested items are empty": (lambda: body_of(items={"FFRFReducedOrderObjectDict": {}}), NEEDED),
    "reference of another type": (lambda: body_of(reference=[0, 1]), r"reference=\[0, 1\]; needed: mean"),
    "interfaces unknown": (lambda: body_of(interfaces="stiff"), "interfaces='stiff'.*'free', 'rigid'"),
    "mass not the same in all directions": (
        lambda: reported(edited(lambda fem: one_entry(fem, (0, 0), 1.0))),
        "mass is not the same in x, y, z.*solid elements",
        AssumptionError,
    ),
    "mass couples directions": (
        lambda: reported(edited(lambda fem: one_entry(fem, (0, 1), 1e-4))),
        "mass is not the same in x, y, z",
        AssumptionError,
    ),
    "nodes are too few": (
        lambda: reported(edited(fewer_nodes)),
        "195 coordinates at 64 nodes.*3 a node",
        AssumptionError,
    ),
    "items of a fem of another size": (lambda: reported(of_another_fem()), "items belong to another fem"),
    "items of a fem with other nodes": (lambda: reported(edited(moved_nodes)), "other node positions.*another fem"),
    "stiffness changed since": (
        lambda: reported(edited(lambda fem: scaled(fem, "stiffnessMatrix", 1.01))),
        "stiffnessMatrixReduced.*a fem changed since",
    ),
    "mass changed since": (
        lambda: reported(edited(lambda fem: scaled(fem, "massMatrix", 1.01))),
        "massMatrixReduced.*a fem changed since",
    ),
    "another mbs, empty": (lambda: in_another_mbs(mbs_scenes.new_mbs()), "object 0.*made in another mbs"),
    "another mbs, with a body of other items": (
        lambda: in_another_mbs(mbs_scenes.scene()[0]),
        "object 0 of items is a .*needed: an FFRFreducedOrder.*another mbs",
    ),
    "forces by a user function": (
        lambda: reported(clamped(with_user_function)),
        "user functions of body .* have other equations than .*, forces differ by .* romerr verify measures",
        AssumptionError,
    ),
    "initial unknown": (lambda: reported(clamped(), initial="rest"), "initial is 'rest'"),
    "initial state misses the reference conditions": (
        lambda: reported(clamped(), initial=(np.ones(195), np.zeros(195))),
        "misses the reference conditions",
    ),
}


@pytest.mark.parametrize("name", BODIES)
def test_bodies(name):
    """Fem, items, reference and interfaces."""
    check_refused(*BODIES[name])


def test_items_may_be_nested():
    """As mbs.CreateFFRFReducedOrderObject returns them."""
    scene = bar()
    nested = {"FFRFReducedOrderObjectDict": scene.items, "body:left": scene.left}
    assert floating_body(scene.fem, nested).number == int(scene.items["oFFRFreducedOrder"])


def test_body_of_create_function_is_bounded():
    """Items, markers and gravity made by mbs.CreateFFRFReducedOrderObject."""
    fem = floating.load_fem("bar")
    fem.nodeSets = [{**nodes, "type": "boundary"} for nodes in fem.nodeSets if len(nodes["NodeNumbers"]) > 1]
    floating.reduce(fem, 2)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    made = mbs.CreateFFRFReducedOrderObject(name="bar", femInterface=fem, gravity=floating.GRAVITY, verbose=False)
    scene = SimpleNamespace(mbs=mbs, fem=fem, items=made)
    report = reported(scene)
    assert report.scope == {"energy": "inputs frozen"}
    assert "bar:left" in str(report.plan)


def test_modes_recomputed_since_are_no_error():
    """Those of the object count."""
    scene = supported(n=4)
    floating.reduce(scene.fem, 7)
    assert "10 modes of object" in str(reported(scene).plan)


def test_object_whose_number_changed_is_refused():
    """An object before it was deleted; Exudyn numbers the others anew."""
    fem = floating.load_fem("bar")
    floating.reduce(fem, 2)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    ground = mbs.AddObject(itemInterface.ObjectGround())
    items = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(mbs, gravity=[0, 0, 0])
    monitor = attach(mbs, floating_body(fem, items), outputs=[TIP])
    mbs.DeleteObject(ground)
    mbs.Assemble()
    mbs.SolveDynamic(settings(1e-4, 3))
    check_error(monitor.report, InputError, "object 1 of items is not in the mbs; was it deleted")


def test_reset_mbs_is_refused():
    """Its hook went with everything else."""
    scene = bar()
    monitor = watched(scene)
    scene.mbs.Reset()
    check_error(monitor.report, RunError, r"mbs\.Reset\(\)")


def test_body_attached_twice_is_refused():
    """One monitor per body."""
    scene = bar()
    watched(scene)
    check_error(lambda: watched(scene), InputError, "object 0 is attached already")


@pytest.mark.parametrize("count", [-3, 0, 2.5, True, "many"])
def test_wrong_numbers_of_auxiliary_modes_are_refused_at_once(count):
    with pytest.raises(InputError, match=r"auxiliary_modes=.*; allowed: a whole number 1\.\."):
        watched(bar(), auxiliary_modes=count)


# --- outputs and sensors ----------------------------------------------------


def sensor_on(scene, quantity=Quantity.Displacement, node=20, **options):
    item = itemInterface.SensorSuperElement
    options = {"bodyNumber": scene.body, "meshNodeNumber": node, "outputVariableType": quantity, **options}
    return scene.mbs.AddSensor(item(**options))


def marker_sensor(scene, marker, quantity):
    return scene.mbs.AddSensor(itemInterface.SensorMarker(markerNumber=marker, outputVariableType=quantity))


def second_body(scene):
    items = scene.cms.AddObjectFFRFreducedOrder(scene.mbs, gravity=[0, 0, 0])
    return items["oFFRFreducedOrder"]


def with_sensor(make):
    """Attach with the sensor that make(scene) returns."""
    scene = supported()
    return watched(scene, outputs=[make(scene)])


def node_sensor(scene):
    item = itemInterface.SensorNode
    number = scene.items["nRigidBody"]
    return scene.mbs.AddSensor(item(nodeNumber=number, outputVariableType=Quantity.Position))


def ground_sensor(scene):
    item = itemInterface.SensorBody
    return scene.mbs.AddSensor(item(bodyNumber=scene.ground, outputVariableType=Quantity.Position))


def ground_marker_sensor(scene):
    marker = scene.mbs.AddMarker(itemInterface.MarkerBodyPosition(bodyNumber=scene.ground))
    return marker_sensor(scene, marker, Quantity.Position)


SENSORS = {
    "out of range": (lambda s: 99, "sensor 99; the mbs has 0 sensors"),
    "negative": (lambda s: -1, "sensor -1"),
    "acceleration": (
        lambda s: sensor_on(s, Quantity.Acceleration),
        "measures Acceleration; bounds are known for Dis",
    ),
    "rotation": (lambda s: marker_sensor(s, s.right, Quantity.Rotation), "measures Rotation; bounds are known for"),
    "marker with an offset": (
        lambda s: marker_sensor(s, add_marker(s, "right", offset=[0.1, 0, 0]), Quantity.Displacement),
        "marker with an offset; use one without",
    ),
    "frame's node": (node_sensor, r"type 'Node'.*allowed: SensorSuperElement"),
    "ground": (ground_sensor, "type 'Body', is on object 1"),
    "marker on the ground": (ground_marker_sensor, "type 'Marker', is on something else"),
    "another flexible body": (
        lambda s: sensor_on(s, bodyNumber=second_body(s)),
        r"is on object \d; allowed: .* on mesh nodes of object 0",
    ),
}


@pytest.mark.parametrize("name", SENSORS)
def test_sensors(name):
    """Refused by attach, before anything is solved."""
    make, message = SENSORS[name]
    check_error(lambda: with_sensor(make), InputError, message)


def output_of(**options):
    return reported(clamped(), outputs=[node_displacement("tip", **options)])


def test_outputs_are_checked_by_attach():
    """Node numbers and rows need no solve; a function of the body that asks for more waits until there is one."""
    scene = clamped()
    flex = floating_body(scene.fem, scene.items)
    seen = node_displacement("global", node=65, frame="global")
    for out in (node_displacement("tip", node=65), seen, Output("rows", np.ones(7))):
        with pytest.raises(InputError, match=r"node 65; allowed|rows of output 'rows' has shape"):
            attach(scene.mbs, flex, outputs=[out])
    later = Output("modal", lambda body: body.expand(body.modes(1).shapes).T)
    attach(scene.mbs, flex, outputs=[later])


def test_fem_changed_after_floating_body_does_not_count():
    """Matrices and positions are copied; edits in place do not reach the bounds."""
    reports = []
    for edit in (lambda fem: None, stiffened):
        scene = clamped()
        flex = floating_body(scene.fem, scene.items)
        edit(scene.fem)
        monitor = attach(scene.mbs, flex, outputs=[TIP], estimators="energy")
        solve(scene, h=1e-4, steps=3)
        reports.append(monitor.report())
    # Exudyn's eigensolver gives modes whose last digits are others each time; twice the stiffness halves the bound
    np.testing.assert_allclose(*(report.output(TIP.name).bound["energy"] for report in reports), rtol=1e-6)


def stiffened(fem):
    fem.stiffnessMatrix.data *= 2.0


def test_rigid_interfaces_of_other_modes_are_refused_by_attach():
    """The modes are there already."""
    scene = bar()
    flex = floating_body(scene.fem, scene.items, interfaces="rigid")
    with pytest.raises(AssumptionError, match="is for RBE2 modes"):
        attach(scene.mbs, flex, outputs=[TIP])


def same_sensor_twice():
    scene = supported()
    sensor = sensor_on(scene)
    return reported(scene, outputs=[sensor, sensor])


def beside_a_sensor(outputs):
    scene = bar()
    sensor_on(scene)
    return attached(scene, outputs=outputs)


OUTPUTS = {
    "node too high": (lambda: output_of(node=65), r"node 65; allowed: node numbers 0\.\.64"),
    "node negative": (lambda: output_of(node=-1), "node -1; allowed"),
    "node not whole": (lambda: output_of(node=2.5), "node 2.5; allowed"),
    "node in global axes": (lambda: output_of(node=65, frame="global"), "node 65; allowed"),
    "component": (lambda: output_of(node=3, component="w"), "component='w'; allowed"),
    "frame": (lambda: output_of(node=3, frame="local"), "frame .*'local'.*'body', 'global'"),
    "other node": (
        lambda: reported(clamped(), outputs=[relative_displacement("gap", node=3, other=77)]),
        "node 77; allowed",
    ),
    "rows of a vector in global axes": (
        lambda: reported(clamped(), outputs=[Output("two", np.eye(195)[:2], frame="global")]),
        "rows of output 'two' are 2.*three rows each",
    ),
    "position in body axes": (
        lambda: Output("place", np.eye(195)[:3], of="position"),
        "of .*'position'.*'displacement', 'velocity'",
    ),
    "not a list": (lambda: attach(bar().mbs, body_of(), outputs=TIP), "outputs is a Output; needed: a list"),
    "a name of a node set": (
        lambda: watched(bar(), outputs=["tip"]),
        "no sensor is called so; the mbs has no sensors yet, add them before attach; 'tip' is a node set of the fem",
    ),
    "no name of a sensor": (
        lambda: beside_a_sensor("end"),
        r"names 'end', .*; the mbs has sensors 0 'sensor0'; without a sensor pass romerr.node_displacement\('end'",
    ),
    "a name twice": (lambda: watched(bar(), outputs=[TIP, TIP]), "is used more than once"),
    "an estimator": (lambda: watched(bar(), estimators="fats"), "estimators='fats' is unknown; allowed"),
    "a sensor twice": (same_sensor_twice, "name 'sensor0' is used more than once"),
}


@pytest.mark.parametrize("name", OUTPUTS)
def test_outputs(name):
    """What an output sees must be there."""
    check_refused(*OUTPUTS[name])


def linear_body(frame):
    """Attach a body of two nodes made by add_reduced_body."""
    mbs = mbs_scenes.new_mbs()
    body = ElasticBody(np.eye(6), np.eye(6), positions=np.zeros((2, 3)))
    flex = add_reduced_body(mbs, body, Basis(np.eye(6)[:, :2]))
    return attach(mbs, flex, outputs=[node_velocity("v", node=0, frame=frame)])


def test_linear_body_has_no_global_axes():
    """A body of add_reduced_body has no frame."""
    assert linear_body("body").runs == ()
    check_error(lambda: linear_body("global"), InputError, "output 'v' is in global axes.*leave frame='body'")


def test_linear_body_without_positions_has_no_global_axes():
    """The same, of a body that has no node positions either."""
    seen = Output("v", np.eye(mbs_scenes.N)[:3], frame="global")
    check_error(lambda: mbs_scenes.scene(outputs=[seen]), InputError, "output 'v' is in global axes")


# --- markers ----------------------------------------------------------------


def add_bare_marker(kind, **options):
    return lambda scene: scene.mbs.AddMarker(kind(**{"bodyNumber": scene.body, **options}))


def load_on_a_mode(scene):
    number, marker = scene.items["nGenericODE2"], itemInterface.MarkerNodeCoordinate
    on_mode = scene.mbs.AddMarker(marker(nodeNumber=number, coordinate=0))
    scene.mbs.AddLoad(itemInterface.LoadCoordinate(markerNumber=on_mode, load=1.0))


def first_order_turn(torque, body_fixed):
    def edit(scene):
        marker = add_marker(scene, "right", rotationsExponentialMap=0)
        add_load(scene, marker, [0, 0, 1], torque=torque, bodyFixed=body_fixed)

    return edit


def loaded(scene, marker):
    """A force on the marker: what nothing acts through is not looked at."""
    return add_load(scene, marker, [0.0, 0.0, 1.0])


def test_markers_of_sensors_only_are_not_looked_at():
    assert reported(clamped(add_bare_marker(itemInterface.MarkerBodyRigid))).scope == {"energy": "complete"}


FIRST_ORDER = "load 1.*rotationsExponentialMap=0: leave that option"
MARKERS = {
    "rigid, weights of sum 1.5": (
        lambda s: loaded(s, add_marker(s, "right", weightingFactors=1.5 * RIGHT[1])),
        InputError,
        r"marker \d.*weights of sum 1.5; needed: 1",
    ),
    "position, weights of sum 2": (
        lambda s: loaded(s, add_node_marker(s, (3, 20), (1.0, 1.0))),
        InputError,
        r"marker \d.*weights of sum 2; needed: 1",
    ),
    "negative weight": (
        lambda s: loaded(s, add_marker(s, "right", weightingFactors=[1.0, 1.0, -1.0], meshNodeNumbers=[3, 20, 30])),
        InputError,
        "weights contains -1; allowed: positive",
    ),
    "first-order mean rotation": (
        lambda s: loaded(s, add_marker(s, "right", useAlternativeApproach=False)),
        AssumptionError,
        r"marker \d.*useAlternativeApproach=False.*leave it True",
    ),
    "torque on a first-order turn": (first_order_turn(True, False), AssumptionError, FIRST_ORDER),
    "force that follows a first-order turn": (first_order_turn(False, True), AssumptionError, FIRST_ORDER),
    "load on a mode": (
        load_on_a_mode,
        AssumptionError,
        r"marker \d.*modal coordinates of object 0.*use markers on mesh nodes",
    ),
    "rigid, on the body": (
        lambda s: loaded(s, add_bare_marker(itemInterface.MarkerBodyRigid)(s)),
        AssumptionError,
        r"marker \d.*'BodyRigid' is on object 0.*use MarkerSuperElement",
    ),
    "position, on the body": (
        lambda s: loaded(s, add_bare_marker(itemInterface.MarkerBodyPosition)(s)),
        AssumptionError,
        r"marker \d.*'BodyPosition' is on object 0",
    ),
}


@pytest.mark.parametrize("name", MARKERS)
def test_markers(name):
    """Found when a solve begins; what Exudyn makes of 'BodyPosition' on such a body differs from run to run."""
    edit, kind, message = MARKERS[name]
    scene = clamped(edit)
    monitor = watched(scene)
    with suppress(exu.SolverError):  # as it did once
        solve(scene, h=1e-4, steps=3)
    check_error(monitor.report, kind, message)


def test_force_in_global_axes_needs_no_turn():
    """Whatever map of rotations the marker has."""
    assert reported(clamped(first_order_turn(False, False))).scope == {"energy": "complete"}


def test_load_on_the_frame_alone_is_no_error():
    """It does no work on the deformation."""
    scene = bar()
    marker = itemInterface.MarkerNodeCoordinate
    number = scene.mbs.AddMarker(marker(nodeNumber=scene.items["nRigidBody"], coordinate=0))
    scene.mbs.AddLoad(itemInterface.LoadCoordinate(markerNumber=number, load=1.0))
    assert len(reported(scene).t) == 4


def slanted_fem():
    """The bar turned in space, so that a row of nodes is on none of its axes."""
    fem, A = floating.load_fem("bar"), Rotation.from_rotvec([0.3, 0.5, -0.8]).as_matrix()
    turn = sp.block_diag([A] * fem.NumberOfNodes(), format="csr")
    row = np.flatnonzero(np.all(np.abs(fem.nodes["Position"][:, 1:]) < 1e-9, axis=1))[:3]
    fem.nodes = {"Position": fem.nodes["Position"] @ A.T}
    fem.stiffnessMatrix = turn @ fem.stiffnessMatrix @ turn.T
    return fem, row.tolist()


@pytest.mark.parametrize(
    ("count", "message"),
    [(2, "at least three that are not on one line"), (3, "lie on a line: they have no mean rotation")],
)
def test_interface_on_a_line(count, message):
    """Nodes that have no mean rotation; Exudyn itself finds only lines along the axes."""
    fem, row = slanted_fem()
    floating.reduce(fem, 2)
    scene = with_body(fem)
    loaded(scene, add_marker(scene, "left", meshNodeNumbers=row[:count], weightingFactors=[1 / count] * count))
    check_error(lambda: reported(scene), InputError, message)


# --- matrices of the object -------------------------------------------------


def set_matrix(name, edit):
    """Edit a reduced matrix of the object in the mbs."""

    def change(scene):
        key = f"{name}MatrixReduced"
        matrix = np.array(getattr(scene.cms, key))
        edit(matrix)
        scene.mbs.SetObjectParameter(scene.body, key, exu.MatrixContainer(matrix))

    return change


def stiffer(matrix):
    matrix[0, 0] *= 1.01


MATRICES = {
    "stiffness": (set_matrix("stiffness", stiffer), InputError, "stiffnessMatrixReduced.*that were edited"),
    "mass": (set_matrix("mass", stiffer), InputError, "massMatrixReduced.*that were edited"),
    "damping": (
        set_matrix("damping", stiffer),
        AssumptionError,
        r"not alpha M \+ beta K.*use massProportionalDamping",
    ),
}


@pytest.mark.parametrize("name", MATRICES)
def test_edited_matrices(name):
    """Reduced matrices that the fem does not have."""
    edit, kind, message = MATRICES[name]
    check_error(lambda: reported(clamped(edit)), kind, message)


def test_matrix_edited_after_attach():
    """Found when the solve begins."""
    scene = supported()
    monitor = watched(scene)
    MATRICES["stiffness"][0](scene)
    scene.mbs.Assemble()
    solve(scene, h=1e-4, steps=3)
    check_error(monitor.report, InputError, "stiffnessMatrixReduced")


def test_general_rayleigh_factors_are_read():
    """Both zero too."""

    def undamped(scene):
        scene.mbs.SetObjectParameter(scene.body, "dampingMatrixReduced", exu.MatrixContainer())

    assert "alpha = 2 1/s, beta = 1e-05 s" in str(reported(clamped()).plan)
    assert "alpha = 0 1/s, beta = 0 s" in str(reported(clamped(undamped)).plan)


def test_damping_that_feeds_energy_is_refused():
    """A negative factor."""
    negate = set_matrix("damping", lambda matrix: np.negative(matrix, out=matrix))
    check_error(lambda: reported(clamped(negate)), AssumptionError, "rayleigh=.*feeds energy in")


# --- reference conditions ---------------------------------------------------


def held_by(scene, **options):
    """What the plan says holds the body in its frame."""
    monitor = watched(scene, **options)
    scene.mbs.Assemble()
    return next(line for line in monitor.plan.computed if "held in its frame by" in line)


def without_sets(scene):
    scene.fem.nodeSets = []
    return scene


def clamped_modes():
    """A bar with eigenmodes of which none moves the nodes near its left end; no marker, no node set."""
    fem = floating.load_fem("bar")
    positions = fem.GetNodePositionsAsArray()
    free = np.repeat(positions[:, 0] > 0.03, 3)
    K, M = (matrix.toarray()[np.ix_(free, free)] for matrix in (fem.stiffnessMatrix, fem.massMatrix))
    V = np.zeros((len(free), 4))
    V[free] = la.eigh(K, M, subset_by_index=[0, 3])[1]
    return with_modes(fem, V), len(positions) - free.sum() // 3


def with_modes(fem, V):
    fem.modeBasis = {"matrix": V, "type": "NormalModes"}
    return with_body(fem)


def with_body(fem):
    """A floating body alone in its mbs."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    items = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(mbs, gravity=[0, 0, 0])
    return SimpleNamespace(SC=SC, mbs=mbs, fem=fem, items=items, body=items["oFFRFreducedOrder"])


STILL = f"{len(LEFT[0])} nodes that no mode moves"
MASS = "rigid motions, M-orthogonal"
GIVEN = "reference= of floating_body"
HELD_BY = {  # markers come before node sets, zero rows behind both
    "RBE2, marker": (lambda: bar("RBE2"), {}, "marker 1 (marker1)"),
    "RBE3, marker": (lambda: bar("RBE3"), {}, "marker 1 (marker1)"),
    "RBE2, node set": (lambda: bar("RBE2", markers=False), {}, "node set 'left'"),
    "RBE3, node set": (lambda: bar("RBE3", markers=False), {}, "node set 'left'"),
    "free, marker": (lambda: bar("free", 6), {}, MASS),
    "free": (lambda: bar("free", 6, markers=False), {}, MASS),
    "RBE2, nothing": (lambda: without_sets(bar("RBE2", markers=False)), {}, STILL),
    "given": (bar, {"reference": mean_motion(*LEFT)}, GIVEN),
    "given, of free modes": (lambda: bar("free", 6), {"reference": mass_orthogonal()}, GIVEN),
    "rigid interfaces": (lambda: bar("RBE2"), {"interfaces": "rigid"}, f"{STILL}, 1 rigid interfaces"),
}


@pytest.mark.parametrize("name", HELD_BY)
def test_what_holds_a_body(name):
    make, options, expected = HELD_BY[name]
    assert held_by(make(), **options).endswith(f"by {expected}")


def test_reference_of_clamped_modes_are_the_nodes_that_no_mode_moves():
    """Modes clamped at nodes without markers or node sets."""
    scene, count = clamped_modes()
    assert count > 3
    assert held_by(without_sets(scene)).endswith(f"by {count} nodes that no mode moves")


def random_modes():
    return with_modes(floating.load_fem("bar"), np.random.default_rng(0).standard_normal((195, 4)))


def with_other_weights(scene):
    """RBE2 modes fit any weights of the nodes that they leave still."""
    nodes = LEFT[0]
    add_marker(scene, "left", weightingFactors=np.ones(len(nodes)) / len(nodes))
    return scene


REFERENCES = {
    "none fits": (
        random_modes,
        {},
        AssumptionError,
        "no reference conditions.*node set 'left' .*node set 'right' .*rigid motions.*reference=romerr.mean_motion",
    ),
    "none fits, nor any marker": (
        lambda: without_sets(bar("RBE3", markers=False)),
        {},
        AssumptionError,
        "no reference conditions.*rigid motions, M-orthogonal .*reference=",
    ),
    "several": (
        lambda: with_other_weights(bar("RBE2")),
        {},
        AssumptionError,
        r"several.*that differ: marker 1 \(marker1\), marker 3 \(marker3\).*reference=",
    ),
    "given, of the other face": (
        bar,
        {"reference": mean_motion(*RIGHT)},
        InputError,
        "reference= does not fit the modes.*allowed 0.03",
    ),
    "given, of free modes": (bar, {"reference": mass_orthogonal()}, InputError, "reference= does not fit the modes"),
    "given, with nodes that are not there": (
        bar,
        {"reference": mean_motion([0, 1, 500])},
        InputError,
        "reference= does not fit",
    ),
    "rigid, but RBE3 modes": (
        bar,
        {"interfaces": "rigid"},
        AssumptionError,
        "interfaces='rigid' is for RBE2 modes.*use interfaces='free'",
    ),
    "rigid, but free modes": (lambda: bar("free", 6), {"interfaces": "rigid"}, AssumptionError, "is for RBE2 modes"),
}


@pytest.mark.parametrize("name", REFERENCES)
def test_references(name):
    """Found when a solve begins, as markers may still be added before."""
    make, options, kind, message = REFERENCES[name]
    check_error(lambda: reported(make(), **options), kind, message)


@pytest.mark.parametrize("make", [lambda: with_other_weights(bar("RBE2")), bar])
def test_cure_that_the_message_names_helps(make):
    """reference= decides."""
    assert len(reported(make(), reference=mean_motion(*LEFT)).t) == 4


def test_reference_beside_rigid_interfaces_is_refused():
    """Otherwise the report names a full model that was not the one bounded."""
    options = {"reference": mean_motion(*LEFT), "interfaces": "rigid"}
    check_error(lambda: reported(bar("RBE2"), **options), AssumptionError, "interfaces='rigid'")


# --- what needs a frame at rest, or more modes ------------------------------

RUNS = {
    "state-space in a turning frame": (
        lambda: reported(bar(), estimators=("energy", "state-space")),
        "'state-space' needs a frame at rest; allowed here: .*'energy'",
        AssumptionError,
    ),
    "jumps in a turning frame": (
        lambda: reported(bar(), jumps=[1e-4]),
        "jumps= need a frame at rest; let the load grow",
        AssumptionError,
    ),
    "joint of four free modes": (
        lambda: reported(supported(HINGE, kind="free", n=4)),
        "wrenches at marker 1 .*4 modes.*Craig-Bampton",
        AssumptionError,
    ),
}


@pytest.mark.parametrize("name", RUNS)
def test_runs(name):
    """What the bounds cannot do."""
    check_refused(*RUNS[name])


def test_frame_at_rest_takes_all_estimators():
    """A clamped body is a linear one."""
    scene = supported()
    monitor = watched(scene, estimators="state-space")
    solve(scene, h=1e-4, steps=3)
    assert list(monitor.report().scope) == ["state-space"]


def test_jumps_of_a_frame_at_rest_are_no_error():
    """The load's user function gives both sides."""
    assert len(reported(clamped(), jumps=[1e-4]).t) == 4


# --- errors of a solve ------------------------------------------------------


def test_error_found_when_a_solve_begins_is_kept_and_the_run_goes_on():
    """With its own type, for every question."""
    scene = clamped(load_on_a_mode)
    monitor = watched(scene)
    solve(scene, h=1e-4, steps=3)
    assert scene.mbs.systemData.GetTime() == pytest.approx(3e-4)
    for question in (monitor.report, monitor.report, lambda: monitor.plan):
        check_error(question, AssumptionError, "modal coordinates")
    assert monitor.runs == ()


def test_wrong_body_stops_only_its_own_monitor_from_reporting():
    """Two bodies in one mbs, one of them joined by too few modes."""
    scene = supported()
    fem = floating.load_fem("bar")
    floating.reduce(fem, 4, "free")
    items = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(scene.mbs, gravity=floating.GRAVITY)
    wrong = SimpleNamespace(**{**vars(scene), "fem": fem, "items": items, "body": items["oFFRFreducedOrder"]})
    add_joint(wrong, add_marker(wrong, "left"), HINGE)
    monitors = watched(scene), watched(wrong)
    solve(scene, h=1e-4, steps=3)
    assert len(monitors[0].report().t) >= 1
    check_error(monitors[1].report, AssumptionError, "wrenches at marker")
