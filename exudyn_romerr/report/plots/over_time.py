"""Pictures of a report over time: signal with its band, bounds, causes; bands on axes of others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from numbers import Integral
from typing import Any

import numpy as np

from ...checks import check_count
from ...errors import InputError
from ...linear.residual.samples import SAME_TIMES
from ..causes import BY_STEPS, RESOLVED
from ..data import ReportData
from ..scope import NOT_CERTIFIED, SCOPES
from ..wording import covers_time, estimate_scope, largest, rounded_up, under, widest, widest_scope, with_unit
from .style import (
    CAUSE_STYLES,
    COLOURS,
    LOOKS,
    OF_BOUND,
    OF_HALF_WIDTH,
    OTHERS,
    THIN,
    WIDE,
    finish,
    infinite,
    isolated,
    largest_finite,
    largest_in_words,
    limits_of_errors,
    limits_of_signal,
    log_line,
    mark_zeros,
    quantity,
    spread,
)

RASTER_FROM = 5000  # instants: areas of more are pixels in PDF and SVG too, which have 10 MB and more otherwise
GAPS = (0, (4, 4))  # dashes of the estimate: a bound or true error that it lies on shows between them
BAR = 12  # points: how wide a band is at a single instant
EDGE = 2.0  # points: of a band that is narrower than the line in it this much is seen beside the line
PALE, FULL = 0.15, 0.35  # how much of its colour a band has
SAME_VALUES = 1e-6  # of the largest: sensor files have 10 digits; a factor between units is 10 at least
WHOLE, OF_MODES = "error", "error of the modes"


def draw_signal(ax: Any, report: ReportData, name: str, row: int = 0) -> None:
    """Draw one row of an output, value ± bound, and the best guess of the full model's output with its half width.

    A bound that covers less than the estimate is not drawn beside it.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    report : BoundReport
    name : str
        Of the output; its truth is drawn too if one was compared.
    row : int
        Of an output with several rows, from 0.

    Raises
    ------
    InputError
        Unknown output, or a row that it does not have.
    """
    of = _Row(report, name, row)
    t, value, bound, guess = of.t, of.value, of.best, of.best_guess()
    lines = [value] if of.error is None else [value, value + of.error]
    bands, shown, notes = [], ["reduced model"], []
    if of.bound_covers_all:
        bands, shown, notes = [(value, bound, OF_BOUND)], [*shown, "bound"], [infinite(t, bound, "", of.axis)]
    if guess is not None:
        what, y, half, label = guess
        bands, shown = [*bands, (y, 0.0 * y, OF_BOUND), (y, half, OF_HALF_WIDTH)], [*shown, what]
    limits, leaves = limits_of_signal(lines, bands)
    dots = "o" if len(t) == 1 else None  # a single instant has no line
    ax.plot(t, value, color=COLOURS["value"], marker=dots, label="reduced model")
    if of.bound_covers_all and np.isfinite(bound).any():
        said = f"± bound{of.doubt}, {of.most(bound)}{', cut off' * leaves[0]}"
        _band(ax, t, value - bound, value + bound, of.colour_of_best(), FULL, label=said)
    if guess is not None:
        label = f"{label}{', cut off' * any(leaves[-2:])}"
        # wider than the band of the bound it would hide that one
        below = not of.bound_covers_all or bool(np.max(half) > np.max(bound))
        _band(ax, t, y - half, y + half, COLOURS["estimate"], PALE, label=label, zorder=0.9 if below else 1)
        ax.plot(t, y, color=COLOURS["estimate"], linestyle=GAPS, marker=dots, label=label)
    if of.error is not None:
        ax.plot(t, lines[1], ":", color=COLOURS["error"], marker=dots, label="truth")
    if limits is not None:
        ax.set_ylim(*limits)
    said = ", ".join([*shown[:-2], " and ".join(shown[-2:])])
    ax.set(xlabel=quantity(*of.axis), ylabel=quantity(of.name, of.unit))
    finish(ax, f"{of.name}: {said}{of.said_of_bounds * of.bound_covers_all}", notes)


def draw_bounds(ax: Any, report: ReportData, name: str, row: int = 0, tolerance: float | None = None) -> None:
    """Draw the bounds of one row of an output, |estimate| and |true error| if known, of the same error, semilog.

    The estimate has a band, its half width to both sides. tolerance : in the output's unit, a line; None: what the
    report was made with. Other parameters, and errors, as in draw_signal.
    """
    of = _Row(report, name, row)
    kind, bounds, estimate, notes = of.same_error()
    tolerance = of.out.tolerance if tolerance is None else tolerance
    known, wide = [], dict(bounds)
    if estimate is not None:
        known, wide = [np.abs(estimate[0])], {**bounds, "half width": np.abs(estimate[0]) + estimate[1]}
    if of.error is not None:
        # without what is rounding of the value: of a first instant, say, which would set the axis, 1e-25 m
        error, rounding = np.abs(of.error), np.finfo(float).eps * largest(of.value)
        known.append(np.where((error > 0) & (error < rounding), np.nan, error))
    limits = limits_of_errors(
        wide, [*known, *([] if tolerance is None else [np.array([tolerance])])], largest(of.value)
    )
    for place, (e, bound) in enumerate(bounds.items()):
        colour, line, marker = LOOKS.get(e, OTHERS)
        style = {"linestyle": line, "marker": marker, "every": spread(len(of.t), place), "markersize": 5}
        label = f"bound '{e}'{of.doubt}" if len(bounds) > 1 else f"bound{of.doubt}, {of.most(bound)}"
        log_line(ax, of.t, bound, color=colour, linewidth=WIDE, label=label, **style)
    if estimate is not None:
        _estimate(ax, of, *estimate, limits)
    thin = {"linewidth": THIN, "marker": ".", "every": ()}
    if of.error is not None:
        log_line(ax, of.t, known[-1], label="|true error|", color=COLOURS["error"], **thin)
    if bounds and of.out.at_round_off()[row]:
        style = {"color": "#777777", "linestyle": ":", "label": "rounding: nothing below is known"}
        log_line(ax, of.t, of.out.round_off[:, row], **style, **thin)
    if tolerance is not None:
        ax.axhline(tolerance, color=COLOURS["tolerance"], linestyle=(0, (8, 2, 2, 2)), label="tolerance")
    ax.set(xlabel=quantity(*of.axis), ylabel=quantity(f"{kind} of {of.name}", of.unit), yscale="log", ylim=limits)
    finish(ax, f"{of.name}: {kind}{of.said_of_bounds if bounds else ''}", [*_unseen(of, bounds, limits), *notes])


def draw_causes(ax: Any, report: ReportData, name: str, row: int = 0) -> None:
    """Draw what the best bound of one row of an output comes from, in % of it, stacked over time.

    The legend has the shares at the worst instant, of causes that are not zero throughout. Where the bound is zero or
    infinite there are no shares. Parameters and errors as in draw_signal.
    """
    of = _Row(report, name, row)
    t, best, worst = of.t, of.best, int(np.argmax(of.best))
    known = (best > 0) & np.isfinite(best)
    below = np.zeros(len(t))
    for cause, (words, colour, hatch) in CAUSE_STYLES.items():
        parts = of.out.causes.get(cause, np.zeros_like(of.out.bound["best"]))  # older files have fewer causes
        share = np.divide(100 * parts[:, row], best, out=np.zeros(len(t)), where=known)
        if cause == "time step" and report.time == "sampled":
            label = f"{words}: not covered"
        elif not share.any():
            continue
        else:
            label = f"{words}, {_percent(share[worst])}" if known[worst] else words
        style = {"facecolor": colour, "hatch": hatch, "edgecolor": "white", "linewidth": 0, "label": label}
        _fill(ax, t, below, below + share, known, **style)
        below = below + share
    mark_zeros(ax, t, best, COLOURS["value"])
    (axis, unit), most = of.axis, with_unit(rounded_up(best[worst]), of.unit)
    label = f"worst, {axis} = {t[worst]:.4g} {unit}".rstrip() + f": {most}"
    ax.axvline(t[worst], color=COLOURS["value"], linestyle="--", linewidth=THIN, label=label)
    ax.set(xlabel=quantity(*of.axis), ylabel="share of the bound / %", ylim=(0, 100))
    ax.margins(x=0.01)
    what = f"what the bound of the {of.kind_of_bound} comes from{of.said_of_bounds}"
    finish(ax, f"{of.name}: {what}", [infinite(t, best, "", of.axis)])


class _Row:
    """One row of an output: what is known of it over time (T,), and what of that is of the same error.

    Only this is drawn together, for a bound of the modes is none of the steps.
    """

    def __init__(self, report: ReportData, name: str, row: int):
        out = report.output(name)
        check_count(f"row of output {name!r}", row, out.value.shape[1] - 1, "its rows, from 0", least=0)
        self.report, self.out, self.row = report, out, row
        self.t, self.name, self.unit = report.t, out.row_names[row], out.unit
        self.value, self.best = out.value[:, row], out.bound["best"][:, row]
        self.error = None if out.error is None else out.error[:, row]
        self.axis = ("load factor", "") if report.time == "static" else ("t", "s")
        self.doubt = f", {NOT_CERTIFIED}" if out.uncertified else ""
        self.kind_of_bound = OF_MODES if report.time == "sampled" else WHOLE
        said = under(report.scope, doubts=out.uncertified).removeprefix(", ")
        self.said_of_bounds = said and f" (bound {said})"  # in titles
        covered, of_bound = estimate_scope(out, report.scope), widest_scope(report.scope)
        self._has_same_scope = covered == of_bound
        # an estimate of all that the bound is of, or of more
        self._has_estimate = out.estimate is not None and SCOPES.index(covered) <= SCOPES.index(of_bound)
        has_steps_alone = report.time == "sampled" and covers_time(out, report.time)
        # whether the bound is of all that the estimate is of, the whole error if there is no estimate
        self.bound_covers_all = not self._has_estimate or (self._has_same_scope and not has_steps_alone)
        # by estimator, of those that cover most
        self.bounds = {e: out.bound[e][:, row] for e in widest(report.scope) if e in out.bound}

    def most(self, bound: np.ndarray) -> str:
        """How large a bound gets, in the unit of the axis."""
        return largest_in_words(bound, "", "up to" if self.out.uncertified else "at most")

    def colour_of_best(self) -> str:
        """That of the sharpest of the bounds that the best one is made of."""
        of = self.bounds
        sharpest = min(of, key=lambda e: (np.count_nonzero(np.isinf(of[e])), largest_finite(of[e])))
        return LOOKS.get(sharpest, OTHERS)[0]

    def best_guess(self) -> tuple[str, np.ndarray, np.ndarray, str] | None:
        """What it is, best guess of the full model's output, half width, label; where proved the corrected output."""
        out, row = self.out, self.row
        if self._has_estimate and set(out.uncertainty_parts) != {"proved"}:
            estimate, half = out.estimate[:, row], out.uncertainty[:, row]
            return "estimate", self.value + estimate, half, f"+ estimate{self.within(estimate, half)}"
        if out.corrected is None:
            return None
        half = out.corrected_bound[:, row]
        return "corrected output", out.corrected[:, row], half, f"corrected{_within(half)}{self.doubt}"

    def within(self, estimate: np.ndarray, half: np.ndarray) -> str:
        """For a legend: whether an estimate is a number to rely on, and its half width."""
        is_resolved = largest(half) <= max(RESOLVED * largest(estimate), largest(self.value))
        return f"{'' if is_resolved else ' (not resolved)'}{_within(half)}"

    def same_error(self) -> tuple[str, dict[str, np.ndarray], tuple[np.ndarray, np.ndarray] | None, tuple[str, ...]]:
        """What is drawn together: kind of error, bounds, estimate with its half width or None, what is left out.

        Of the modes where the bound is of these alone; of the whole error where a truth was compared that has other
        steps, where the bound takes forces as they are, or where no bound is finite.
        """
        out, row, time, scope = self.out, self.row, self.report.time, self.report.scope
        others = (e for e in scope if e not in widest(scope))
        narrower = tuple(f"'{e}'{under(scope, e)}: not drawn" for e in others)
        if not self._has_estimate:
            return self.kind_of_bound, self.bounds, None, narrower
        whole = out.estimate[:, row], out.uncertainty[:, row]
        if self.bound_covers_all:
            return WHOLE if covers_time(out, time) else self.kind_of_bound, self.bounds, whole, narrower
        if not any(np.isfinite(bound).any() for bound in self.bounds.values()):
            return WHOLE, {}, whole, ("no finite bound",)
        modes = out.estimate - out.estimate_parts.get("time step", 0.0)
        halves = [x for check, x in out.uncertainty_parts.items() if check not in BY_STEPS]
        modes, half = modes[:, row], (np.zeros_like(out.value) + sum(halves))[:, row]
        is_of_modes = self.error is None or largest(self.error - modes) < largest(self.error - whole[0])
        if self._has_same_scope and is_of_modes:
            return OF_MODES, self.bounds, (modes, half), narrower
        why = "of the modes alone" if self._has_same_scope else under(scope).removeprefix(", ")
        return WHOLE, {}, whole, (f"bound {why}{self.doubt}: not drawn",)


