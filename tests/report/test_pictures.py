"""Pictures: what they show of made-up reports, that nothing is dropped without a word, and the files they make."""

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.colors import to_hex, to_rgba
from matplotlib.figure import Figure

import exudyn_romerr as romerr
from examples import pictures as example
from exudyn_romerr.report.answers import Tolerances
from exudyn_romerr.report.plots.body_surface import draw_body, plot_body, surface_triangles
from exudyn_romerr.report.plots.comparisons import draw_convergence
from exudyn_romerr.report.plots.over_time import (
    BAR,
    RASTER_FROM,
    draw_bounds,
    draw_causes,
    draw_signal,
)
from exudyn_romerr.report.plots.panels import PANELS, SCREEN, plot_causes, plot_report
from exudyn_romerr.report.plots.style import (
    CAUSE_STYLES,
    COLOURS,
    KINDS,
    LETTERS,
    LINES,
    LOOKS,
    WIDE,
    ends,
    isolated,
    log_line,
    spread,
)
from exudyn_romerr.report.report import BoundReport
from exudyn_romerr.report.scope import COUPLED, FROZEN, Doubt
from exudyn_romerr.report.wording import NOT_THE_MECHANISM
from tests.report.made_up import (
    ZERO,
    area,
    axes_of,
    drawn,
    edge,
    legend,
    line,
    made_up,
    notes,
    several,
    with_estimate,
)

ROOT = Path(__file__).resolve().parents[2]
OVER_TIME = (draw_signal, draw_bounds, draw_causes)
FORMATS = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}
POSITIONS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
TETS = np.array([[0, 1, 2, 3], [1, 2, 3, 4]])  # they share one face


# --- over time --------------------------------------------------------------


def test_signal_has_bands_of_both_outputs_and_the_truth():
    report = made_up()
    ax = axes_of(draw_signal, report, "tip")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("t / s", "tip / mm")
    assert legend(ax) == ["reduced model", "± bound, at most 2", "corrected ± 0.1", "truth"]
    assert area(ax, "± bound") == (9, 13)
    np.testing.assert_allclose(area(ax, "corrected"), (10.4, 11.6))
    np.testing.assert_array_equal(line(ax, "truth")[1], 9.5 + report.t)
    ax = axes_of(draw_signal, made_up(truth=False, corrected=False), "tip")  # which promises neither
    assert legend(ax) == ["reduced model", "± bound, at most 2"]


def test_signal_has_the_best_guess_where_it_is_not_the_corrected_output():
    report = with_estimate(made_up(), 0.05, ("steps", "vectors"))
    ax = axes_of(draw_signal, report, "tip")
    guess = "+ estimate ± 0.05"  # line and band are one entry
    assert legend(ax) == ["reduced model", "± bound, at most 2", guess, "truth"]
    np.testing.assert_allclose(line(ax, guess)[1], 9.9 + 1.25 * report.t)
    np.testing.assert_allclose(area(ax, guess), (9.85, 11.2))
    proved = axes_of(draw_signal, with_estimate(made_up(), 0.05, ("proved",)), "tip")
    assert "corrected ± 0.1" in legend(proved)
    assert proved.get_title() == "tip: reduced model, bound and corrected output"


def test_a_half_width_that_tells_nothing_hides_nothing():
    """It lies below the band of the bound, and the axes are those of value, bound, estimate and truth."""
    ax = axes_of(draw_signal, with_estimate(made_up(), 100.0), "tip")
    guess, bound = "+ estimate (not resolved) ± 100, cut off", "± bound, at most 2"
    assert legend(ax)[1:3] == [bound, guess]
    areas = {found.get_label(): found.get_zorder() for found in ax.collections}
    assert areas[guess] < areas[bound]
    np.testing.assert_allclose(ax.get_ylim(), (8.6, 13.4))  # 9 to 13 and a tenth on each side
    ax = axes_of(draw_signal, with_estimate(made_up(), 3.0), "tip")  # 6.9 to 14.15
    assert "+ estimate ± 3" in legend(ax)
    low, high = ax.get_ylim()
    assert low < 6.9
    assert high > 14.1


def test_estimate_is_told_from_bounds_and_true_error():
    """By its dashes and the band, also in grey; the legend says each."""
    report = with_estimate(made_up(), 0.05)
    ax, label = axes_of(draw_bounds, report, "tip"), "|estimate| ± 0.05"
    assert legend(ax) == ["bound 'energy'", "bound 'auxiliary'", label, "|true error|"]
    np.testing.assert_array_equal(line(ax, label)[1], np.abs(report.output("tip").estimate[:, 0]))
    low, high = area(ax, label)
    assert low < ax.get_ylim()[0]  # a logarithm has no zero
    np.testing.assert_allclose(high, 0.2)
    (dashed,) = [found for found in ax.lines if found.get_label() == label]
    assert dashed.get_linestyle() == "--"  # the true error is solid, bounds are wide
    assert dashed.get_linewidth() < WIDE
    assert dashed.get_zorder() > max(found.get_zorder() for found in ax.lines if found is not dashed)


