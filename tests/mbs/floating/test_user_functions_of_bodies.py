"""Bodies whose mass and forces come from user functions: told as the built-in ones where both are the same."""

import exudyn as exu
import numpy as np
import pytest
from exudyn.FEM import ObjectFFRFreducedOrderInterface

import exudyn_romerr as romerr
from benchmarks.by_run import told_by_run
from exudyn_romerr.errors import AssumptionError
from exudyn_romerr.mbs.scenes.found_bodies import FoundBody
from exudyn_romerr.mbs.scenes.wider_body import vectors_of, widen
from models import floating

# of the largest: two runs whose Newton iterations end at 1e-11, by tangents by differences and by closed forms
RUNS = 1e-6
WIDTHS = 1e-4  # of the largest: bounds of two runs of the built-in body differ by 3e-6
MORE = 0.01  # of one term


def nothing(cms, A, q, v):
    """The functions as Exudyn has them."""
    return 0.0


def weight_of_modes(cms, A, q, v):
    return cms.mPhitTPsi.T @ A.T @ np.array(cms.gravity)


def stiffness(cms, A, q, v):
    return -cms.stiffnessMatrixReduced @ q[cms.nODE2rigid :]


def damping(cms, A, q, v):
    return -cms.dampingMatrixReduced @ v[cms.nODE2rigid :]


def coriolis(cms, A, q, v):
    """2 sum_j Psi~^T M Psi eta_j' w; rotation parameters stay near their reference here."""
    rates = np.kron(v[cms.nODE2rigid :], np.eye(3)).T
    return 2 * cms.mPsiTildePsi.T @ rates @ (2 * v[4:7])


def constant(cms, A, q, v):
    """What makes a mode bend by 1e-7 of the bar's length."""
    return 1e-7 * np.diag(cms.stiffnessMatrixReduced)


def add_with_functions(more, of_mass=0.0):
    """AddObjectFFRFreducedOrder with user functions; more : a modal force, of_mass : share of the modal masses."""

    def add(cms, mbs, **options):
        first = cms.nODE2rigid

        def force(mbs, t, number, q, v):
            found = cms.UFforceFFRFreducedOrder(exu, mbs, t, q, v)
            A = mbs.GetNodeOutput(cms.nRigidBody, exu.OutputVariableType.RotationMatrix).reshape(3, 3)
            found[first:] += MORE * more(cms, A, np.array(q), np.array(v))
            return found

        def mass(mbs, t, number, q, v):
            found = cms.UFmassFFRFreducedOrder(exu, mbs, t, q, v).copy()
            found[0, first:], found[first:, 0] = (1 + of_mass) * found[0, first:], (1 + of_mass) * found[first:, 0]
            return found

        own = mass if of_mass else lambda mbs, t, i, q, v: cms.UFmassFFRFreducedOrder(exu, mbs, t, q, v)
        call = cms.AddObjectFFRFreducedOrderWithUserFunctions
        return call(exu, mbs, UFforce=force, UFmassMatrix=own, **options)

    return add


@pytest.fixture(scope="module")
def modes():
    """For all scenes: Exudyn's eigenvalue solver begins with random numbers."""
    fem = floating.load_fem("bar")
    floating.reduce(fem, 4)
    return fem.modeBasis


@pytest.fixture
def scene(monkeypatch, modes):
    """A function that makes a scene: of the built-in body, or (more, of_mass) of one with user functions."""

    def made(make, *functions, **options):
        with monkeypatch.context() as patch:
            patch.setattr(floating, "reduce", lambda fem, *of: setattr(fem, "modeBasis", modes))
            if functions:
                patch.setattr(
                    ObjectFFRFreducedOrderInterface, "AddObjectFFRFreducedOrder", add_with_functions(*functions)
                )
            of = make(4, **options)
        newton = of.settings.timeIntegration.newton
        newton.relativeTolerance, newton.absoluteTolerance = 1e-11, 1e-12
        return of

    return made


def flex_of(scene):
    return romerr.floating_body(scene.fem, scene.items)


def told(scene):
    """What `romerr run` tells."""
    scene.mbs.Assemble()
    return told_by_run(scene.mbs, [flex_of(scene)], scene.solve)[1]


def attached(scene):
    monitor = romerr.attach(scene.mbs, flex_of(scene))
    scene.solve()
    return monitor.report()


