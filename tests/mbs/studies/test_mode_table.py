"""mode_table: kinds, frequencies and masses against dense ones of the same bodies; what a run tells of modes."""

import csv
import os
import pickle

import exudyn as exu
import numpy as np
import pytest
import scipy.linalg as la
from exudyn.FEM import HCBstaticModeSelection, ObjectFFRFreducedOrderInterface
from exudyn.itemInterface import SensorObject

import exudyn_romerr as romerr
from exudyn_romerr.__main__ import main
from models import floating, linkage, mechanisms, wishbone
from tests.helpers.observed import named, shown

WAYS = ["displacement x", "displacement y", "displacement z", "rotation x", "rotation y", "rotation z"]
NONE = "The first interface has none (interface 1 "
EXACT = 1e-8  # relative, of what LAPACK finds of low modes twice


def made(fem):
    """The body in an mbs of its own, with what keeps that alive."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    items = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(
        mbs, massProportionalDamping=floating.RAYLEIGH[0], stiffnessProportionalDamping=floating.RAYLEIGH[1]
    )
    return romerr.floating_body(fem, items), (SC, mbs)


def bar(kind="RBE3", n=4):
    fem = floating.load_fem("bar")
    floating.reduce(fem, n, kind)
    return fem


def held_space(fem):
    """Displacements that leave the mean motion of the left face zero, (N, N - 6)."""
    C = floating._mean_motion(fem.GetNodePositionsAsArray(), *floating.interface(fem, "left"))
    return la.qr(C.T)[0][:, len(C) :]


def ways(table):
    """What is static, without nodes: number of interface and direction of each."""
    static = [kind.removesuffix(" (by its place)") for kind in table.kinds if "static" in kind]
    return [(kind.split(" ")[2].rstrip(","), kind.rsplit(", ", 1)[1].lstrip("-")) for kind in static]


@pytest.mark.parametrize("kind", ["RBE2", "RBE3"])
def test_coordinates_of_two_interfaces(kind):
    table = romerr.mode_table(made(bar(kind))[0])
    assert ways(table) == [("2", way) for way in WAYS]
    assert all("'right'" in text for text in table.kinds[:6])
    assert list(table.kinds[6:]) == [f"eigenmode {k}" for k in (1, 2, 3, 4)]
    assert table.why.startswith(f"10 coordinates: 6 static modes of 1 interface and 4 eigenmodes. {NONE}('left'): 6 ")


def test_signs_of_rotations_are_told():
    """Exudyn's RBE2 modes turn an interface against the axis: the motion of its nodes tells."""
    fem = bar("RBE2")
    nodes, _ = floating.interface(fem, "right")
    arms = fem.GetNodePositionsAsArray()[nodes] - fem.GetNodePositionsAsArray()[nodes].mean(axis=0)
    told = romerr.mode_table(made(fem)[0]).kinds[3:6]
    for axis, text in enumerate(told):
        moved = fem.modeBasis["matrix"][:, 3 + axis].reshape(-1, 3)[nodes]
        turned = np.cross(np.eye(3)[axis], arms)
        assert ("-rotation" in text) == (np.sum(moved * turned) < 0)


@pytest.mark.parametrize(("kind", "last"), [("RBE2", 3), ("RBE3", 4)])
def test_coordinates_of_more_interfaces(kind, last):
    """A body that NGsolve made: 12 static modes, and not 18. RBE3 modes move other interfaces, too, by 0.25 %."""
    fem = wishbone.load_fem()
    wishbone.reduce(fem, 2, kind, wishbone.INTERFACES[:last])
    table = romerr.mode_table(made(fem)[0])
    assert ways(table) == [(str(i), way) for i in range(2, last + 1) for way in WAYS]
    for i, name in enumerate(wishbone.INTERFACES[1:last]):
        assert all(f"({name!r})" in text for text in table.kinds[6 * i : 6 * i + 6])
    static = f"{6 * (last - 1)} static modes of {last - 1} interfaces"
    assert table.why.startswith(f"{6 * last - 4} coordinates: {static} and 2 eigenmodes. {NONE}('front')")
    assert np.all(table.frequencies.off > 0)


def test_interfaces_without_names():
    """Zeros of RBE2 modes tell nodes; of RBE3 modes nothing does, but their order."""
    for kind, said in (("RBE2", "static, interface 2, displacement x"), ("RBE3", "(by its place)")):
        fem = bar(kind)
        fem.nodeSets = []
        table = romerr.mode_table(made(fem)[0])
        assert ways(table)[0][0] == "2"
        assert said in table.kinds[0]
        assert (table.frequencies is None) == (kind == "RBE3")  # nothing tells what holds the body


