"""choose_modes: forecasts against runs, chosen bases against the truth, and what is said where none is enough."""

import re
from dataclasses import replace
from functools import partial

import exudyn as exu
import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.mbs.studies.two_level import Trial, build_trial
from exudyn_romerr.mode_selection.modal_forecast import Ladder, forecasts
from exudyn_romerr.mode_selection.mode_choice import BASIS, INTERFACES, STEP
from models import exact, floating, linkage, mechanism_truths, mechanisms
from tests.helpers import tolerances as tol
from tests.helpers.observed import attached

# A run's auxiliary vectors hold its error to about 1 %, and what they leave shrinks with more modes. In the slider
# crank forecasts from 2 modes up to 12 are within 4 % of the runs, but for bounds that the slack makes.
FORECAST = 0.05
MODES = (1, 2, 6, 10)


def crank(n, kind="RBE3", steps=120, **options):
    """A slider crank with outputs in the middle and at the end of the rod."""
    scene = mechanism_truths.half_crank(n, kind, steps)
    tip = int(floating.interface(scene.fem, "tip")[0][0])
    outputs = [romerr.node_displacement(name, node=k) for name, k in (("tip", tip), ("mid", mechanisms.MIDDLE))]
    return scene.mbs, attached(scene, outputs=outputs, **options), scene.settings


def swing(n, kind="RBE3", **options):
    """A pendulum that is kicked smoothly, sampled so that steps do not matter."""
    scene = mechanism_truths.kicked(n, kind)
    scene.mbs.SetSensorParameter(scene.sensors["tip local"], "name", "tip")
    monitor = attached(scene, outputs=[scene.sensors["tip local"]], **options)
    return scene.mbs, monitor, scene.settings


def stabiliser(n, steps=400, make=romerr.modal_basis):
    """The linkage of the paper for 0.2 s."""
    body, B, tip = linkage.build()
    basis = romerr.krylov_basis(body, B, n) if make is romerr.krylov_basis else make(body, n)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=B, input_function=linkage.force)
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = 0.2, steps
    settings.solution.file.write = False
    return mbs, romerr.attach(mbs, flex, outputs=[tip]), settings


def solved(made):
    """Report of the scene's only body."""
    return build_trial(lambda: made).solve()[0]


@pytest.fixture(scope="module")
def crank_truth():
    stored = mechanism_truths.stored("half_crank")
    return {"tip": stored["tip 1 local"], "mid": stored["middle 1 local"]}


def noting(build, built):
    """Build, and keep what was built."""

    def build_and_note(n):
        built.append(build(n))
        return built[-1]

    return build_and_note


def forecasts_from(build, n, most):
    """Forecasts of a run with n modes."""
    mbs, monitor, _ = build(most)
    ladder = Ladder(*monitor.subject.modes(mbs), most)
    mbs, monitor, settings = build(n)
    monitor.subject.add(ladder.internal_outputs(monitor.subject.outputs))
    report = solved((mbs, monitor, settings))
    return forecasts(report, monitor.runs[-1].internal(), monitor.subject.body, ladder, range(n)), report


@pytest.mark.parametrize("kind", ["RBE2", "RBE3"])
def test_forecast_is_what_runs_with_more_and_fewer_modes_find(kind):
    build = partial(crank, kind=kind)
    forecast, report = forecasts_from(build, 4, 12)
    assert list(report.outputs) == ["tip", "mid"]
    for n in MODES:
        for name, out in solved(build(n)).outputs.items():
            found = np.max(out.bound["best"])
            assert forecast[name].bound(range(n)) == pytest.approx(
                found, abs=FORECAST * found + forecast[name].largest_slack
            )


