"""Where only the coupled bound is refused, the linearised mechanism has the estimate; where it cannot, the reason."""

from functools import cache

import numpy as np
import pytest
from exudyn import itemInterface

import exudyn_romerr as romerr
from exudyn_romerr.mbs.coupled import coupled_subject
from models import floating, mechanisms, output_truths
from tests.helpers import tolerances as tol
from tests.helpers.mechanism_runs import (
    BOTH,
    COUPLED,
    FROZEN,
    STEP,
    add_load,
    add_spring,
    from_to,
    ground_marker,
    pendulum,
    raised,
    ran_to_its_end,
    reports,
    solve,
    watch,
)

MATTERS = 1e-6  # of an output: estimates of errors below are not asked for (issue 18)
ENDED = "estimates are those under frozen inputs, for the linearised mechanism has none: "


def cancelling_springs(scene):
    """Two springs and dampers whose forces are opposite: the mechanism is the one of the truth."""
    markers = [ground_marker(scene, [0.4, 0.02, 0.03]), scene.markers["right 1"]]
    for sign in (1, -1):
        scene.mbs.AddObject(
            itemInterface.CartesianSpringDamper(
                markerNumbers=markers, stiffness=[sign * 2e4] * 3, damping=[sign * 20.0] * 3
            )
        )


def as_it_is(_):
    """Nothing is added to the scene."""


# scene, eigenmodes, kind of modes, what is added, options
CASES = {
    "tolerance": ("slider_crank", 0, "RBE3", as_it_is, {"tolerance": {"displacement": 1.0}}),
    "negative stiffness": ("sprung_body", 0, "RBE3", cancelling_springs, {}),
    "negative stiffness, two bars": ("double_pendulum", 0, "RBE2", cancelling_springs, {}),
}


@cache
def found(case, **more):
    """Reports of all bars."""
    name, n, kind, add, options = CASES[case]
    scene = output_truths.SCENES[name](n, kind)
    add(scene)
    flexible = [romerr.floating_body(scene.fem, items) for items in scene.bodies]
    asked = {"outputs": output_truths.outputs(scene), **options, **more}
    monitors = [romerr.attach(scene.mbs, flex, **asked) for flex in flexible]
    scene.solve()
    return [monitor.report() for monitor in monitors]


@pytest.mark.parametrize("case", CASES)
def test_estimate_is_that_of_the_mechanism(case):
    """Truth: all modes, same steps, of all bars; bars of issue 18: 3 % in global axes, 5 % in the frame.

    Measured: 0.12 % and 0.06 %; under frozen inputs 105 to 122 % and 17 to 460 %.
    """
    truth, compared = output_truths.stored(CASES[case][0]), set()
    for i, report in enumerate(found(case), start=1):
        assert report.scope == dict.fromkeys(BOTH, FROZEN)
        assert "no coupled bound: " in report.scope_reason
        assert case.partition(",")[0] in report.scope_reason
        assert not any(message.startswith(ENDED) for message in report.messages)
        for key, out in report.outputs.items():
            assert out.estimate_scope == COUPLED
            error = truth[f"{key} of bar {i}"] - out.value
            largest = np.max(np.abs(error))
            if largest > MATTERS * np.max(np.abs(out.value)):
                basis = out.estimate_parts["basis"] + out.estimate_parts["interfaces"]
                allowed = 0.03 if key in ("displacement", "position", "velocity") else 0.05
                assert np.max(np.abs(basis - error)) <= allowed * largest, key
                compared.add(key)
    assert compared >= {"displacement", "velocity", "displacement in the frame", "rotation", "stress"}


@pytest.mark.parametrize("case", CASES)
def test_bounds_are_those_of_frozen_inputs(case):
    """As where these were asked for, where steps with a tolerance are evaluated one by one."""
    for report, asked in zip(found(case), found(case, scope=FROZEN), strict=True):
        for key, out in report.outputs.items():
            wanted = asked.output(key)
            assert wanted.estimate_scope == FROZEN
            assert out.bound.keys() == wanted.bound.keys()
            for name, bound in wanted.bound.items():
                rounding = tol.SINGLE_STEPS * np.max(bound) if case == "tolerance" else 0.0
                np.testing.assert_allclose(out.bound[name], bound, rtol=tol.SUMS, atol=rounding)


def everything(scene):
    """Final coordinates, their rates and accelerations, multipliers; all that sensors stored."""
    system = scene.mbs.systemData
    states = system.GetODE2Coordinates, system.GetODE2Coordinates_t, system.GetODE2Coordinates_tt
    sensors = [scene.mbs.GetSensorStoredData(sensor) for sensor in scene.sensors.values()]
    return [*(read() for read in states), system.GetAECoordinates(), *sensors]


def pushed(**options):
    """A double pendulum on a spring of negative stiffness."""
    scene = pendulum(**options)
    add_spring(scene, stiffness=-10.0)
    return scene


@pytest.mark.parametrize("options", [{}, {"outputs": "tip {}", "tolerance": 1.0}], ids=["spring", "tolerance"])
def test_attaching_changes_no_bit_of_the_simulation(options):
    scene = pushed()
    solve(scene)
    before = everything(scene)
    monitors = watch(scene, **options)
    solve(scene)
    assert {monitor.report().output("probe").estimate_scope for monitor in monitors} == {COUPLED}
    for one, other in zip(before, everything(scene), strict=True):
        np.testing.assert_array_equal(other, one)


