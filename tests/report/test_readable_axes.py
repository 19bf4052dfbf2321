"""Axes are ruled by what can be read: a bound that tells nothing leaves them, and its value is in the legend."""

import numpy as np
import pytest

from exudyn_romerr.report.plots.over_time import draw_bounds, draw_signal
from exudyn_romerr.report.plots.panels import plot_report
from tests.report.made_up import axes_of, drawn, legend, made_up, several, with_estimate


def grown(report, times, estimators):
    """The same report with bounds so many times as large; "best" too."""
    out = report.output("tip")
    out.bound = {e: x * (times if e in estimators else 1) for e, x in out.bound.items()}
    return report


def test_a_useless_bound_does_not_rule_the_axis_of_the_signal():
    """Value and truth, 9.5 to 11 mm, and the corrected output set it; 2000 mm are in the legend."""
    ax = axes_of(draw_signal, grown(made_up(), 1000, ("energy", "auxiliary", "best")), "tip")
    assert legend(ax)[1] == "± bound, at most 2000, cut off"
    low, high = ax.get_ylim()
    assert 8 < low < 9.5
    assert 11 < high < 13
    assert not any("cut off" in words for words in legend(axes_of(draw_signal, made_up(), "tip")))


def test_an_estimate_far_beyond_the_output_is_cut_off_too():
    report = with_estimate(made_up(truth=False), 0.1)
    out = report.output("tip")
    out.estimate, out.uncertainty = 1e4 * out.estimate, 1e4 * out.uncertainty
    ax = axes_of(draw_signal, report, "tip")
    assert "+ estimate (not resolved) ± 1000, cut off" in legend(ax)
    assert ax.get_ylim()[1] < 20


@pytest.mark.parametrize(("times", "leaves"), [(1, False), (1e6, True)])
def test_a_bound_far_above_the_output_leaves_the_axis_of_errors(times, leaves):
    """The other bound, estimate and error are read; how large it gets is in the title."""
    ax = axes_of(draw_bounds, grown(with_estimate(made_up(), 0.05), times, ("energy",)), "tip")
    top, note = ax.get_ylim()[1], ax.get_title().partition("\n")[2]
    assert top < 1e3
    assert note == ("bound by 'energy' above the axis, up to 6e+06 mm" if leaves else "")
    (line,) = [found for found in ax.lines if found.get_label().startswith("bound 'auxiliary'")]
    assert np.nanmax(line.get_ydata()) < top


def test_the_smallest_bound_is_seen_where_there_is_nothing_else():
    report = grown(made_up(truth=False, corrected=False), 1e9, ("energy", "auxiliary", "best"))
    ax = axes_of(draw_bounds, report, "tip")
    low, high = ax.get_ylim()
    assert any(low < np.nanmax(line.get_ydata()) < high for line in ax.lines if line.get_ydata().size)


def test_first_instants_do_not_stretch_the_axis():
    """A bound that begins with rounding, 1e-30 mm: twenty decades would leave a line at the top."""
    report = with_estimate(made_up(), 0.05)
    for x in report.output("tip").bound.values():
        x[0] = 1e-30
    assert axes_of(draw_bounds, report, "tip").get_ylim()[0] > 1e-7


def test_rows_that_hardly_move_are_not_chosen():
    """The last row has the largest bound, and changes by a thousandth of what the others do."""
    report = several(2, 3)
    assert drawn(plot_report(report)) == ["out 0 z", "out 1 z"]
    for out in report.outputs.values():
        out.value[:, 2] = 1e-3 * (out.value[:, 2] - out.value[0, 2])
    assert drawn(plot_report(report)) == ["out 0 y", "out 1 y"]


def test_a_row_is_chosen_by_its_estimate_where_that_is_larger_than_its_bound():
    """Time steps are in the estimate, and in no bound of a mechanism."""
    report = several(2, 3)
    for out in report.outputs.values():
        out.estimate = np.zeros_like(out.value)
        out.estimate[:, 0] = 100.0
        out.uncertainty = np.zeros_like(out.value)
        out.estimate_parts, out.uncertainty_parts = {"time step": out.estimate}, {"steps": out.uncertainty}
    assert drawn(plot_report(report)) == ["out 0 x", "out 1 x"]
