"""The picture of verdicts: shares of what a sensor shows, half widths, what is that or more, tolerances."""

import numpy as np
import pytest
from matplotlib.markers import CARETUP, CARETUPBASE

from exudyn_romerr.report.answers import Answer
from exudyn_romerr.report.plots.comparisons import plot_verdicts
from exudyn_romerr.report.verdicts import Row, Verdict


def verdict(size, half, how="measured"):
    return Verdict(size, half, how, Answer.NOT_KNOWN)


def row(axis, size, half, **more):
    """A component of a sensor that shows 2 m at most, this one 0.01 m; its error is by modes, in m."""
    of = {"modes": verdict(size, half), "step": verdict(1e-3, 1e-4), "sum": verdict(size, half)}
    more = {"tolerance": 0.1, "is_asked": True, "estimated": verdict(0.04, 0.01, "estimated"), **more}
    return Row("tip", 0, 0, "m", 0.01, 2.0, of, label=f"tip {axis}", axis=axis, **more)


@pytest.fixture
def axes(tmp_path):
    def drawn(*rows):
        figure = plot_verdicts(rows, tmp_path / "v.png", title="run.py: errors measured")
        assert figure.get_suptitle() == "run.py: errors measured"
        assert (tmp_path / "v.png").read_bytes().startswith(b"\x89PNG")
        return figure.axes[0]

    return drawn


def legend(ax):
    return [text.get_text() for text in ax.figure.legends[0].get_texts()]


def test_shares_are_of_what_all_components_show(axes):
    ax = axes(row("y", 0.02, 0.01))
    assert [bar.get_height() for bar in ax.patches] == [1.0, pytest.approx(0.05)]
    assert [text.get_text() for text in ax.get_xticklabels()] == ["tip y"]
    (diamond,) = [line for line in ax.lines if line.get_marker() == "D"]
    assert diamond.get_ydata().tolist() == [2.0]
    assert "that or more" not in legend(ax)


def test_a_size_without_a_half_width_is_that_or_more(axes):
    ax = axes(row("y", 0.02, None))
    (arrow,) = [line for line in ax.lines if line.get_marker() in (CARETUP, CARETUPBASE)]
    assert arrow.get_ydata().tolist() == [2.0]  # above the bar of 1 %
    assert "that or more" in legend(ax)


@pytest.mark.parametrize("asked", [True, False])
def test_tolerances_that_were_given_are_lines(axes, asked):
    ax = axes(row("y", 0.02, 0.01, is_asked=asked), row("z", 0.03, 0.01, is_asked=asked))
    found = [lines for lines in ax.collections if lines.get_label() == "tolerance"]
    assert bool(found) == ("tolerance" in legend(ax)) == asked
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