def of_modes_and_steps(scope=COUPLED, truth=False):
    """A report of a mechanism: bounds of the modes, an estimate with time steps, which are 1 mm."""
    report = with_estimate(made_up(time="sampled", truth=truth), 0.05, ("vectors", "steps"))
    out, report.scope = report.output("tip"), dict.fromkeys(report.scope, scope)
    out.estimate_parts["time step"] = np.ones_like(out.value)
    out.estimate, out.estimate_scope = out.estimate + 1.0, COUPLED
    return report


def test_bounds_of_the_modes_are_drawn_with_the_estimate_of_the_modes():
    """Not with that of time steps, too, below which they may lie: as if a proof had failed."""
    report = of_modes_and_steps()
    ax = axes_of(draw_signal, report, "tip")
    assert legend(ax) == ["reduced model", "+ estimate ± 0.05"]
    np.testing.assert_allclose(line(ax, "+ estimate ± 0.05")[1], 10.9 + 1.25 * report.t)
    ax = axes_of(draw_bounds, report, "tip")
    assert ax.get_ylabel() == "error of the modes of\ntip / mm"
    assert ax.get_title() == "tip: error of the modes (bound to first order)"
    assert legend(ax)[2] == "|estimate| ± 0.025"  # the check of steps is none of theirs
    np.testing.assert_allclose(line(ax, "|estimate| ± 0.025")[1], np.abs(0.25 * report.t - 0.1), atol=1e-12)


@pytest.mark.parametrize(("error", "kind"), [(0.1, "error of the modes"), (1.0, "error")])
def test_a_truth_is_drawn_with_what_is_of_the_same_error(error, kind):
    """One with the same steps has nothing of their error."""
    report = of_modes_and_steps(truth=True)
    report.output("tip").error[:] = error
    ax = axes_of(draw_bounds, report, "tip")
    assert ax.get_title().startswith(f"tip: {kind}")
    assert ("bound 'energy'" in legend(ax)) == (error == 0.1)
    assert ("bound of the modes alone: not drawn" in ax.get_title()) == (error == 1.0)


def test_a_bound_under_frozen_inputs_is_not_drawn_beside_the_mechanism_s_error():
    for time in ("sampled", "reconstructed"):
        report = of_modes_and_steps(FROZEN)
        report.time = time
        ax = axes_of(draw_bounds, report, "tip")
        assert legend(ax) == ["|estimate| ± 0.05"]
        assert ax.get_title() == "tip: error\nbound inputs frozen: not drawn"
        assert legend(axes_of(draw_signal, report, "tip")) == ["reduced model", "+ estimate ± 0.05"]


def test_the_whole_error_is_drawn_where_there_is_no_bound_of_the_modes():
    report = of_modes_and_steps()
    for bound in report.output("tip").bound.values():
        bound[:] = np.inf
    ax = axes_of(draw_bounds, report, "tip")
    assert legend(ax) == ["|estimate| ± 0.05"]
    assert ax.get_title() == "tip: error\nno finite bound"


def test_an_estimate_under_frozen_inputs_is_not_drawn_beside_a_bound_of_more():
    report = of_modes_and_steps()
    report.output("tip").estimate_scope = FROZEN
    assert legend(axes_of(draw_bounds, report, "tip")) == ["bound 'energy'", "bound 'auxiliary'"]
    assert not any("estimate" in text for text in legend(axes_of(draw_signal, report, "tip")))


def test_a_tolerance_is_drawn_where_there_is_one():
    report = made_up()
    assert "tolerance" not in legend(axes_of(draw_bounds, report, "tip"))
    report.output("tip").tolerance = 0.03
    for asked, expected in ((None, 0.03), (1e4, 1e4)):
        ax = axes_of(draw_bounds, report, "tip", tolerance=asked)
        assert "tolerance" in legend(ax)
        assert set(line(ax, "tolerance")[1]) == {expected}
        assert ax.get_ylim()[0] < expected < ax.get_ylim()[1]


def test_pictures_have_the_tolerance_that_was_asked_for():
    """A share is one of what the output shows, 11 mm."""
    _, ax = plot_report(made_up(), tolerances=Tolerances(["10%"])).axes
    np.testing.assert_allclose(line(ax, "tolerance")[1], 1.1)
    _, ax = plot_report(made_up(), tolerances=Tolerances([])).axes
    assert "tolerance" not in legend(ax)