def _estimate(ax: Any, of: _Row, estimate: np.ndarray, half: np.ndarray, limits: tuple | None) -> None:
    """|estimate| as a dashed line in a band, which leaves the axis where it goes to zero: a logarithm has none."""
    size, label = np.abs(estimate), f"|estimate|{of.within(estimate, half)}"
    is_known = np.isfinite(half) & (size + half > 0)
    if is_known.any():
        high = np.where(is_known, size + half, np.nan)
        _band(ax, of.t, np.maximum(size - half, limits[0] / 2), high, COLOURS["estimate"], PALE, label=label)
    style = {"color": COLOURS["estimate"], "linestyle": GAPS, "linewidth": 1.5 * THIN, "marker": ".", "every": ()}
    log_line(ax, of.t, size, label=label, zorder=2.5, **style)  # above the other lines


def _unseen(of: _Row, bounds: dict[str, np.ndarray], limits: tuple | None) -> Iterator[str]:
    """What is not to be seen of the bounds: where they are infinite, and how large those above the axis get."""
    for e, bound in bounds.items():
        by = f" by '{e}'" if len(bounds) > 1 else ""
        yield infinite(of.t, bound, by, of.axis)
        if limits is not None and largest_finite(bound) > limits[1]:
            yield f"bound{of.doubt}{by} above the axis, {largest_in_words(bound, of.unit, 'up to')}"


