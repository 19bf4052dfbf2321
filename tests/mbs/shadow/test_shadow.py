"""The shadow mbs, and what linear equations leave out by it, against simulations with the vectors as modes."""

from functools import cache
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from exudyn.FEM import ObjectFFRFreducedOrderInterface

import exudyn_romerr as romerr
from exudyn_romerr import RunError
from exudyn_romerr.basis.shape_sums import ShapeSums
from exudyn_romerr.mbs.access.object_terms import object_terms
from exudyn_romerr.mbs.coupled.feedback_runs import Reaction
from exudyn_romerr.mbs.derivatives.frame_inertia import FrameInertia
from exudyn_romerr.mbs.shadow import remainder
from exudyn_romerr.mbs.shadow.measured_remainder import LEFT_OUT
from exudyn_romerr.mbs.shadow.shadow_mbs import Shadow
from models import mechanisms
from models.floating import RAYLEIGH, load_fem
from tests.helpers.mechanism_runs import pendulum, solve

# Exudyn's sums and ours, of nodes in another order: measured 1e-15 of the largest entry
SAME_TERMS = 1e-12
CLOSED = 1e-14  # of the largest force: inertia in closed form, sums in another order; measured 2e-16
# Of the remainder, which is of second order, what is of third: measured 2 %, the bar that was set is 10 %
SECOND_ORDER = 0.1
SHORT = {"slider_crank": 0.06, "sprung_body": 0.05, "double_pendulum": 0.12}  # s


class Watched:
    """A scene of models/mechanisms.py, solved with monitors: e, r and states of all coordinates, (3, T, k) each."""

    def __init__(self, scene, **options):
        self.scene, self.blocks, self.rows = scene, [], []
        self.monitor = romerr.attach(
            scene.mbs, [romerr.floating_body(scene.fem, items) for items in scene.bodies], **options
        )
        take = Reaction._take_errors

        def kept(reaction, mbs, rows, e, *others):
            self.reaction = reaction
            self.blocks.append((e, reaction._remainder.found))
            self.rows.append([x.copy() for x in rows[1:4]])
            take(reaction, mbs, rows, e, *others)

        with mock.patch.object(Reaction, "_take_errors", kept):
            solve(scene)
            self.report = self.monitor.report()

    @property
    def predicted(self):
        return np.concatenate([e - found.added for e, found in self.blocks], axis=1)

    @property
    def measured(self):
        return np.concatenate([found.r for _, found in self.blocks], axis=1)

    @property
    def states(self):
        """With vectors, which do not move."""
        n = self.rows[0][0].shape[1]
        found = np.zeros_like(self.predicted)
        found[:, :, :n] = [np.concatenate(x) for x in zip(*self.rows, strict=True)]
        return found


def with_vectors(make, bodies):
    """States (3, T, k) of a scene whose bars have vectors as modes, in the order of the mechanism with vectors."""
    shapes = iter(body.shapes for body, _ in bodies)

    def reduced(fem):
        fem.modeBasis = {"matrix": next(shapes), "type": "modes and vectors"}
        return ObjectFFRFreducedOrderInterface(fem, roundMassMatrix=0, roundStiffnessMatrix=0)

    with mock.patch.object(mechanisms, "ObjectFFRFreducedOrderInterface", reduced):
        scene = make()
    rows = []

    def keep(mbs, t):
        system = mbs.systemData
        rows.append([system.GetODE2Coordinates(), system.GetODE2Coordinates_t(), system.GetODE2Coordinates_tt()])
        return True

    scene.mbs.SetPostStepUserFunction(keep)
    solve(scene)
    return np.array(rows).swapaxes(0, 1)


@cache
def compared(name, every):
    """What linear equations leave out of all coordinates, as measured and truly, and what they predict, (T, k)."""

    def make():
        return getattr(mechanisms, name)(4, t_end=SHORT[name])

    with mock.patch.multiple(remainder, EVERY=every, FARTHER=1, PAYS=np.inf):
        watched = Watched(make())
    places = watched.reaction._remainder._shadow._places
    true = with_vectors(make, watched.reaction.parts)[..., places] - watched.states - watched.predicted
    return watched, watched.measured[0], true[0]