def test_forecast_of_outputs_in_global_axes():
    """They are seen through the frame's rotation. Velocities there have frozen inputs, and much slack."""

    def build(n):
        scene = mechanism_truths.kicked(n)
        outputs = [
            romerr.node_displacement("mid", node=mechanisms.MIDDLE, frame="global"),
            romerr.node_velocity("speed", node=mechanisms.MIDDLE, frame="global"),
        ]
        options = {"time": "sampled", "scope": "inputs frozen"}
        return scene.mbs, attached(scene, outputs=outputs, **options), scene.settings

    forecast, _ = forecasts_from(build, 4, 8)
    for n in (0, 1, 2, 6):
        for name, out in solved(build(n)).outputs.items():
            found = np.max(out.bound["best"])
            slack = max(forecast[name].largest_slack, np.max(out.corrected_bound))
            assert forecast[name].bound(range(n)) == pytest.approx(found, abs=FORECAST * found + slack)
    assert forecast["mid"].bound(range(0)) > 100 * forecast["mid"].largest_slack


def test_forecast_of_velocities():
    """As the frame sees them: the bar's middle moves by its first and fifth mode."""

    def build(n):
        scene = mechanism_truths.half_crank(n)
        flex = romerr.floating_body(scene.fem, scene.bodies[0])
        out = romerr.node_velocity("speed", node=mechanisms.MIDDLE)
        return scene.mbs, romerr.attach(scene.mbs, flex, outputs=[out]), scene.settings

    forecast = forecasts_from(build, 2, 12)[0]["speed"]
    for n in (0, 1, 4, 6, 10):
        found = np.max(solved(build(n)).output("speed").bound["best"])
        assert forecast.bound(range(n)) == pytest.approx(found, abs=FORECAST * found + forecast.largest_slack)
    assert forecast.bound(range(0)) > 10 * forecast.largest_slack


def test_onlookers_change_no_bound_and_forecast_that_of_their_run():
    (forecast, with_content), without = forecasts_from(crank, 4, 12), solved(crank(4))
    for name, out in without.outputs.items():
        seen = with_content.output(name).bound["best"]
        assert forecast[name].bound(range(4)) == pytest.approx(seen.max(), rel=tol.SUMS)
        # modes of two builds differ in the last digits
        np.testing.assert_allclose(seen, out.bound["best"], rtol=1e-3, atol=1e-3 * seen.max())


def test_onlookers_do_not_decide_on_auxiliary_modes():
    _, report = forecasts_from(stabiliser, 4, 24)
    line = next(line for line in str(report.plan).splitlines() if "'auxiliary'" in line)
    assert line in str(solved(stabiliser(4)).plan)


@pytest.mark.parametrize("share", [pytest.param(1e-2, marks=pytest.mark.slow), 3e-3])
def test_slider_crank_needs_the_modes_that_the_truth_asks_for(share, crank_truth):
    """The chosen basis is within the tolerance, one mode less is not, by the error itself."""
    built = []
    choice = romerr.choose_modes(noting(crank, built), share, relative=True)  # of each output
    assert choice.met
    assert sum(len(monitor.runs) for _, monitor, _ in built) <= 4
    worst = {}
    for n in (choice.n - 1, choice.n):
        report = choice.reports[0] if n == choice.n else solved(crank(n))
        worst[n] = 0.0
        for name, y in crank_truth.items():
            out = report.output(name)
            error = np.abs(y - out.value)
            assert np.all(error <= out.bound["best"] + tol.MECHANISM_NEWTON * np.abs(out.value).max())
            worst[n] = max(worst[n], error.max() / (share * np.abs(out.value).max()))
    assert worst[choice.n] <= 1 < worst[choice.n - 1]