def test_no_interface_left_out():
    fem = floating.load_fem("bar")
    nodes, weights = zip(*(floating.interface(fem, name) for name in ("left", "right")), strict=True)
    mode = HCBstaticModeSelection.RBE2
    fem.ComputeHurtyCraigBamptonModes(
        nodes, 2, computationMode=mode, boundaryNodesWeights=weights, excludeRigidBodyMotion=False
    )
    table = romerr.mode_table(made(fem)[0])
    assert ways(table) == [(i, way) for i in ("1", "2") for way in WAYS]
    assert "No interface was left out" in table.why
    assert table.frequencies is None
    assert np.sum(table.coordinates.mass, axis=0) == pytest.approx(np.ones(3), abs=EXACT)  # rigid motions have it all


@pytest.mark.parametrize("kind", ["RBE2", "RBE3"])
def test_frequencies_are_those_of_dense_matrices(kind):
    fem = bar(kind)
    Z, V = held_space(fem), fem.modeBasis["matrix"]
    full = np.sqrt(la.eigvalsh(Z.T @ (fem.stiffnessMatrix @ Z), Z.T @ (fem.massMatrix @ Z)))[: V.shape[1]]
    reduced = np.sqrt(la.eigvalsh(V.T @ (fem.stiffnessMatrix @ V), V.T @ (fem.massMatrix @ V)))
    found = romerr.mode_table(made(fem)[0]).frequencies
    assert found.reduced == pytest.approx(reduced, rel=EXACT)
    assert found.full == pytest.approx(full, rel=EXACT)
    assert np.all(np.abs(reduced / full - 1 - found.off) <= found.within + EXACT)
    assert np.all(found.off >= -found.within)  # Galerkin: from above


def test_certified_difference_needs_its_residual():
    """Of modes that are not converged the difference to the true frequency is within what their residual tells."""
    body, *_ = linkage.build()
    rng = np.random.default_rng(1)
    modes = body.modes(3)
    X = modes.shapes + 1e-3 * rng.standard_normal(modes.shapes.shape) * np.abs(modes.shapes).max()
    theta = np.einsum("ij,ij->j", X, body.K @ X) / np.einsum("ij,ij->j", X, body.M @ X)
    factor = body.stiffness_factor
    left = np.linalg.norm(factor.half_solve(body.K @ X - (body.M @ X) * theta), axis=0)
    within = left / np.linalg.norm(factor.half_multiply(X), axis=0)
    every = body.all_modes().omega ** 2
    off = np.abs(theta[:, None] / every - 1).min(axis=1)
    assert np.all(off <= within)
    assert np.all(off > 0)


def test_masses_of_a_complete_basis():
    fem = bar("complete")
    table = romerr.mode_table(made(fem)[0])
    Z, mass = held_space(fem), fem.GetMassMatrix(sparse=True)
    shift = np.tile(np.eye(3), (mass.shape[0] // 3, 1))
    pull = Z.T @ (mass @ shift)
    all_there = np.diag(pull.T @ la.solve(Z.T @ (mass @ Z), pull)) / np.diag(shift.T @ (mass @ shift))
    assert table.coordinates.mass.sum(axis=0) == pytest.approx(all_there, rel=EXACT)
    assert np.all(all_there > 0.9)  # what the face that holds the body carries is little
    assert not len(table.frequencies.missing)
    assert table.frequencies.off == pytest.approx(np.zeros(len(table.kinds)), abs=1e-6)  # the highest: LAPACK's rest


def test_linear_body_of_arrays():
    """A chain of masses, held at one end: all modes have all mass but that of the support, damping as given."""
    n = 8
    K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    K[-1, -1] = 1.0
    body = romerr.ElasticBody(np.eye(n * 3), np.kron(K, np.eye(3)), rayleigh=(0.02, 0.1), positions=np.eye(n, 3))
    whole = romerr.mode_table(body, basis=romerr.modal_basis(body, 3 * n))
    assert whole.coordinates.mass.sum(axis=0) == pytest.approx(np.ones(3))
    omega = np.repeat(2 * np.sin((2 * np.arange(n) + 1) * np.pi / (2 * (2 * n + 1))), 3)
    assert whole.frequencies.full == pytest.approx(omega)
    assert whole.frequencies.zeta == pytest.approx(0.01 / omega + 0.05 * omega)
    assert whole.coordinates.zeta == pytest.approx(whole.frequencies.zeta)
    few = romerr.mode_table(body, basis=few_basis(body))
    assert few.kinds == ["vector"] * 2
    assert "Krylov" in few.why
    lowest = romerr.mode_table(body, basis=romerr.modal_basis(body, 3))
    assert all("eigenmode at" in kind for kind in lowest.kinds)
    assert [k for k, *_ in lowest.frequencies.missing] == [*range(3, 9)]
    V, turn = few_basis(body).V, np.array([[1.0, 0.3], [-0.2, 0.9]])
    one, other = (romerr.mode_table(body, basis=romerr.Basis(V, W)).frequencies for W in (None, V @ turn))
    for name in ("reduced", "zeta", "off"):  # W spans what V does
        assert getattr(other, name) == pytest.approx(getattr(one, name))


def few_basis(body):
    return romerr.krylov_basis(body, np.eye(body.N, 1), 2)


def test_free_eigenmodes():
    table = romerr.mode_table(made(bar("free"))[0])
    assert table.kinds == [f"eigenmode {k}" for k in (1, 2, 3, 4)]
    assert table.coordinates.mass == pytest.approx(np.zeros((4, 3)), abs=EXACT)
    assert table.frequencies.full == pytest.approx(table.coordinates.omega, rel=EXACT)
    assert [k for k, *_ in table.frequencies.missing] == [*range(4, 10)]


def test_formats(tmp_path):
    table = romerr.mode_table(made(bar())[0])
    table.save(tmp_path / "modes.csv")
    head, *lines = csv.reader((tmp_path / "modes.csv").read_text(encoding="utf-8").splitlines())
    assert len(lines) == 10
    assert float(lines[3][head.index("alone [Hz]")]) == table.coordinates.omega[3] / (2 * np.pi)
    table.save(tmp_path / "modes.html")
    page = (tmp_path / "modes.html").read_text(encoding="utf-8")
    assert table.why.split(".")[0] in page
    assert page.count("<tr>") == 2 + 10 + 10
    text = str(table)
    assert "off by at most" in text
    assert "Not there, the lowest of the full body: mode 9" in text


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((3,), "flex"),
        ((romerr.ElasticBody(np.eye(2), np.eye(2)),), "basis"),
    ],
)
def test_wrong_input(arguments, said):
    with pytest.raises(romerr.InputError, match=said):
        romerr.mode_table(*arguments)