def parts_of(watched):
    """Outputs of the first bar's deformation (R, k), and the rows of its frame's position."""
    body, own = watched.reaction.parts[0]
    k = watched.predicted.shape[2]
    outputs = np.zeros((len(body.offline.value_rows), k))
    outputs[:, np.r_[body.modal, own]] = body.offline.value_rows
    return outputs, np.eye(k)[body.columns[:3]]


@pytest.mark.parametrize("name", ["slider_crank", "sprung_body"])
def test_remainder_is_the_true_one(name):
    """Within 10 % at all samples; truth: a simulation of the same steps with the vectors as modes."""
    watched, measured, true = compared(name, 1)
    for rows in parts_of(watched):
        of_all = np.abs(true @ rows.T).max()
        assert np.abs((measured - true) @ rows.T).max() < SECOND_ORDER * of_all
        assert of_all < 0.1 * np.abs(watched.predicted[0] @ rows.T).max()


def test_now_and_then_it_tells_the_size():
    """Looked at where tangents are farthest, and linear from there to where it is looked at next: rather too much."""
    watched, measured, true = compared("slider_crank", remainder.EVERY)
    for rows in parts_of(watched):
        found, of_all = (np.abs(x @ rows.T).max() for x in (measured, true))
        assert 0.4 * of_all < found < 2 * of_all  # measured 1.4
    share = watched.report.remainder["auxiliary"]
    outputs = parts_of(watched)[0]
    assert 0.1 * share < np.abs(true @ outputs.T).max() / np.abs(watched.predicted[0] @ outputs.T).max() < 10 * share


def test_terms_of_modes_are_those_that_exudyn_makes():
    fem, rng = load_fem("bar"), np.random.default_rng(5)
    U = rng.standard_normal((3 * fem.NumberOfNodes(), 4))
    fem.modeBasis = {"matrix": U, "type": "any"}
    cms = ObjectFFRFreducedOrderInterface(fem, roundMassMatrix=0, roundStiffnessMatrix=0)
    items = {"oFFRFreducedOrder": 0, "nGenericODE2": 0, "nRigidBody": 0}
    flex = romerr.floating_body(fem, items)
    sums = ShapeSums.of(flex.mass, flex.stiffness, flex.positions, U)
    found = object_terms(
        SimpleNamespace(shapes=U, sums=sums, damping=lambda X, Y, M, K: RAYLEIGH[0] * M + RAYLEIGH[1] * K)
    )
    names = [name for name in found if name.startswith("m") and hasattr(cms, name)]
    assert len(names) == 9 - 1
    for name in names:
        mine, wanted = found[name], getattr(cms, name)
        mine = mine.Convert2DenseMatrix() if hasattr(mine, "Convert2DenseMatrix") else mine
        np.testing.assert_allclose(mine, wanted, rtol=0, atol=SAME_TERMS * np.abs(wanted).max(), err_msg=name)


def test_runs_are_equal_bit_for_bit():
    """With a shadow beside, and without us."""
    scene = mechanisms.slider_crank(4, t_end=0.01, assemble=True)
    solve(scene)
    wanted = [scene.mbs.GetSensorStoredData(sensor) for sensor in scene.sensors.values()]
    assert Watched(scene).report.remainder
    for sensor, values in zip(scene.sensors.values(), wanted, strict=True):
        np.testing.assert_array_equal(scene.mbs.GetSensorStoredData(sensor), values)


@pytest.fixture(scope="module")
def watched():
    return Watched(mechanisms.sprung_body(1, t_end=2e-3))


def made(watched):
    return Shadow(watched.scene.mbs, watched.reaction.parts, watched.reaction._tangents)


def test_functions_that_keep_something_are_put_back_and_refused(watched):
    """Their values are those of another call then."""
    mbs = watched.scene.mbs

    def counting(mbs, t, vector):
        mbs.variables["calls"] += 1
        return [0.0, 0.0, float(mbs.variables["calls"])]

    mbs.variables["calls"], before = 7, mbs.GetLoad(1)["loadVectorUserFunction"]["function"]
    mbs.SetLoadParameter(1, "loadVectorUserFunction", counting)
    with pytest.raises(RunError, match="keeps something from call to call"):
        made(watched)
    assert mbs.variables.pop("calls") == 7
    mbs.SetLoadParameter(1, "loadVectorUserFunction", before)