def test_estimate_may_decide_and_met_stays_with_the_bound(monkeypatch):
    """Bounds a hundred times as large, as where vectors leave much: the estimate decides, and the words say so."""
    solve = Trial.solve

    def with_loose_bounds(trial):
        reports = solve(trial)
        for out in (out for report in reports for out in report.outputs.values()):
            out.bound = {e: 100 * bound for e, bound in out.bound.items()}
        return reports

    with monkeypatch.context() as patch:
        patch.setattr(Trial, "solve", with_loose_bounds)
        choice = romerr.choose_modes(crank, 0.03, relative=True, by="estimate")
    assert (choice.chosen.is_enough, choice.met, choice.limit) == (True, False, None)
    assert str(choice).startswith(
        "n = 5: error within the tolerance: enough; its bounds are not within the tolerance; "
    )
    assert f"\n  {choice.reports[0].assess('tip', choice.chosen.tolerance['tip'])}\n" in str(choice)
    for name, out in choice.reports[0].outputs.items():
        most = np.max(np.abs(out.estimate) + out.uncertainty)
        assert most <= choice.chosen.tolerance[name]
        assert choice.chosen.decisive[name] == pytest.approx(most, rel=tol.SUMS)
        assert out.tolerance == choice.chosen.tolerance[name]  # its advice is about that
        out.bound = {e: bound / 100 for e, bound in out.bound.items()}
    assert choice.met
    assert str(choice).startswith("n = 5: error within the tolerance: enough; its bounds are within the tolerance; ")
    assert [choice.answer, *(run.assessment.answer for run in choice.tried)] == ["likely", "unlikely", "likely"]
    first, second = (line for line in str(choice).splitlines() if line.startswith("  run "))
    assert re.search(r"; error within the tolerance: too large, more modes$", first)
    assert second.endswith("; error within the tolerance: enough")
    assert "\n  n = 4: error within the tolerance: too large, was tried" in str(choice)
    choice = replace(choice, tried=choice.tried[1:])
    assert re.search(
        r"\n  n = 4: not tried; its estimates would be above it, by a forecast: tip <= [^ ]*, mid <= [^ ]*$",
        str(choice),
    )


def test_what_decides_has_two_names():
    with pytest.raises(romerr.InputError, match="by='proof' is unknown; allowed: 'bound', 'estimate'"):
        romerr.choose_modes(crank, 0.01, relative=True, by="proof")
    with pytest.raises(romerr.InputError, match="by=None is unknown"):
        romerr.two_level(crank, 0, 4, by=None)


def test_two_levels_say_what_the_error_is_about(crank_truth):
    """The finer run less the coarse one, plus its estimate, is the true error of the coarse one to 5 %.

    The truth has the steps of the runs: what the estimate has of steps is left out.
    """
    levels = romerr.two_level(crank, 0, 4, by="estimate")
    for name, out in levels.outputs.items():
        error = crank_truth[name] - out.value
        of_steps = levels.fine[0].output(name).estimate_parts["time step"]
        assert np.max(np.abs(error - (out.estimate - of_steps))) < 0.05 * np.max(np.abs(error))
        assert ", error about " in str(out)
        assert ", to first order, at most " in str(out)


def test_pendulum_needs_the_modes_that_the_truth_asks_for():
    tolerance = 4e-8
    choice = romerr.choose_modes(swing, tolerance, first=0, most=24)
    assert choice.met
    assert len(choice.tried) <= 4
    y = mechanism_truths.stored("kicked")["tip local"]
    out = choice.reports[0].output("tip")
    error = np.abs(y - out.value)
    assert np.all(error <= out.bound["best"])
    assert error.max() <= out.bound["best"].max() <= tolerance
    fewer = solved(swing(choice.n - 1)).output("tip")
    assert np.max(fewer.bound["best"]) > tolerance


@pytest.mark.parametrize("make", [romerr.modal_basis, romerr.krylov_basis])
def test_linkage_needs_the_modes_that_the_exact_solution_asks_for(make):
    """Scope complete: time steps are in the bound, and in the error."""
    tolerance = 2e-4
    choice = romerr.choose_modes(partial(stabiliser, steps=800, make=make), tolerance)
    assert choice.met
    report = choice.reports[0]
    body, B, tip = linkage.build()
    solution = exact.full_solution(body, B, linkage.AMPLITUDE, 2 * np.pi * linkage.FREQUENCY)
    out = report.compare("tip z", report.t, solution.motion(report.t)[0] @ tip.resolve(body)[0])
    assert np.all(np.abs(out.error) <= out.bound["best"])
    assert np.max(out.bound["best"]) <= tolerance
    if choice.n > 1:
        fewer = solved(stabiliser(choice.n - 1, steps=800, make=make)).output("tip z")
        assert np.max(fewer.bound["best"]) > tolerance


