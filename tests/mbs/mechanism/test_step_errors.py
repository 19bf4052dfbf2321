"""The time-step error of real runs: a rigid double pendulum, against runs with 8 times smaller steps."""

from functools import cache

import exudyn as exu
import numpy as np
import pytest
from exudyn import itemInterface
from exudyn.utilities import InertiaCuboid

from exudyn_romerr.estimates.mechanism_feedback import Feedback
from exudyn_romerr.mbs.access.mbs_items import scheme_of
from exudyn_romerr.mbs.coupled.feedback_runs import Reaction
from exudyn_romerr.mbs.coupled.joint_evaluation import TRAPEZOIDAL
from exudyn_romerr.mbs.derivatives.linearisation import Tangents
from exudyn_romerr.mbs.mechanism import step_errors, stored_residuals
from exudyn_romerr.mbs.mechanism.kept_equations import KeptEquations
from exudyn_romerr.mbs.mechanism.late_readings import LateReadings
from exudyn_romerr.mbs.mechanism.step_errors import StepErrors
from exudyn_romerr.mbs.mechanism.stored_residuals import StoredResiduals
from exudyn_romerr.online.coupled_runs import FirstSteps

FINER = 8
HINGE = [1, 1, 1, 1, 0, 1]


def pendulum(h, end, force=None, index2=False, spring=None, node=exu.NodeType.RotationEulerParameters):
    """Mbs and settings: two bars of 1 m in a row that fall from rest; a force(mbs, t, vector) at the end."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    bar = InertiaCuboid(density=1000.0, sideLengths=[1, 0.1, 0.1])
    ground = mbs.AddObject(itemInterface.ObjectGround())
    bars = [
        mbs.CreateRigidBody(referencePosition=[x, 0, 0], inertia=bar, gravity=[0, 0, -9.81], nodeType=node)
        for x in (0.5, 1.5)
    ]
    ends = {
        (body, x): mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=body, localPosition=[x, 0, 0]))
        for body, x in [(ground, 0.0), *((body, x) for body in bars for x in (-0.5, 0.5))]
    }
    for pair in (((ground, 0.0), (bars[0], -0.5)), ((bars[0], 0.5), (bars[1], -0.5))):
        markers = [ends[one] for one in pair]
        mbs.AddObject(itemInterface.GenericJoint(markerNumbers=markers, constrainedAxes=HINGE))
    tip = ends[bars[1], 0.5]
    if force is not None:
        mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=tip, loadVectorUserFunction=force))
    if spring is not None:
        markers = [ends[ground, 0.0], tip]
        mbs.AddObject(itemInterface.CartesianSpringDamper(markerNumbers=markers, springForceUserFunction=spring))
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    time = settings.timeIntegration
    time.endTime, time.numberOfSteps = end, round(end / h)
    time.newton.relativeTolerance, time.newton.absoluteTolerance = 1e-10, 1e-12
    time.generalizedAlpha.spectralRadius = 0.8
    time.generalizedAlpha.useIndex2Constraints = time.generalizedAlpha.useNewmark = index2
    return mbs, settings


def sampled(mbs, t):
    system = mbs.systemData
    states = system.GetODE2Coordinates, system.GetODE2Coordinates_t, system.GetODE2Coordinates_tt
    return np.array([t]), *(read()[None] for read in (*states, system.GetAECoordinates))


def joined(rows):
    return tuple(np.concatenate(of) for of in zip(*rows, strict=True))


def samples(h, end, **scene):
    """T, q, q_t, q_tt, multipliers of a run without us."""
    mbs, settings = pendulum(h, end, **scene)
    rows = []
    mbs.SetPostStepUserFunction(lambda mbs, t: rows.append(sampled(mbs, t)) or True)
    mbs.SolveDynamic(settings)
    return joined(rows)


def true_error(h, end, **scene):
    """Error of q, q_t, q_tt (3, T, n): Richardson's extrapolation, good to 1 % of 1 %."""
    coarse, fine = (np.array(samples(step, end, **scene)[1:4]) for step in (h, h / FINER))
    return (coarse - fine[:, ::FINER]) * FINER**2 / (FINER**2 - 1)