def test_axes_have_no_unit_that_is_not_known():
    report = made_up()
    report.output("tip").unit = ""
    assert axes_of(draw_signal, report, "tip").get_ylabel() == "tip"
    assert axes_of(draw_bounds, report, "tip").get_ylabel() == "error of tip"
    assert legend(axes_of(draw_causes, report, "tip"))[-1] == "worst, t = 1 s: 2"
    assert axes_of(draw_convergence, [(2, 1.0)], "tip", "").get_ylabel() == "largest error of tip"


def test_green_is_a_bound_and_nothing_else():
    """Of the best bound the band, too; no cause, no kind of basis."""
    green = COLOURS["auxiliary"]
    assert not [look for look in (*CAUSE_STYLES.values(), *KINDS) if green in look]
    assert [name for name, colour in COLOURS.items() if colour == green] == ["auxiliary", "static"]
    for corrected in (True, False):
        report = with_estimate(made_up(), 0.05) if corrected else made_up(corrected=False)
        ax = axes_of(draw_signal, report, "tip")
        looks = {found.get_label(): to_hex(found.get_facecolor()[0]).upper() for found in ax.collections}
        assert [label for label, look in looks.items() if look == green] == ["± bound, at most 2"]


def test_a_band_narrower_than_the_line_in_it_is_seen():
    report = made_up(np.full(5, 1e-9), truth=False, corrected=False)
    ax = axes_of(draw_signal, report, "tip")
    assert ax.collections[0].get_linewidth()[0] > ax.lines[0].get_linewidth()


@pytest.mark.parametrize(("estimate", "half"), [(0.0, 0.0), (0.0, 0.1), (0.2, np.inf), (0.2, 0.0)])
@pytest.mark.parametrize("draw", OVER_TIME)
def test_estimates_of_any_size_are_drawn(draw, estimate, half):
    """Zero, and half widths that are not known: marks and no band, never a warning."""
    report = with_estimate(made_up(truth=False), half)
    report.output("tip").estimate[:] = estimate
    ax = axes_of(draw, report, "tip")
    if draw is draw_bounds:
        assert any(text.startswith("|estimate|") for text in legend(ax)) == (estimate > 0 or half == 0.1)
        assert bool(ax.collections) == (np.isfinite(half) and estimate + half > 0)
        assert (ZERO in legend(ax)) == (estimate == 0)


@pytest.mark.parametrize("draw", OVER_TIME)
@pytest.mark.parametrize(
    ("best", "said"),
    [
        ([1, 2, np.inf, np.inf, 1], "infinite at t = 0.5 to 0.75 s"),
        ([1, 2, np.inf, 1, np.inf], "infinite at t = 0.5 to 1 s, not throughout"),
        ([np.inf, 1, 1, 1, 1], "infinite at t = 0 s"),
        (np.full(5, np.inf), "no finite bound"),
        (np.ones(5), ""),
    ],
)
def test_an_infinite_bound_is_a_note(draw, best, said):
    ax = axes_of(draw, made_up(best, truth=False, corrected=False), "tip")
    _, _, note = " ".join(ax.get_title().split("\n")).partition("tip: ")
    assert said in note
    assert ("infinite" in note or "no finite" in note) == bool(said)
    drawn = np.concatenate([np.append(found.get_ydata(), np.nan) for found in ax.lines])
    assert not np.isinf(drawn).any()
    if draw is draw_bounds and not np.isfinite(best).any():
        assert "no finite bound by 'energy'" in note
        assert ax.get_legend() is None


def test_infinite_band_is_not_drawn():
    ax = axes_of(draw_signal, made_up([1, 2, np.inf, np.inf, 1]), "tip")
    assert legend(ax)[1] == "± bound, at most 2 where finite"
    assert area(ax, "± bound") == (8.25, 12.25)  # the third and fourth instant have no band


def test_bounds_are_told_from_the_true_error():
    report = made_up()
    ax = axes_of(draw_bounds, report, "tip")
    assert (ax.get_yscale(), ax.get_ylabel()) == ("log", "error of tip / mm")
    assert legend(ax) == ["bound 'energy'", "bound 'auxiliary'", "|true error|"]
    np.testing.assert_array_equal(line(ax, "|true error|")[1], 0.5)
    np.testing.assert_array_equal(line(ax, "bound 'energy'")[1], 3 * report.output("tip").bound["best"][:, 0])


def test_bounds_of_estimators_that_only_earlier_versions_had_are_drawn():
    """Reports read from their files have such."""
    report = made_up()
    report.scope["of 0.2"] = "complete"
    report.output("tip").bound["of 0.2"] = 0.5 * report.output("tip").bound["best"]
    bound = line(axes_of(draw_bounds, report, "tip"), "bound 'of 0.2'")[1]
    np.testing.assert_array_equal(bound, np.linspace(0.5, 1, 5))
    assert legend(axes_of(draw_signal, report, "tip"))[1] == "± bound, at most 2"