def test_free_interfaces_are_chosen_where_rigid_ones_stiffen():
    choice = romerr.choose_modes(
        crank, {"tip": 1e-2, "mid": 1e-2}, relative=True, kinds=("RBE2", "RBE3"), first=1, most=12
    )
    assert choice.met
    assert choice.kind == "RBE3"
    assert [run.kind for run in choice.tried[:2]] == ["RBE2", "RBE3"]
    assert len(choice.tried) <= 4
    rigid = choice.tried[0].forecast["tip"]
    assert rigid.bound(range(12)) > choice.tried[0].tolerance["tip"]  # no number of eigenmodes helps


def test_rigid_interfaces_are_kept_where_they_do():
    choice = romerr.choose_modes(crank, {"mid": 0.5}, relative=True, kinds=("RBE2", "RBE3"), first=1, most=12)
    assert (choice.met, choice.kind) == (True, "RBE2")


def test_steps_are_the_limit_of_a_bound_that_covers_them():
    choice = romerr.choose_modes(partial(stabiliser, steps=40), 1e-5, first=12)
    assert (choice.met, choice.limit, len(choice.tried)) == (False, STEP, 1)
    assert str(choice).count("halve") == 1


def test_steps_are_the_limit_beside_a_bound_that_does_not_cover_them(crank_truth):
    """A run with half the step tells the error of the step: against a run with a quarter of it, within a third."""
    choice = romerr.choose_modes(partial(crank, steps=60), {"mid": 1.5e-2}, relative=True, first=8, most=12)
    assert (choice.met, choice.limit) == (True, STEP)
    assert len(choice.tried) <= 3
    fine, coarse = solved(crank(choice.n, steps=240)).output("mid"), choice.reports[0].output("mid")
    error = np.max(np.abs(fine.value[::4] - coarse.value))
    assert choice.step_error["mid"] == pytest.approx(error, rel=1 / 3)
    assert "too long" in str(choice)


def test_step_is_not_the_limit_where_it_is_short():
    choice = romerr.choose_modes(partial(crank, steps=480), {"mid": 0.1}, relative=True, first=4, most=8)
    assert (choice.met, choice.limit) == (True, None)
    assert choice.step_error["mid"] < choice.chosen.tolerance["mid"]


def test_too_few_modes_are_said_so():
    choice = romerr.choose_modes(partial(crank, steps=360), {"mid": 1e-3}, relative=True, first=2, most=6)
    assert (choice.met, choice.limit, choice.n) == (False, BASIS, 6)
    assert "most=" in str(choice)
    assert "add modes" not in str(choice)  # a second cure, of the run alone


def test_steps_that_alone_are_too_long_are_said_beside_too_few_modes():
    """By their part of the estimate, as no run with half of them was made; the bound does not cover them."""
    choice = romerr.choose_modes(crank, {"mid": 1e-3}, relative=True, first=2, most=6)
    assert (choice.met, choice.limit, choice.step_error) == (False, STEP, None)
    assert "halve the step; too few modes" in str(choice)


def test_rigid_interfaces_that_alone_are_too_stiff_are_said_so():
    choice = romerr.choose_modes(partial(crank, kind="RBE2", steps=480), {"tip": 1e-2}, relative=True, most=6)
    assert (choice.met, choice.limit) == (False, INTERFACES)
    assert "take RBE3 modes" in str(choice)
    assert "most=" not in str(choice)