def _within(half: np.ndarray) -> str:
    """For a legend: the largest half width, in the unit of the axis."""
    return f" {largest_in_words(half, '', '±')}" if np.isfinite(half).any() else ", half width not known"


def _band(ax: Any, t: np.ndarray, low: np.ndarray, high: np.ndarray, colour: str, alpha: float, **more: Any) -> None:
    """A pale area where it is finite; its edges are seen where it is narrow, too."""
    from matplotlib.colors import to_rgba

    look = {"facecolor": to_rgba(colour, alpha), "edgecolor": to_rgba(colour, 2 * alpha), "linewidth": EDGE}
    _fill(ax, t, low, high, np.isfinite(high), **look, **more)


def _fill(ax: Any, t: np.ndarray, low: np.ndarray, high: np.ndarray, known: np.ndarray, **style: Any) -> None:
    """An area over the runs of instants that are known; a bar where such a run is a single instant."""
    if known.any():
        ax.fill_between(t, low, high, where=known, rasterized=len(t) > RASTER_FROM, **style)
    alone = isolated(known)
    if alone.size:
        opaque = {"colors": style["facecolor"], "zorder": style.get("zorder", 1)}
        ax.vlines(t[alone], low[alone], high[alone], linewidth=BAR, **opaque)


def _percent(share: float) -> str:
    if 0 < share < 0.5:
        return "< 1 %"
    return "> 99 %" if 99.5 <= share < 100 else f"{share:.0f} %"