def test_what_rounding_alone_makes_of_a_true_error_does_not_set_the_axis():
    report = made_up()
    report.outputs["tip"].error[0] = 1e-25  # of 10 mm
    ax = axes_of(draw_bounds, report, "tip")
    np.testing.assert_array_equal(np.isnan(line(ax, "|true error|")[1]), [True, False, False, False, False])
    assert ax.get_ylim()[0] > 0.1
    assert ZERO not in legend(ax)


def test_zeros_are_at_the_edge_and_in_the_legend():
    """They have no place on a logarithmic axis; infinite bounds have gaps."""
    ax = axes_of(draw_bounds, made_up([0, 1, np.inf, 2, 0]), "tip")
    assert [x.tolist() for x in edge(ax, ZERO)] == [[0, 4], [0, 4]]  # of both estimators
    assert ZERO in legend(ax)
    drawn = line(ax, "bound 'auxiliary'")[1]
    np.testing.assert_array_equal(np.isnan(drawn), [True, False, True, False, True])
    ax = axes_of(draw_bounds, made_up(), "tip")
    assert (ZERO in legend(ax), edge(ax, ZERO)) == (False, [])


def test_signal_without_a_bound_has_its_estimate_alone():
    report = made_up(np.full(4, np.inf), truth=False, corrected=False)
    out = report.output("tip")
    out.estimate = out.uncertainty = np.full_like(out.value, 0.1)
    out.uncertainty_parts = {"steps": out.uncertainty}
    ax = axes_of(draw_signal, report, "tip")
    assert ax.get_title() == "tip: reduced model, bound and estimate\nno finite bound"
    assert legend(ax) == ["reduced model", "+ estimate ± 0.1"]


@pytest.mark.parametrize("draw", OVER_TIME)
def test_reports_of_zeros_are_drawn(draw):
    ax = axes_of(draw, made_up(np.zeros(4), truth=False), "tip")
    assert [text for text in legend(ax) if text == ZERO] == [ZERO] * (draw is not draw_signal)


def test_round_off_is_drawn_where_it_hides_the_bound():
    report = made_up()
    words = "rounding: nothing below is known"
    assert words not in legend(axes_of(draw_bounds, report, "tip"))
    report.output("tip").round_off = np.full((5, 1), 7.0)
    assert words in legend(axes_of(draw_bounds, report, "tip"))


def test_shares_of_the_causes_add_up():
    ax = axes_of(draw_causes, made_up(), "tip")
    assert ax.get_ylabel() == "share of the bound / %"
    assert legend(ax) == ["basis, 25 %", "time step, 75 %", "worst, t = 1 s: 2 mm"]  # no others: zero
    assert (area(ax, "basis"), area(ax, "time step")) == ((0, 25), (25, 100))
    report = made_up()  # small shares are not zero
    out = report.output("tip")
    out.causes["basis"], out.causes["time step"] = (x * out.bound["best"] for x in (0.001, 0.999))
    assert legend(axes_of(draw_causes, report, "tip"))[:2] == ["basis, < 1 %", "time step, > 99 %"]


def test_where_there_are_no_shares_none_are_drawn():
    """Of a bound that is zero or infinite."""
    ax = axes_of(draw_causes, made_up([0, 1, 1, np.inf, 1]), "tip")
    assert [x.tolist() for x in edge(ax, ZERO)] == [[0]]
    assert legend(ax)[0] == "basis"  # the worst instant has no shares
    basis, bar = ax.collections[:2]
    assert {tuple(sorted(set(path.vertices[:, 0]))) for path in basis.get_paths()} == {(0.25, 0.5), (1.0,)}
    assert bar.get_linewidth() == [BAR]  # an area that is one instant wide cannot be seen
    assert bar.get_paths()[0].vertices.tolist() == [[1.0, 0.0], [1.0, 25.0]]


@pytest.mark.parametrize("draw", OVER_TIME)
def test_single_instant_can_be_seen(draw):
    """A line or an area of one point is invisible: markers and bars."""
    ax = axes_of(draw, made_up([2.0], t=[1.0], time="static"), "tip")
    assert ax.get_xlabel() == "load factor"
    if draw is not draw_causes:
        assert all(drawn.get_marker() not in (None, "None", "") for drawn in ax.lines)
    if draw is not draw_bounds:
        bars = [x.get_paths()[0].vertices[:, 1].tolist() for x in ax.collections if x.get_linewidth() == [BAR]]
        assert ([8.0 + 1, 13.0] if draw is draw_signal else [25, 100]) in bars