def without(make, mode):
    """A scene whose bodies lack a mode; None: none."""

    def lacking(plain):
        def reduce(fem, *arguments):
            plain(fem, *arguments)
            V = fem.modeBasis["matrix"]
            fem.modeBasis = {**fem.modeBasis, "matrix": V if mode is None else np.delete(V, mode, axis=1)}

        return reduce

    with pytest.MonkeyPatch.context() as patch:
        for module in (floating, mechanisms, wishbone):
            patch.setattr(module, "reduce", lacking(module.reduce))
        scene = make()
    named(scene)
    return scene


def held_pendulum():
    """A pendulum and the force in its hinge."""
    scene = floating.pendulum(1, h=1e-3, t_end=0.03)
    hinge = {"objectNumber": scene.mbs.systemData.NumberOfObjects() - 1, "storeInternal": True}
    force = SensorObject(outputVariableType=exu.OutputVariableType.ForceLocal, **hinge)
    scene.sensors["hinge"] = scene.mbs.AddSensor(force)
    return scene


# m, times 1e-3: the bearing of the rotor moves by less along its axis, which is of second order in the deformation
OF_FIRST_ORDER = 1e-9
SCENES = {
    "pendulum": held_pendulum,
    "crank, RBE2": lambda: mechanisms.slider_crank(1, "RBE2", h=5e-4, t_end=0.03),
    "sprung": lambda: mechanisms.sprung_body(3, h=1e-3, t_end=0.03),
    "rotor": lambda: floating.rotor(2, h=5e-4, t_end=0.05),
}


def told(make):
    """A run, what its sensors have stored, and its table."""
    scene = without(make, None)
    items = scene.bodies[0] if hasattr(scene, "bodies") else scene.items
    flex = romerr.floating_body(scene.fem, items)
    monitor = romerr.attach(scene.mbs, [flex])
    scene.solve()
    return shown(scene), romerr.mode_table(flex, monitor.report()), monitor.report()


def compare(make, modes=None):
    """Hold what is told of modes against the same scene without them; return of how many sensors."""
    before, table, _ = told(make)
    looked_at = 0
    for mode in range(len(table.kinds)) if modes is None else modes:
        scene = without(make, mode)
        scene.solve()
        for sensor, values in shown(scene).items():
            change, (_, grows) = np.abs(values - before[sensor]).max(), table.in_run.sensors[sensor]
            size = np.ptp(before[sensor], axis=0).max()
            if change > 1e-3 * size > OF_FIRST_ORDER and np.isfinite(grows[mode]):
                assert grows[mode] == pytest.approx(change, rel=0.1)  # first order, as was asked for
                looked_at += 1
    return looked_at


@pytest.mark.parametrize("name", SCENES)
def test_without_a_mode(name):
    assert compare(SCENES[name]) >= 4