# --- on axes of others, such as those of Exudyn's PlotSensor ---


def add_bands(plotted: Any, report: ReportData, name: str, components: int | Sequence[int] = 0) -> list[Any]:
    """Draw value ± bound around the lines of an output, in their colours: the full model lies in between.

    Parameters
    ----------
    plotted : matplotlib axes, or what mbs.PlotSensor(...) returned
        One line shows each component over time.
    report : BoundReport
    name : str
        Of an output.
    components : int or sequence of int
        Rows of the output, numbered from 0 as in PlotSensor.

    Returns
    -------
    list of matplotlib.collections.PolyCollection

    Raises
    ------
    InputError
        Unknown output or component; no line shows it (plotted with factors= or offsets=, another run).

    Notes
    -----
    A legend that is there is made anew; a band drawn before around the same line is replaced. Does not cover:
    instants at which the bound is infinite; nothing is drawn.
    """
    ax = plotted[2] if isinstance(plotted, list | tuple) and len(plotted) == 4 else plotted
    if not hasattr(ax, "fill_between"):
        raise InputError(f"plotted is a {type(ax).__name__}; needed: axes, or what mbs.PlotSensor returned")
    names, bands = report.output(name).row_names, []
    rows = [components] if isinstance(components, Integral) else components
    if not isinstance(rows, Sequence) or not all(isinstance(i, Integral) and 0 <= i < len(names) for i in rows):
        raise InputError(f"components={components!r}; allowed: numbers in 0..{len(names) - 1}")
    for of in (_Row(report, name, row) for row in rows):
        line = next((line for line in ax.get_lines() if _shows(line, of.t, of.value)), None)
        if line is None:
            raise InputError(
                f"no line of these axes shows {of.name} over time; plot the sensor that the output was made of, of "
                "the same run, without factors= and offsets="
            )
        most = largest_in_words(of.best, of.unit, "bound up to" if of.out.uncertified else "at most")
        label = f"{of.name} ± {most}{under(report.scope, doubts=of.out.uncertified)}"
        key = f"band of {of.name} around line {ax.get_lines().index(line)}"
        for older in [x for x in ax.collections if x.get_gid() == key]:
            older.remove()
        style = {"color": line.get_color(), "alpha": FULL, "linewidth": 0, "label": label, "gid": key}
        bands.append(ax.fill_between(of.t, of.value - of.best, of.value + of.best, **style))
    # into the legend that is there: PlotSensor's belongs to the figure
    if ax.get_legend() is not None:
        ax.legend()
    if legends := list(ax.figure.legends):
        for legend in legends:
            legend.remove()
        ax.figure.legend()
    return bands


def _shows(line: Any, t: np.ndarray, value: np.ndarray) -> bool:
    x, y = (np.asarray(data, dtype=float) for data in line.get_data())
    x, y = x[x >= t[0]], y[x >= t[0]]  # bounds may begin a step later
    at = np.clip(np.searchsorted(t, x - SAME_TIMES * np.ptp(t)), 0, len(t) - 1)
    if not x.size or np.any(np.abs(t[at] - x) > SAME_TIMES * np.ptp(t)):
        return False
    return bool(np.all(np.abs(value[at] - y) <= SAME_VALUES * np.max(np.abs(value))))