def assert_same(one, other):
    assert one.outputs
    assert set(one.outputs) == set(other.outputs)
    for name, a in one.outputs.items():
        b = other.outputs[name]
        np.testing.assert_allclose(a.estimate, b.estimate, rtol=0, atol=RUNS * np.abs(b.estimate).max())
        for x, y in ((a.uncertainty, b.uncertainty), (a.bound["best"], b.bound["best"])):
            known = np.isfinite(y)
            np.testing.assert_array_equal(np.isfinite(x), known)
            np.testing.assert_allclose(x[known], y[known], rtol=0, atol=WIDTHS * np.abs(y[known]).max(initial=0.0))


def test_a_mechanism_is_told_as_with_the_built_in_body(scene):
    """Gravity, which is a term of the user function, too."""
    one, other = (told(scene(floating.pendulum, *functions, t_end=0.03)) for functions in ((nothing,), ()))
    assert_same(one, other)


@pytest.mark.parametrize("make", [floating.clamped_bar, floating.pendulum])
def test_attach_tells_as_of_the_built_in_body(scene, make):
    """A body alone, whose whole error is bounded, and one that moves."""
    one, other = (attached(scene(make, *functions, t_end=0.01, h=5e-4)) for functions in ((nothing,), ()))
    assert_same(one, other)
    assert np.isfinite(other.outputs["sensor1"].bound["best"]).all()


@pytest.mark.parametrize("more", [weight_of_modes, stiffness, damping, coriolis, constant])
def test_one_per_cent_of_a_term_is_noticed(scene, more):
    of = scene(floating.pendulum, more, t_end=5e-3)
    with pytest.raises(
        AssumptionError, match=r"body 0 have other equations than .*, forces differ by .*romerr verify"
    ):
        told(of)


def test_one_per_cent_of_a_mass_is_noticed(scene):
    of = scene(floating.pendulum, nothing, MORE, t_end=5e-3)
    with pytest.raises(AssumptionError, match=r"body 0 have other equations than .*, masses differ by"):
        told(of)


def test_a_function_that_raises_away_from_the_run_is_named(scene):
    """Its body is alone on the copy: there is no sensor."""

    def by_sensor(cms, A, q, v):
        raise ValueError("no sensor here")

    of = scene(floating.pendulum, by_sensor)
    with pytest.raises(
        AssumptionError,
        match=r"functions of body 0 .* cannot be called away from the run: ValueError: no sensor here$",
    ):
        romerr.attach(of.mbs, flex_of(of))


def test_the_run_stays_as_it_is_bit_for_bit(scene):
    """So does the mass matrix that the functions write into."""
    shown, masses = [], []
    for watched in (False, True):
        of = scene(floating.pendulum, nothing, t_end=5e-3)
        if watched:
            attached(of)
        else:
            of.solve()
        shown.append([of.mbs.GetSensorStoredData(number) for number in of.sensors.values()])
        masses.append(of.cms.massMatrixFFRFreduced)
    np.testing.assert_array_equal(*shown)
    np.testing.assert_array_equal(*masses)


def test_verify_widens_it_as_the_built_in_body(scene):
    """Its functions know nothing of vectors: the built-in terms and a weight stand in for them."""
    shown = []
    for functions in ((nothing,), ()):
        of = scene(floating.pendulum, *functions, t_end=0.02)
        body = FoundBody(0, of.items["oFFRFreducedOrder"], of.fem, of.cms.nModes)
        of.mbs.Assemble()
        widen(of.mbs, body, vectors_of(of.mbs, body).P)
        of.mbs.Assemble()
        of.solve()
        shown.append(np.array([of.mbs.GetSensorStoredData(number) for number in of.sensors.values()]))
    np.testing.assert_allclose(*shown, rtol=0, atol=RUNS * np.abs(shown[1]).max())


def test_two_bodies_are_widened(scene):
    """Exudyn wants names of its own for each weight."""
    of = scene(floating.pendulum, nothing)
    second = ObjectFFRFreducedOrderInterface(of.fem)
    items = add_with_functions(nothing)(second, of.mbs, gravity=floating.GRAVITY)
    loads = of.mbs.systemData.NumberOfLoads()
    for number in (of.items["oFFRFreducedOrder"], items["oFFRFreducedOrder"]):
        widen(of.mbs, FoundBody(0, number, of.fem, second.nModes), np.eye(of.fem.NumberOfCoordinates())[:, -2:])
    assert of.mbs.systemData.NumberOfLoads() == loads + 2
    of.mbs.Assemble()