def released(n):
    """A bar on springs in static equilibrium under a load, which then grows."""
    solving = ["static"]

    def force(t):  # static solvers call it with load factors
        return 0.0, 0.0, 1e3 * (1.0 if solving[0] == "static" else 1.0 + 6 * np.sin(80.0 * t) ** 4)

    scene = mechanisms.sprung_body(n, h=5e-4, t_end=0.04, force=force)
    for i in range(scene.mbs.systemData.NumberOfLoads()):
        if scene.mbs.GetLoad(i)["loadType"] == "MassProportional":
            scene.mbs.SetLoadParameter(i, "loadVectorUserFunction", 0)
    scene.mbs.SetSensorParameter(scene.sensors["middle 1 local"], "name", "middle 1")
    monitor = attached(scene, outputs=[scene.sensors["middle 1 local"]])
    scene.mbs.Assemble()
    scene.settings.staticSolver.verboseMode = 0
    scene.mbs.SolveStatic(scene.settings, updateInitialValues=True)
    solving[0] = "dynamic"
    return scene.mbs, monitor, scene.settings


def two_bars(n):
    """A double pendulum, n modes a bar."""
    scene = mechanisms.double_pendulum(n, h=2e-3, t_end=0.1)
    monitors = []
    for bar, items in enumerate(scene.bodies, start=1):
        flex = romerr.floating_body(scene.fem, items)
        out = romerr.node_displacement(f"middle {bar}", node=mechanisms.MIDDLE)
        monitors.append(romerr.attach(scene.mbs, flex, outputs=[out]))
    return scene.mbs, monitors, scene.settings


@pytest.mark.parametrize(
    ("build", "share", "names"), [(two_bars, 3e-5, ("middle 1", "middle 2")), (released, 1e-2, ("middle 1",))]
)
def test_two_bodies_and_a_static_solve_before(build, share, names):
    choice = romerr.choose_modes(build, dict.fromkeys(names, share), relative=True, first=0, most=12)
    assert choice.met
    assert choice.n > 0
    assert len(choice.tried) <= 4
    fewer = build_trial(build, choice.n - 1).solve()
    limits = choice.chosen.tolerance
    assert any(np.max(r.output(k).bound["best"]) > limits[k] for r in fewer for k in r.outputs)


def test_picked_modes_are_fewer_than_the_first_ones(crank_truth):
    """Modes that bend the rod out of its plane are left out, and none of those that are kept is needless."""
    tolerance = {"tip": 1e-3, "mid": 1e-3}
    choice = romerr.choose_modes(crank, tolerance, relative=True, pick=True, most=16)
    assert choice.met
    assert len(choice.tried) <= 4
    assert choice.n < romerr.choose_modes(crank, tolerance, relative=True, most=16).n
    report = choice.reports[0]
    for name, y in crank_truth.items():
        out = report.output(name)
        error = np.abs(y - out.value)
        assert np.all(error <= out.bound["best"] + tol.MECHANISM_NEWTON * np.abs(out.value).max())
        assert error.max() <= 1e-3 * np.abs(out.value).max()
    for j in choice.modes:
        fewer = solved(crank([k for k in choice.modes if k != j]))
        assert any(np.max(fewer.output(k).bound["best"]) > x for k, x in choice.chosen.tolerance.items())
    assert f"modes {', '.join(map(str, choice.modes))}" in str(choice)


def test_fewest_modes_may_be_none():
    choice = romerr.choose_modes(crank, {"tip": 1.0}, first=2, most=4)
    assert (choice.n, choice.met) == (0, True)
    assert "no smaller basis" in str(choice)