def released():
    """A bar on springs, in the equilibrium of a static solve under its weight and a load, which grows then."""
    at_rest = [True]
    scene = mechanisms.sprung_body(
        3, h=1e-3, t_end=0.03, force=lambda t: (0.0, 0.0, 1e3 if at_rest else 1e3 + 3e2 * np.sin(80.0 * t) ** 4)
    )
    for i in range(scene.mbs.systemData.NumberOfLoads()):
        if scene.mbs.GetLoad(i)["loadType"] == "MassProportional":
            scene.mbs.SetLoadParameter(i, "loadVectorUserFunction", 0)

    def solve():
        scene.mbs.Assemble()
        scene.settings.staticSolver.verboseMode = 0
        scene.mbs.SolveStatic(scene.settings, updateInitialValues=True)
        at_rest.clear()
        scene.mbs.SolveDynamic(scene.settings)

    scene.solve = solve
    return scene


QUARTER_CAR = pytest.param(
    lambda: wishbone.quarter_car(1, static=wishbone.INTERFACES[:3], t_end=0.02), (2,), marks=pytest.mark.slow
)


@pytest.mark.parametrize(("make", "modes"), [(released, (2, 4, 5)), QUARTER_CAR], ids=["bar", "car"])
def test_without_a_mode_from_an_equilibrium(make, modes):
    """What stands in the equilibrium of a static solve would stand in another one without the mode.

    Not of mode 8 of the car, which carries so much that the wheel moves by 1e-6 m of second order, a third of what it
    changes.
    """
    assert compare(make, modes) >= 2


def test_what_modes_do_in_a_run():
    """Strain energy against the coordinates that Exudyn stored; what is missed most is there with one mode more."""
    make = lambda: floating.pendulum(2, h=1e-3, t_end=0.04)  # noqa: E731
    _, table, report = told(make)
    assert np.sum(table.in_run.energy) == pytest.approx(1.0)
    assert int(np.argmax(table.in_run.energy)) == 1  # the force shakes it along y
    text = str(table)
    assert "strain energy" in text
    assert "Missed most in the run: mode" in text
    shares = [share for _, _, share in table.frequencies.missed]
    assert shares == sorted(shares, reverse=True)
    assert 0 < sum(shares) <= 1 + EXACT
    assert table.coordinates.zeta == pytest.approx(
        floating.RAYLEIGH[0] / (2 * table.coordinates.omega) + floating.RAYLEIGH[1] * table.coordinates.omega / 2
    )
    _, wider, _ = told(lambda: floating.pendulum(6, h=1e-3, t_end=0.04))
    assert np.trace(wider.in_run.squares) < np.trace(table.in_run.squares)
    table.save(os.devnull)
    loaded = pickle.loads(pickle.dumps(report))
    flex = made(bar(n=2))[0]
    assert "is not known: the report was loaded" in str(romerr.mode_table(flex, loaded))
    with pytest.raises(romerr.InputError, match="report is of bodies 0, not of body 0 with 11 modes"):
        romerr.mode_table(made(bar(n=5))[0], report)


def test_command(tmp_path, capfd):
    """All bodies of a script; a table beside it."""
    script = tmp_path / "script.py"
    script.write_text(
        "from models import mechanisms\n"
        "scene = mechanisms.double_pendulum(1, t_end=0.02)\n"
        "scene.mbs.Assemble()\nscene.mbs.SolveDynamic(scene.settings)\n"
    )
    assert main(["modes", "--table", str(tmp_path / "modes.csv"), str(script)]) == 0
    text = capfd.readouterr().out
    assert text.count("7 coordinates: 6 static modes of 1 interface and 1 eigenmode.") == 2
    assert text.count("without the coordinate, to first order") == 2
    assert len((tmp_path / "modes.csv").read_text().splitlines()) == 1 + 14
    script.write_text("import exudyn\n")
    assert main(["modes", str(script)]) == 0
    assert "nothing to tell" in capfd.readouterr().out
    assert main(["modes", "--table", "modes.npz", str(script)]) == 2


def test_fem_without_modes():
    flex = made(bar())[0]
    flex.fem.modeBasis = {}
    with pytest.raises(romerr.InputError, match="fem has no modes of its 195 coordinates"):
        romerr.mode_table(flex)


def test_other_node_sets_are_no_interfaces():
    """One in the middle, which modes move in several directions; one of the first interface and its neighbours."""
    fem = bar("RBE3")
    X = fem.GetNodePositionsAsArray()
    middle, near = (np.flatnonzero(np.abs(X[:, 0] - x) < 0.06) for x in (0.2, 0.0))
    assert min(len(middle), len(near)) > 6
    others = [{"Name": name, "NodeNumbers": x, "NodeWeights": []} for name, x in (("middle", middle), ("near", near))]
    fem.nodeSets = [*others, *fem.nodeSets]
    table = romerr.mode_table(made(fem)[0])
    assert ways(table) == [("2", way) for way in WAYS]
    assert f"{NONE}('left')" in table.why
    assert all("'right'" in text for text in table.kinds[:6])