@pytest.mark.parametrize("draw", OVER_TIME)
def test_rows_of_vectors_are_drawn_one_by_one(draw):
    """By label, or by number."""
    report = made_up(rows=3)
    assert axes_of(draw, report, "tip", 1).get_title().startswith(f"{report.output('tip').row_names[1]}: ")
    labelled = made_up(rows=3, labels=("x", "y", "z"))
    assert "tip z" in axes_of(draw, labelled, "tip", 2).get_title()
    with pytest.raises(romerr.InputError, match=r"row of output 'tip'=3; allowed: a whole number 0\.\.2"):
        axes_of(draw, report, "tip", 3)
    with pytest.raises(romerr.InputError, match="allowed: 'tip'"):
        axes_of(draw, report, "top")


@pytest.mark.parametrize(("plot", "panels"), [(plot_report, 6), (plot_causes, 3)])
def test_figures_of_a_report_have_all_its_rows(plot, panels, tmp_path):
    figure = plot(made_up(rows=3, labels=("x", "y", "z")), tmp_path / "run.svg", outputs="tip")
    assert len(figure.axes) == panels
    assert (tmp_path / "run.svg").read_bytes().startswith(FORMATS[".svg"])
    with pytest.raises(romerr.InputError, match="no outputs to plot"):
        plot(BoundReport(**{**vars(made_up()), "outputs": {}}))


@pytest.mark.parametrize(
    ("count", "rows", "shown", "left_out"),
    [
        (1, 1, ["out 0"], ""),
        (2, 1, ["out 0", "out 1"], ""),
        (1, 3, ["out 0 x", "out 0 y", "out 0 z"], ""),
        (2, 3, ["out 0 z", "out 1 z"], "out 0 x, out 0 y, out 1 x, out 1 y; outputs= chooses"),
        (6, 1, ["out 2", "out 3", "out 4", "out 5"], "out 0, out 1; outputs= chooses"),
        (9, 3, ["out 5 z", "out 6 z", "out 7 z", "out 8 z"], "out 2 x, out 2 y and 15 more; outputs= chooses"),
    ],
)
@pytest.mark.parametrize("plot", [plot_report, plot_causes])
def test_pictures_fit_one_screen_an_output_a_panel(plot, count, rows, shown, left_out):
    """Those with the largest bounds, in their order, and a line of what is left out; no place is empty."""
    figure = plot(several(count, rows))
    assert drawn(figure) == shown
    assert len(figure.axes) == len(shown) * (2 if plot is plot_report and len(shown) <= 3 else 1)
    grid = figure.axes[0].get_gridspec()
    assert len(figure.axes) == grid.nrows * grid.ncols
    said = notes(figure)
    assert bool(said) == bool(left_out)
    assert said.endswith(left_out)
    assert np.all(figure.get_size_inches() <= SCREEN)
    assert SCREEN <= (10, 8)  # inches: what fits a screen


def test_outputs_at_round_off_are_left_out_first():
    """Nothing is to be seen in them."""
    report = several(PANELS + 1, 1)
    last = report.output(f"out {PANELS}")
    last.round_off = last.bound["best"]
    assert drawn(plot_report(report)) == [f"out {number}" for number in range(PANELS)]


def test_outputs_that_nobody_asked_for_are_left_out_first():
    """What the body's frame sees stands beside an output in global axes: its bound is a larger share of less."""
    report = several(PANELS + 1, 1)
    report.outputs = {
        name if i else "out 4 in the frame": out for i, (name, out) in enumerate(report.outputs.items())
    }
    report.output("out 4 in the frame").name = "out 4 in the frame"
    report.output("out 4 in the frame").bound["best"] *= 1e3
    assert drawn(plot_report(report)) == [f"out {number}" for number in range(1, PANELS + 1)]
    del report.outputs["out 4"]  # nothing of this name is asked for: then this one was
    assert drawn(plot_report(report))[0] == "out 4 in the frame"


def test_pictures_say_that_the_mechanisms_answer_is_not_covered():
    report = made_up()
    assert "not covered" not in notes(plot_report(report))
    report.scope = dict.fromkeys(report.scope, FROZEN)
    for plot in (plot_report, plot_causes):
        assert NOT_THE_MECHANISM in notes(plot(report))


def test_outputs_without_a_bound_are_drawn_by_their_estimate():
    """An infinite bound is not the largest error; there are no causes of it."""
    report = several(PANELS + 1, 2)
    first, last = report.output("out 0"), report.output(f"out {PANELS}")
    for out, size in ((first, 1e-3), (last, 1e3)):
        out.bound = {e: np.full_like(x, np.inf) for e, x in out.bound.items()}
        out.estimate = size * np.ones_like(out.value) * [2.0, 1.0]
        out.uncertainty = np.zeros_like(out.value)
        out.uncertainty_parts = {"steps": out.uncertainty}
    assert drawn(plot_report(report)) == [*(f"out {number} y" for number in range(1, PANELS)), f"out {PANELS} x"]
    assert drawn(plot_causes(report)) == [f"out {number} y" for number in range(1, PANELS)]
    assert drawn(plot_causes(report, outputs=["out 0"])) == ["out 0 x", "out 0 y"]