def test_continued_solve_goes_on_with_its_estimate():
    """As if it had not been interrupted, but for tangents at other steps."""
    whole, _ = reports(pushed(steps=12))
    scene = pushed(steps=12)
    monitors = watch(scene)
    for start, end in ((0, 6), (6, 12)):
        from_to(scene, start, end)
        solve(scene, updateInitialValues=True) if start == 0 else solve(scene)
    later, wanted = monitors[0].report().output("probe"), whole.output("probe").estimate_parts["basis"]
    assert later.estimate_scope == COUPLED
    allowed = 0.01 * np.max(np.abs(wanted))
    np.testing.assert_allclose(later.estimate_parts["basis"], wanted[6:], rtol=0, atol=allowed)


# --- what ends estimates ends nothing else ------------------------------------------


def fallen_back(report, *words):
    """The estimate is that under frozen inputs at all instants, and one message says why."""
    (told,) = [message for message in report.messages if message.startswith(ENDED)]
    assert all(word in told for word in words)
    out = report.output("probe")
    assert out.estimate_scope == FROZEN
    assert len(out.estimate) == len(report.t)
    assert np.isfinite(out.estimate).all()
    assert set(report.scope.values()) == {FROZEN}


def test_joint_that_is_switched_off_ends_the_estimate_alone():
    scene = pushed(steps=100)

    def switch(mbs, t):
        mbs.SetObjectParameter(scene.objects["hinge 2"], "activeConnector", t < 50.5 * STEP)
        return True

    scene.mbs.SetPostStepUserFunction(switch)
    monitor, _ = watch(scene)
    solve(scene)
    assert ran_to_its_end(scene)
    report = monitor.report()
    assert len(report.t) == 101
    fallen_back(report, "switched")


def test_solver_that_is_not_kept_has_no_estimate_of_the_mechanism():
    scene = pushed()
    monitor, _ = watch(scene)
    solve(scene, storeSolver=False)
    fallen_back(monitor.report(), "storeSolver=False")


def test_continued_solve_has_no_estimate_where_the_one_before_had_none():
    """Its error at the start is not known."""
    scene = pushed(steps=12)
    monitor, _ = watch(scene)
    from_to(scene, 0, 6)
    solve(scene, updateInitialValues=True, storeSolver=False)
    from_to(scene, 6, 12)
    solve(scene)
    fallen_back(monitor.report(), "the run before")


def test_one_bar_without_vectors_leaves_the_others_without_the_mechanism():
    scene = pendulum()
    first, second = *watch(scene, 1, initial="equilibrium"), *watch(scene, 2)
    solve(scene)
    assert first.report().output("probe").estimate_scope == FROZEN
    fallen_back(second.report(), "needs all bodies", "object 0")


def test_bound_that_ends_ends_the_estimate(monkeypatch):
    """A failure in one body's bounds is raised by its own report alone."""
    scene = pendulum(steps=5)
    first, second = watch(scene, outputs="tip {}", tolerance=1.0)
    advance, watched = type(first._watch).advance, first._watch

    def failing(self):
        advance(self)
        if self is watched and self.rows and self.rows[0][-1] > 2.5 * STEP:
            self.error = RuntimeError("on purpose")

    monkeypatch.setattr(type(watched), "advance", failing)
    solve(scene)
    assert "on purpose" in str(raised(first))
    fallen_back(second.report(), "bounds of object 0 have ended")


def test_vectors_that_cannot_be_made_leave_the_bound(monkeypatch):
    """The plan says why there is no estimate of the mechanism."""

    def failing(*_):
        raise romerr.AssumptionError("no such vectors")

    monkeypatch.setattr(coupled_subject, "EnrichedBody", failing)
    scene = pushed(steps=3)
    monitors = watch(scene)
    solve(scene)
    for monitor in monitors:
        report = monitor.report()
        assert report.output("probe").estimate_scope == FROZEN
        assert np.isfinite(report.output("probe").bound["best"]).all()
        assert "no such vectors" in str(monitor.plan)
    scene = pendulum(steps=3)  # where the bound is theirs, it is refused
    monitor, _ = watch(scene)
    solve(scene)
    assert "no such vectors" in str(raised(monitor))


# --- where frozen inputs stay -------------------------------------------------------


def other_bar(scene):
    """Another bar, which falls, without a monitor: its error may be most of that of the first."""
    mechanisms._add_bar(scene, floating.RAYLEIGH, position=[1.0, 0, 0])


STAYS = {
    "asked for": ({"scope": FROZEN}, as_it_is, "was asked for"),
    "initial state": ({"initial": "equilibrium"}, as_it_is, "initial="),
    "not attached": ({}, other_bar, "not attached"),
    "no vectors": ({"estimators": ("fast", "energy")}, cancelling_springs, "negative stiffness"),
    "load that turns": ({}, lambda s: add_load(s, bar=1, bodyFixed=True), "bodyFixed"),
}


@pytest.mark.parametrize("case", STAYS)
def test_refusals_of_the_mechanism_itself_stay_frozen(case):
    """No tangent is read: they cost what they did."""
    options, add, reason = STAYS[case]
    scene = output_truths.SCENES["sprung_body"](0, "RBE3")
    scene.settings.timeIntegration.numberOfSteps, scene.settings.timeIntegration.endTime = 5, 5e-3
    add(scene)
    (monitor,) = watch(scene, 1, **options)
    solve(scene)
    assert not monitor._hook.has_tangents
    report = monitor.report()
    assert set(report.scope.values()) == {FROZEN}
    assert reason in report.scope_reason
    assert report.output("probe").estimate_scope in (FROZEN, "")