@pytest.mark.parametrize("fails", [False, True])
def test_what_functions_begin_to_keep_is_put_back_and_refused(watched, fails):
    """At the end of a block, whatever ends it."""
    mbs, before = watched.scene.mbs, watched.scene.mbs.GetLoad(1)["loadVectorUserFunction"]["function"]
    mbs.SetLoadParameter(1, "loadVectorUserFunction", lambda mbs, t, v: [*before(mbs, t, v), mbs.variables][:3])
    shadow = made(watched)
    mbs.SetLoadParameter(1, "loadVectorUserFunction", before)
    mbs.variables["calls"] = 7

    def block():
        with shadow.functions_kept():
            mbs.variables["calls"] = 8
            if fails:
                raise ValueError

    with pytest.raises(RunError, match="keeps something from call to call"):
        block()
    assert mbs.variables.pop("calls") == 7


def test_closed_forms_give_what_exudyn_gives(watched):
    """All coordinates and vectors move, in several states at once; against the body's own equations in Exudyn."""
    with mock.patch.object(FrameInertia, "all_of", return_value=()):
        wanted = made(watched)
    found, rng = made(watched), np.random.default_rng(6)
    assert found._inertias
    sizes = np.array([1e-3, 0.1, 10.0])
    rows = [np.linspace(0.0, 1e-3, 5), *rng.normal(size=(3, 5, len(found._places))) * sizes[:, None, None]]
    with found.functions_kept(), wanted.functions_kept():
        (forces, drift), (of_exudyn, other) = found.residuals(rows), wanted.residuals(rows)
    np.testing.assert_allclose(forces, of_exudyn, rtol=0, atol=CLOSED * np.abs(of_exudyn).max())
    np.testing.assert_array_equal(drift, other)


def test_another_mbs_than_it_was_is_noticed(watched):
    mbs, spring, shadow = watched.scene.mbs, watched.scene.objects["left spring"], made(watched)
    shadow.compare(mbs)
    stiffness = mbs.GetObject(spring)["stiffness"]
    mbs.SetObjectParameter(spring, "stiffness", 1.001 * stiffness)
    with pytest.raises(RunError, match="other equations: forces differ"):
        shadow.compare(mbs)
    mbs.SetObjectParameter(spring, "stiffness", stiffness)


def test_what_cannot_be_measured_is_said():
    """And 1 % of the prediction stands in for it."""
    scene = pendulum(steps=40)

    with mock.patch.object(Shadow, "compare", side_effect=RunError("the reason")):
        watched = Watched(scene, auxiliary_modes=3)
    assert watched.report.remainder == {}
    assert [m for m in watched.report.messages if "the reason" in m] == [LEFT_OUT.format("the reason")]


@pytest.mark.parametrize("last", [1, 2])
def test_what_fails_on_the_way_ends_the_measurement_alone(last):
    """Where some parts of a block were gone through, and some were not."""
    calls, residuals = [], Shadow.residuals

    def failing(self, rows):
        calls.append(len(rows[0]))
        if len(calls) > last:
            raise RunError("the reason")
        return residuals(self, rows)

    with mock.patch.object(Shadow, "residuals", failing):
        watched = Watched(mechanisms.double_pendulum(0, h=1e-3, t_end=0.06))
    assert len(calls) == last + 1
    assert [m for m in watched.report.messages if "the reason" in m] == [LEFT_OUT.format("the reason")]


def test_the_share_is_saved_and_said(watched, tmp_path):
    report = watched.report
    assert 0 < report.remainder["auxiliary"] < 1e-3
    assert f"leave out about {100 * report.remainder['auxiliary']:.2g} % of the deformation" in str(report)
    report.save(tmp_path / "run.npz")
    assert romerr.load_report(tmp_path / "run.npz").remainder == report.remainder