@pytest.mark.parametrize(("half", "is_said"), [(9.0, False), (12.0, True)])  # of an output of 10 to 11 mm
def test_legends_say_that_an_estimate_is_not_resolved(half, is_said):
    report = several(1, 1)
    (out,) = report.outputs.values()
    out.estimate, out.uncertainty = np.ones_like(out.value), np.full_like(out.value, half)
    out.estimate_parts, out.uncertainty_parts = {"basis": out.estimate}, {"steps": out.uncertainty}
    labels = [label for ax in plot_report(report).axes for label in legend(ax)]
    assert (f"+ estimate (not resolved) ± {half:g}, cut off" in labels) == is_said
    assert (f"+ estimate ± {half:g}, cut off" in labels) != is_said


def test_titles_stay_in_their_panels():
    report = several(4, 1)
    for out in report.outputs.values():
        out.name += " velocity in the frame of the second bar"
    report.outputs = {out.name: out for out in report.outputs.values()}
    for plot in (plot_report, plot_causes):
        figure = plot(report)
        figure.draw_without_rendering()
        for ax in figure.axes:
            box, width = ax.title.get_window_extent(), figure.bbox.width / 2
            assert int(box.x0 // width) == int(box.x1 // width)
            assert box.x0 >= 0


@pytest.mark.parametrize("end", [1.0, 0.02, 0.06, 123.4])
def test_times_do_not_run_into_each_other(end):
    report = several(4, 1)
    report.t = end * report.t
    figure = plot_report(report)
    figure.draw_without_rendering()
    for ax in figure.axes:
        boxes = [label.get_window_extent() for label in ax.get_xticklabels()]
        assert len(boxes) > 2
        assert all(left.x1 < right.x0 for left, right in pairwise(boxes))


@pytest.mark.parametrize("scope", [FROZEN, COUPLED])
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_legends_stay_in_their_panels(count, scope):
    """In two lines, though bounds are not certified, and there is all that a panel may show."""
    report = several(count, 1)
    report.scope, report.time = dict.fromkeys(report.scope, scope), "sampled"
    for out in report.outputs.values():
        out.uncertified = (Doubt("of a cause", "do something"),)
        out.unit, out.tolerance = "microns", 1.0  # as long as units are
        out.estimate, out.uncertainty = 0.5 * out.bound["best"], 0.1 * out.bound["best"]
        out.estimate_parts, out.uncertainty_parts = {"time step": out.estimate}, {"steps": out.uncertainty}
    figure = plot_report(report)
    figure.draw_without_rendering()
    columns = 1 if count == 1 else 2
    for ax in figure.axes:
        box, width = ax.get_legend().get_window_extent(), figure.bbox.width / columns
        column = int((box.x0 + box.x1) / 2 // width)
        assert column * width <= box.x0
        assert box.x1 <= (column + 1) * width
        assert ax.bbox.width > 0.7 * width  # the layout gives it no room of the axes
        assert box.y0 >= 0
        assert len(legend(ax)) <= LINES * ax.get_legend()._ncols


def test_sampled_bounds_are_not_called_more_than_they_are():
    report = made_up(time="sampled")
    assert axes_of(draw_bounds, report, "tip").get_ylabel() == "error of the modes of\ntip / mm"
    out = report.output("tip")
    out.causes["basis"], out.causes["time step"] = out.bound["best"], 0 * out.bound["best"]
    ax = axes_of(draw_causes, report, "tip")
    assert "what the bound of the error of the modes comes from" in ax.get_title()
    assert legend(ax)[:2] == ["basis, 100 %", "time step: not covered"]


@pytest.mark.parametrize("draw", [draw_signal, draw_bounds])
def test_bounds_for_frozen_inputs_say_so(draw):
    """Such a bound says nothing about the error that a mechanism feeds back."""
    report = made_up()
    assert "inputs frozen" not in axes_of(draw, report, "tip").get_title()
    report.scope = dict.fromkeys(report.scope, FROZEN)
    assert "(bound inputs frozen)" in axes_of(draw, report, "tip").get_title()


def test_bounds_that_cover_less_than_others_are_not_drawn_beside_these():
    report = made_up()
    report.scope["auxiliary"] = FROZEN
    assert legend(axes_of(draw_signal, report, "tip"))[:2] == ["reduced model", "± bound, at most 2"]
    ax = axes_of(draw_bounds, report, "tip")
    assert legend(ax)[0] == "bound, at most 6"
    assert ax.get_title() == "tip: error\n'auxiliary', inputs frozen: not drawn"


def test_large_areas_are_pixels_in_vector_pictures():
    """As a polygon of all samples they have tens of MB."""
    for instants, expected in ((100, False), (RASTER_FROM + 1, True)):
        ax = axes_of(draw_causes, made_up(np.ones(instants)), "tip")
        assert {area.get_rasterized() for area in ax.collections} == {expected}


# --- the body ---------------------------------------------------------------


class Fem:
    """What the picture asks an Exudyn FEMinterface for."""

    def __init__(self, triangles):
        self.triangles = triangles

    def GetNodePositionsAsArray(self):
        return POSITIONS

    def GetSurfaceTriangles(self):
        return self.triangles


def body(mesh, bound=(0.0, 1, 2, 3, 4), **options):
    """Axes of a picture; "energy" has larger bounds."""
    bound = np.asarray(bound, dtype=float)
    report = made_up(energy=2 * bound + 1, auxiliary=bound)
    return axes_of(draw_body, report, mesh, projection="3d", **options)


def test_surface_of_tetrahedra_has_the_faces_that_one_alone_has():
    faces = {frozenset(face) for face in surface_triangles(TETS).tolist()}
    assert len(faces) == 6
    assert frozenset((1, 2, 3)) not in faces
    ten = np.hstack([TETS, np.full((2, 6), 99)])
    np.testing.assert_array_equal(surface_triangles(ten), surface_triangles(TETS))


@pytest.mark.parametrize(
    ("mesh", "expected"),
    [
        (Fem([[0, 1, 2], [0, 1, 3]]), [2, 3]),
        ((POSITIONS, [[0, 1, 2], [0, 1, 3]]), [2, 3]),
        ((POSITIONS, TETS[:1]), [2, 3, 3, 3]),
        ((POSITIONS, [[0, 1], [1, 4]]), [1, 4]),
        ((POSITIONS, None), [0, 1, 2, 3, 4]),
    ],
    ids=["fem", "triangles", "tetrahedra", "lines", "nodes"],
)
def test_parts_have_the_colour_of_their_worst_node(mesh, expected):
    ax = body(mesh, unit="mm")
    (parts,) = ax.collections
    assert sorted(parts.get_array().tolist()) == expected
    assert (parts.norm.vmin, parts.norm.vmax) == (0, max(expected))
    assert [ax.get_xlabel(), ax.get_ylabel(), ax.get_zlabel()] == ["x / mm", "y / mm", "z / mm"]
    assert ax.figure.axes[1].get_ylabel() == "bound of the error\nby 'auxiliary' / mm"
    unknown = body(mesh)
    assert [unknown.get_xlabel(), unknown.figure.axes[1].get_ylabel()] == ["x", "bound of the error\nby 'auxiliary'"]
    assert "node 4: at most 4 mm" in ax.get_title()
    assert "not deformed" in ax.get_title()


def test_deformation_is_that_of_the_worst_instant_and_its_scale_is_told():
    asked = []

    def displacement(i):
        asked.append(i)
        return 1e-3 * np.eye(5, 3)

    ax = body((POSITIONS, [[0, 1], [1, 4]]), displacement=displacement)
    assert asked == [4]  # the last instant has the largest bound
    assert "t = 1 s, displacements × 50" in ax.get_title()
    assert len(ax.collections) == 2  # and the undeformed lines


def test_infinite_bounds_have_a_colour_of_their_own():
    ax = body((POSITIONS, [[0, 1], [1, 4]]), bound=(0, 1, 2, 3, np.inf))
    ax.figure.draw_without_rendering()
    assert "infinite" in ax.get_title()
    assert to_rgba(COLOURS["error"]) in [tuple(c) for c in ax.collections[0].get_edgecolor()]


def test_bounds_that_are_all_zero_are_drawn_and_estimators_can_be_chosen():
    assert "at most 0 m" in body((POSITIONS, None), bound=np.zeros(5), unit="m").get_title()
    assert "'energy'" in body((POSITIONS, None), estimator="energy").figure.axes[1].get_ylabel()


def test_estimator_of_the_widest_scope_is_taken_and_others_are_named():
    report = made_up(time="sampled", energy=np.full(5, 2.0), auxiliary=np.ones(5))
    report.scope["auxiliary"] = FROZEN

    def label(**options):
        ax = axes_of(draw_body, report, (POSITIONS, None), projection="3d", **options)
        return ax.figure.axes[1].get_ylabel()

    assert label() == "bound of the reduction error\nby 'energy'"
    assert label(estimator="auxiliary") == "bound of the reduction error\nby 'auxiliary', inputs frozen"


@pytest.mark.parametrize(
    ("mesh", "options", "message"),
    [
        (Fem([]), {}, "fem has no surface; call fem.VolumeToSurfaceElements"),
        ((POSITIONS[:3], None), {}, r"positions of mesh has shape \(3, 3\); needed: \(5, 3\)"),
        ((POSITIONS, [[0, 1, 2, 3, 4]]), {}, "5 columns"),
        ((POSITIONS, [[0, 5]]), {}, "node 5; allowed"),
        ((POSITIONS, None), {"estimator": "fast"}, "estimator='fast' is unknown"),
        ((POSITIONS, None), {"displacement": lambda i: np.zeros((4, 3))}, "displacement has shape"),
    ],
)
def test_bodies_that_cannot_be_drawn_are_refused(mesh, options, message):
    with pytest.raises(romerr.InputError, match=message):
        body(mesh, **options)


def test_report_saved_without_bounds_at_nodes_says_so():
    with pytest.raises(romerr.InputError, match="ask for it before save"):
        plot_body(made_up(), (POSITIONS, None))


# --- style and files --------------------------------------------------------


def test_every_estimator_has_a_look_of_its_own_in_grey():
    names = set(COLOURS) - {"value", "error", "estimate", "tolerance"}
    assert names == set(LOOKS)
    looks = [LOOKS[e][1:] for e in names - {"static"}]  # which is never beside the others
    assert len(set(looks)) == len(looks)


def test_runs_of_samples():
    mask = np.array([True, False, True, True, True, False, True])
    assert (isolated(mask).tolist(), ends(mask).tolist()) == ([0, 6], [0, 2, 4, 6])


def test_single_samples_between_others_that_are_not_drawn_have_a_marker():
    """A line between two of them is no line."""
    y = np.ones(100)
    y[[50, 52]] = 0.0, np.inf
    ax = Figure().add_subplot()
    log_line(ax, np.arange(100.0), y, every=spread(100, 1), color="k", marker="o")
    assert ax.lines[0].get_markevery() == [*range(3, 50, 10), 51, *range(53, 100, 10)]
    assert (y[50], y[52]) == (0.0, np.inf)  # the data are left as they are


@pytest.mark.parametrize(
    ("kind", "ending"),
    [("report", ".png"), ("causes", ".svg"), ("body", ".pdf"), ("run_time", ".PDF"), ("convergence", ".svg")],
)
def test_pictures_are_saved_by_the_ending_of_their_name(tmp_path, ending, kind):
    path, report = tmp_path / f"picture{ending}", made_up([0, 1, np.inf, 2], auxiliary=np.ones(5))
    made = {
        "report": lambda: report.plot(path),
        "causes": lambda: report.plot_causes(path),
        "body": lambda: report.plot_body((POSITIONS, TETS), path),
        "run_time": lambda: romerr.plot_run_time([("a", 1, 1e-2, 1e-3, "4"), ("b", 2, 1e-3)], "tip", "mm", path),
        "convergence": lambda: romerr.plot_convergence([(2, 1.0)], "tip", "mm", path),
    }[kind]()
    assert isinstance(made, Figure)
    assert path.read_bytes().startswith(FORMATS[ending.lower()])


@pytest.mark.parametrize("name", ["picture", "picture.npz"])
def test_unknown_endings_are_refused(tmp_path, name):
    with pytest.raises(romerr.InputError, match=r"use \.png, \.svg or \.pdf"):
        made_up().plot(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


QUIET = """
import sys, json
import numpy as np
import exudyn_romerr as romerr
from exudyn_romerr.report.plots import comparisons as pictures, over_time as plot, style, body_surface as surface
before = "matplotlib" in sys.modules
romerr.plot_convergence([(2, 1.0)], "tip", "mm")
print(json.dumps([before, "matplotlib" in sys.modules, "matplotlib.pyplot" in sys.modules]))
"""


def test_matplotlib_comes_with_the_first_picture_and_pyplot_never():
    """Figures of the user, and how they are shown, are left alone."""
    run = subprocess.run([sys.executable, "-c", QUIET], cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(run.stdout) == [False, True, False]


def test_letters_are_ours_after_plots_that_set_others(tmp_path):
    """mbs.PlotSensor sets 16 points for the whole process; axes of three rows collapsed then, with a warning."""
    with rc_context({"font.size": 16}):
        figure = made_up(rows=3).plot(tmp_path / "run.png")
    ax = figure.axes[0]
    assert [ax.xaxis.label.get_size(), ax.get_yticklabels()[0].get_size()] == [LETTERS, LETTERS]


# --- the page and its pictures ----------------------------------------------


def test_example_writes_one_picture_of_each_kind(tmp_path):
    """With few and coarse runs; what they show is true: no error above its bound."""
    figures = example.main(tmp_path, ladder=((2, 4e-3), (4, 2e-3)), sizes=(1, 2))
    assert {path.name for path in tmp_path.iterdir()} == {f"picture_{name}.png" for name in figures}
    bound, error = (line(figures["modes"].axes[0], label)[1] for label in ("bound", "|true error|"))
    assert np.all(error < bound)
    bound, error = (line(figures["bounds"].axes[0], label)[1] for label in ("bound 'auxiliary'", "|true error|"))
    assert np.all((error <= bound)[1:])