class Estimated:
    """A run with its time-step error, in blocks.

    rows : of the run. x, x2, loads : (3, T, n); None if it has ended. notes.
    """

    def __init__(self, h, end, block=1000, midpoint=True, **scene):
        self.mbs, settings = pendulum(h, end, **scene)
        self.count, self.block, self.midpoint = round(end / h) + 1, block, midpoint
        self.index2 = scene.get("index2", False)
        self.taken, self.waiting, self.parts, self.notes = [], [], [], []
        self.reaction = None
        self.mbs.SetPostStepUserFunction(self.step)
        self.mbs.SolveDynamic(settings)
        self.rows = joined(self.taken)
        x, x2, loads, *_ = self.parts[0] or (None,) * 3
        for part in filter(None, self.parts[1:]):
            known = x.shape[1] - part.replaced
            x, x2 = (np.hstack([old[:, :known], new]) for old, new in ((x, part.x), (x2, part.x2)))
            loads = None if loads is None else np.hstack([loads[:, :known], part.loads])
        self.x, self.x2, self.loads = x, x2, loads

    def begin(self, mbs):
        self.tangents = Tangents(mbs)
        residuals = StoredResiduals(self.tangents, mbs) if self.midpoint else None
        steps = StepErrors(self.tangents, residuals, self.index2, KeptEquations(mbs, may_change=False))
        scheme = TRAPEZOIDAL if self.index2 else scheme_of(mbs)
        self.reaction, self.due = Reaction([], Feedback(scheme), FirstSteps(None), self.tangents, steps), 1
        self.reaction._say = self.note  # there are no reports

    def step(self, mbs, t):
        if self.reaction is None:
            self.begin(mbs)
        self.taken.append(sampled(mbs, t))
        self.waiting.append(self.taken[-1])
        self.due -= 1
        if self.due == 0:
            self.due = self.tangents.read(mbs, t)
        if len(self.waiting) == self.block or len(self.taken) == self.count:
            self.evaluate(mbs)
        return True

    def evaluate(self, mbs):
        rows, self.waiting = joined(self.waiting), []
        LateReadings(self.tangents, mbs, rows[0], rows[1:]).read()
        if not self.parts:
            self.reaction.open(rows, None, mbs)
            self.parts.append(self.reaction.time_step)
            rows = tuple(x[1:] for x in rows)
        if len(rows[0]):
            self.reaction.advance(rows, mbs)
            self.parts.append(self.reaction.time_step)

    def note(self, notes):
        self.notes += notes
        notes.clear()


@cache
def estimated(h, end, block=1000, midpoint=True, **scene):
    return Estimated(h, end, block, midpoint, **scene)


def off(found, truth):
    return np.max(np.abs(found - truth)) / np.max(np.abs(truth))


def fast(mbs, t, vector):
    return [0.0, 0.0, 200.0 * np.sin(1000.0 * t)]


@pytest.mark.parametrize("index2", [False, True])
def test_error_of_a_double_pendulum(index2):
    """Position and velocity of all coordinates, Euler parameters too; and its error from x2."""
    e, found = true_error(5e-3, 0.6, index2=index2), estimated(5e-3, 0.6, index2=index2)
    assert off(found.x[0], e[0]) < 0.005
    assert off(found.x[1], e[1]) < 0.02
    assert off(found.x[0], e[0]) < 2 * np.abs(found.x2[0]).max() / np.abs(e[0]).max()
    # the trapezoidal rule, which holds positions here and rates there, rings
    assert np.abs(found.x2[0]).max() < (0.04 if index2 else 0.01) * np.abs(e[0]).max()
    assert found.notes == ([step_errors.DRIFTS] if index2 else [])


def test_run_is_as_without_us():
    """Bit for bit, though residuals are evaluated in its states."""
    for here, there in zip(estimated(5e-3, 0.6, block=20).rows, samples(5e-3, 0.6), strict=True):
        assert np.array_equal(here, there)


@pytest.mark.parametrize("block", [1, 7])
def test_blocks(block):
    """Tangents are others, which matters less than what the estimate is off by."""
    one, many = estimated(5e-3, 0.6), estimated(5e-3, 0.6, block=block)
    assert one.x.shape == many.x.shape
    assert off(many.x[0], one.x[0]) < 0.003  # measured 0.0024


def test_loads_between_samples():
    """One radian a step: residuals make the estimate, and what they are uncertain by is small."""
    e = true_error(1e-3, 0.1, force=fast)
    found, without = (estimated(1e-3, 0.1, midpoint=midpoint, force=fast) for midpoint in (True, False))
    assert off(found.x[0], e[0]) < 0.05
    assert off(without.x[0], e[0]) > 0.1
    assert without.loads is None
    assert np.abs(found.loads[0]).max() < 0.02 * np.abs(e[0]).max()


def test_load_that_is_switched_within_a_step():
    """Not known from samples; the uncertainty of loads says so."""

    def switched(mbs, t, vector):
        return [0.0, 0.0, 200.0 * (t > 0.0503)]

    e, found = true_error(1e-3, 0.1, force=switched), Estimated(1e-3, 0.1, force=switched)
    deviation = np.abs(found.x[0] - e[0]).max()
    assert deviation > 0.3 * np.abs(e[0]).max()
    assert deviation < 2 * np.abs(found.loads[0]).max()


def test_user_function_with_a_memory_is_not_called_between_samples():
    """It would count what the run does not do. The estimate goes on without residuals."""
    calls = []

    def spring(mbs, t, item, displacement, velocity, stiffness, damping, offset):
        calls.append(t)
        return [0.0, 0.0, 0.0]

    found = Estimated(5e-3, 0.05, spring=spring)
    assert any(stored_residuals.MEMORY in note for note in found.notes)
    assert np.isfinite(found.x).all()


def test_rotations_that_are_increments_have_no_estimate():
    found = Estimated(5e-3, 0.02, node=exu.NodeType.RotationRotationVector)
    assert found.x is None
    assert found.notes == [step_errors.INCREMENTS]


def test_what_fails_ends_the_estimate_alone(monkeypatch):
    whole = estimated(5e-3, 0.6)
    monkeypatch.setattr(step_errors, "GROWN", np.abs(whole.x[0]).max() / 2)
    found = Estimated(5e-3, 0.6, block=40)
    assert found.parts[0] is not None
    assert found.parts[-1] is None
    assert [step_errors.TOO_LARGE in note for note in found.notes] == [True]