def test_bad_input_names_the_argument():
    cases = (
        ({"tolerance": {"nothing": 1.0}}, "'nothing'"),
        ({"tolerance": None}, "tolerance=None"),
        ({"tolerance": {}}, "tolerance="),
        ({"tolerance": 1.0}, "2 outputs"),
        ({"tolerance": {"tip": -1.0}}, "positive"),
        ({"most": 0}, "most=0"),
        ({"first": 5, "most": 4}, "first=5"),
        ({"kinds": "RBE2"}, "kinds='RBE2'"),
        ({"kinds": ("a", "a")}, "kinds="),
        ({"build": lambda n: None}, "build"),
        ({"build": lambda n: crank(0), "most": 8}, "build"),
        ({"build": partial(crank, estimators=("energy",), scope="inputs frozen")}, "auxiliary"),
    )
    for changed, words in cases:
        wanted = {"build": crank, "tolerance": {"tip": 1.0}, "most": 6, "first": 1} | changed
        with pytest.raises(romerr.InputError, match=words):
            romerr.choose_modes(wanted.pop("build"), wanted.pop("tolerance"), **wanted)


def test_a_solve_that_fails_says_which():
    def build(n):
        mbs, monitor, settings = crank(n)
        mbs.SetPreStepUserFunction(lambda mbs, t: t < 0.01)
        return mbs, monitor, settings

    with pytest.raises(romerr.RunError, match=r"build\(4\)"):
        romerr.choose_modes(build, {"tip": 1.0})


def test_linear_body_keeps_one_mode():
    """There is none without; the search goes no further down, and a run that fails costs no result."""
    choice = romerr.choose_modes(stabiliser, 1.0, most=8)
    assert (choice.n, choice.met, choice.failed) == (1, True, None)

    def build(n):
        if n < 3:
            raise ValueError("mine")
        return stabiliser(n)

    choice = romerr.choose_modes(build, 1.0, most=8)
    assert (choice.n, choice.met) == (4, True)
    assert "ValueError: mine" in choice.failed
    assert choice.failed in str(choice)


def test_dynamic_solve_inside_build_is_refused():
    """Its error would be taken for zero at the start of the next one: bounds would be too low."""

    def build(n):
        mbs, monitor, settings = crank(n)
        mbs.Assemble()
        mbs.SolveDynamic(settings, updateInitialValues=True)
        return mbs, monitor, settings

    with pytest.raises(romerr.InputError, match="dynamic solve after attach"):
        romerr.choose_modes(build, {"tip": 1.0}, most=6)


def test_onlookers_are_in_no_report_and_settings_are_as_they_were():
    scenes = []
    choice = romerr.choose_modes(noting(crank, scenes), {"mid": 0.5}, relative=True, first=1, most=4)
    report = choice.reports[0]
    assert list(report.outputs) == ["tip", "mid"]
    assert "content" not in str(report) + str(report.plan)
    assert choice.step_error is not None
    assert {settings.timeIntegration.numberOfSteps for *_, settings in scenes} == {120}


def test_outputs_that_stay_zero_have_no_relative_tolerance():
    def build(n):
        mbs, monitor, settings = stabiliser(n)
        monitor.subject.add([romerr.node_displacement("clamp", node=0, component="z")])
        return mbs, monitor, settings

    with pytest.raises(romerr.InputError, match="'clamp' stays zero"):
        romerr.choose_modes(build, {"tip z": 0.1, "clamp": 0.1}, relative=True, most=8)
    assert romerr.choose_modes(build, {"tip z": 0.1}, relative=True, most=8).met


def test_output_without_a_bound_cannot_be_decided_by_its_bound():
    def build(n):
        scene = mechanisms.slider_crank(n, h=0.06 / 30, t_end=0.06)
        flex = romerr.floating_body(scene.fem, scene.bodies[0])
        probe = romerr.node_velocity("probe", node=mechanisms.MIDDLE, frame="global")
        return scene.mbs, romerr.attach(scene.mbs, flex, outputs=[probe]), scene.settings

    with pytest.raises(romerr.InputError, match=r"'probe' has an estimate of its error and no bound.*by='estimate'"):
        romerr.choose_modes(build, 0.01, relative=True)
