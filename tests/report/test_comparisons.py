"""Pictures of several runs: against run time and number of modes; what runs have measured, by cause."""

import numpy as np
import pytest
from matplotlib.markers import CARETUP, CARETUPBASE

import exudyn_romerr as romerr
from exudyn_romerr.report.answers import Answer, Limit
from exudyn_romerr.report.plots.comparisons import draw_convergence, draw_run_time, pareto_front, plot_verdicts
from exudyn_romerr.report.verdicts import Row, Verdict
from tests.report.made_up import ZERO, axes_of, edge, legend, line

RUNS = [("a", 1, 1e-2, 1e-3, "4"), ("a", 4, 1e-5, None), ("b", 2, 1e-3, 1e-4), ("b", 3, 1e-2, 5e-3)]


def test_runs_of_a_kind_are_one_curve_and_the_front_is_marked():
    ax = axes_of(draw_run_time, RUNS, "tip", "mm")
    assert (ax.get_xscale(), ax.get_yscale(), ax.get_xlabel()) == ("log", "log", "run time / s")
    assert ax.get_ylabel() == "largest error of tip / mm"
    assert legend(ax) == ["Pareto front of the bounds", "a", "b", "filled: bound", "hollow: true error"]
    assert [x.tolist() for x in line(ax, "Pareto front of the bounds")] == [[1, 2, 4], [1e-2, 1e-3, 1e-5]]
    assert [x.tolist() for x in line(ax, "a")] == [[1, 4], [1e-2, 1e-5]]
    hollow = [found.get_data() for found in ax.lines if found.get_linestyle() == ":" and len(found.get_xdata())]
    assert [x.tolist() for pair in hollow for x in pair] == [[1], [1e-3], [2, 3], [1e-4, 5e-3]]
    assert [text.get_text() for text in ax.texts] == ["4"]


def test_runs_without_a_finite_bound_are_a_note_and_those_without_error_have_no_mark():
    ax = axes_of(draw_run_time, [("a", 1, np.inf), ("a", 2, 0.0)], "tip", "mm")
    assert [x.tolist() for x in edge(ax, ZERO)] == [[1]]
    assert ax.get_title().endswith("1 of 2 bounds infinite")
    assert "hollow: true error" not in legend(ax)


def test_front_is_what_no_other_run_beats():
    rng = np.random.default_rng(3)
    seconds, bounds = rng.uniform(1, 2, (2, 200))
    beaten = (seconds[:, None] < seconds) & (bounds[:, None] < bounds)
    assert sorted(pareto_front(seconds, bounds)) == np.flatnonzero(~beaten.any(axis=0)).tolist()
    assert np.all(np.diff(seconds[pareto_front(seconds, bounds)]) > 0)


def test_runs_of_growing_size():
    ax = axes_of(draw_convergence, [(4, 1e-3, None), (2, 1e-1, 1e-2), (8, 0.0, 0.0)], "tip", "mm")
    assert (ax.get_xlabel(), ax.get_yscale(), ax.get_ylabel()) == (
        "number of modes",
        "log",
        "largest error of tip / mm",
    )
    assert legend(ax) == ["bound", "|true error|", ZERO]
    assert line(ax, "bound")[0].tolist() == [2, 4, 8]
    assert line(ax, "|true error|")[0].tolist() == [2, 8]


@pytest.mark.parametrize(
    ("draw", "rows", "message"),
    [
        (draw_run_time, [], "rows is empty"),
        (draw_run_time, [("a", 1)], "needed: 3 to 5 of"),
        (draw_run_time, [("a", 0.0, 1.0)], "seconds of every row"),
        (draw_run_time, [("a", 1.0, np.nan)], "bound of nan"),
        (draw_run_time, [(str(i), 1.0, 1.0) for i in range(7)], "7 kinds of basis"),
        (draw_convergence, [(2, 1.0, -1.0)], "error of -1.0"),
        (draw_convergence, [(2,)], "needed: 2 to 3 of"),
    ],
)
def test_rows_that_cannot_be_drawn_are_refused(draw, rows, message):
    with pytest.raises(romerr.InputError, match=message):
        axes_of(draw, rows, "tip", "mm")


# --- verdicts: shares of what a sensor shows, half widths, what is that or more, tolerances ---


def verdict(size, half, how="measured"):
    return Verdict(size, half, how, Answer.NOT_KNOWN)


def row(axis, size, half, **more):
    """A component of a sensor that shows 2 m at most, this one 0.01 m; its error is by modes, in m."""
    of = {"modes": verdict(size, half), "step": verdict(1e-3, 1e-4), "sum": verdict(size, half)}
    more = {"limit": Limit(0.1, True), "estimated": verdict(0.04, 0.01, "estimated"), **more}
    return Row("tip", 0, 0, "m", 0.01, 2.0, of, label=f"tip {axis}", axis=axis, **more)


@pytest.fixture
def axes(tmp_path):
    def drawn(*rows):
        figure = plot_verdicts(rows, tmp_path / "v.png", title="run.py: errors measured")
        assert figure.get_suptitle() == "run.py: errors measured"
        assert (tmp_path / "v.png").read_bytes().startswith(b"\x89PNG")
        return figure.axes[0]

    return drawn


def entries(ax):
    return [text.get_text() for text in ax.figure.legends[0].get_texts()]


def test_shares_are_of_what_all_components_show(axes):
    ax = axes(row("y", 0.02, 0.01))
    assert [bar.get_height() for bar in ax.patches] == [1.0, pytest.approx(0.05)]
    assert [text.get_text() for text in ax.get_xticklabels()] == ["tip y"]
    (diamond,) = [line for line in ax.lines if line.get_marker() == "D"]
    assert diamond.get_ydata().tolist() == [2.0]
    assert "that or more" not in entries(ax)


def test_a_size_without_a_half_width_is_that_or_more(axes):
    ax = axes(row("y", 0.02, None))
    (arrow,) = [line for line in ax.lines if line.get_marker() in (CARETUP, CARETUPBASE)]
    assert arrow.get_ydata().tolist() == [2.0]  # above the bar of 1 %
    assert "that or more" in entries(ax)


@pytest.mark.parametrize("asked", [True, False])
def test_tolerances_that_were_given_are_lines(axes, asked):
    ax = axes(row("y", 0.02, 0.01, limit=Limit(0.1, asked)), row("z", 0.03, 0.01, limit=Limit(0.1, asked)))
    found = [lines for lines in ax.collections if lines.get_label() == "tolerance"]
    assert bool(found) == ("tolerance" in entries(ax)) == asked
    for lines in found:
        assert np.concatenate([path.vertices[:, 1] for path in lines.get_paths()]).tolist() == [5.0] * 2


def test_legends_have_two_lines(axes):
    legend = axes(row("y", 0.02, None)).figure.legends[0]
    assert len(legend.get_texts()) <= 2 * legend._ncols


def test_where_nothing_is_known_the_picture_is_empty(axes):
    """Without a warning: those are errors here."""
    unknown = Verdict(None, None, "not covered", Answer.NOT_COVERED)
    ax = axes(Row("tip", 0, 0, "m", 0.01, 2.0, {"modes": unknown, "sum": unknown}))
    assert (ax.patches[:], ax.figure.legends) == ([], [])
