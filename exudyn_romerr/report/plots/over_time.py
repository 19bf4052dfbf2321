"""Pictures of a report over time: signal with its band, bounds, causes. Matplotlib is imported when one is drawn."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from ...checks import check_count
from ...linear.estimators.causes import BY_STEPS, RESOLVED
from ..data import ReportData
from ..scope import NOT_CERTIFIED, SCOPES
from ..wording import covers_time, estimate_scope, largest, rounded_up, under, widest, widest_scope, with_unit
from .style import (
    CAUSE_STYLES,
    COLOURS,
    OF_BOUND,
    OF_HALF_WIDTH,
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
    look_of,
    mark_zeros,
    quantity,
    spread,
)

RASTER_FROM = 5000  # instants: areas of more are pixels in PDF and SVG too, which have 10 MB and more otherwise
GAPS = (0, (4, 4))  # dashes of the estimate: a bound or true error that it lies on shows between them
BAR = 12  # points: how wide a band is at a single instant
EDGE = 2.0  # points: of a band that is narrower than the line in it this much is seen beside the line
PALE, FULL = 0.15, 0.35  # how much of its colour a band has
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
    bands = [((value - bound, value + bound), OF_BOUND)] if of.bound_covers_all else []
    if guess is not None:
        what, y, half, label = guess
        bands += [((y, y), OF_BOUND), ((y - half, y + half), OF_HALF_WIDTH)]
    limits, leaves = limits_of_signal(lines, bands)
    dots = "o" if len(t) == 1 else None  # a single instant has no line
    ax.plot(t, value, color=COLOURS["value"], marker=dots, label="reduced model")
    if of.bound_covers_all and np.isfinite(bound).any():
        said = f"± bound{of.doubt}, {of.most(bound)}{', cut off' * leaves[0]}"
        _band(ax, t, value, bound, of.colour_of_best(), said, FULL)
    if guess is not None:
        style = {"color": COLOURS["estimate"], "label": f"{label}{', cut off' * any(leaves[-2:])}"}
        # wider than the band of the bound it would hide that one
        below = not of.bound_covers_all or bool(np.max(half) > np.max(bound))
        _band(ax, t, y, half, *style.values(), PALE, zorder=0.9 if below else 1)
        ax.plot(t, y, linestyle=GAPS, marker=dots, **style)
    if of.error is not None:
        ax.plot(t, lines[1], ":", color=COLOURS["error"], marker=dots, label="truth")
    if limits is not None:
        ax.set_ylim(*limits)
    *shown, last = ["reduced model", *["bound"] * of.bound_covers_all, *([what] if guess is not None else [])]
    shown[-1:] = [" and ".join([*shown[-1:], last])]
    title = f"{of.name}: {', '.join(shown)}{of.said_of_bounds * of.bound_covers_all}"
    ax.set(xlabel=quantity(*of.axis), ylabel=quantity(of.name, of.unit))
    finish(ax, title, [infinite(t, bound, "", of.axis)] if of.bound_covers_all else [])


def draw_bounds(ax: Any, report: ReportData, name: str, row: int = 0, tolerance: float | None = None) -> None:
    """Draw the bounds of one row of an output, |estimate| and |true error| if known, of the same error, semilog.

    The estimate has a band, its half width to both sides. tolerance : in the output's unit, a line; None: what the
    report was made with. Other parameters, and errors, as in draw_signal.
    """
    of = _Row(report, name, row)
    kind, bounds, estimate, notes = of.same_error()
    tolerance = of.out.tolerance if tolerance is None else tolerance
    error = None if of.error is None else _visible(np.abs(of.error), of.value)
    known = [] if estimate is None else [np.abs(estimate[0])]
    known += [x for x in (error, None if tolerance is None else np.array([tolerance])) if x is not None]
    bands = {} if estimate is None else {"half width": np.abs(estimate[0]) + estimate[1]}
    limits = limits_of_errors({**bounds, **bands}, known, largest(of.value))
    for place, (e, bound) in enumerate(bounds.items()):
        colour, line, marker = look_of(e)
        style = {"linestyle": line, "marker": marker, "every": spread(len(of.t), place), "markersize": 5}
        label = f"bound '{e}'{of.doubt}" if len(bounds) > 1 else f"bound{of.doubt}, {of.most(bound)}"
        log_line(ax, of.t, bound, color=colour, linewidth=WIDE, label=label, **style)
    if estimate is not None:
        _estimate(ax, of, *estimate, limits)
    thin = {"linewidth": THIN, "marker": ".", "every": ()}
    if error is not None:
        log_line(ax, of.t, error, label="|true error|", color=COLOURS["error"], **thin)
    if bounds and of.out.at_round_off()[row]:
        style = {"color": "#777777", "linestyle": ":", "label": "rounding: nothing below is known"}
        log_line(ax, of.t, of.out.round_off[:, row], **style, **thin)
    if tolerance is not None:
        ax.axhline(tolerance, color=COLOURS["tolerance"], linestyle=(0, (8, 2, 2, 2)), label="tolerance")
    ax.set(xlabel=quantity(*of.axis), ylabel=quantity(f"{kind} of {of.name}", of.unit), yscale="log", ylim=limits)
    unseen = [*_unseen(of, bounds, limits), *notes]
    finish(ax, f"{of.name}: {kind}{of.said_of_bounds if bounds else ''}", unseen)


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
    title = f"{of.name}: what the bound of the {of.kind_of_bound} comes from{of.said_of_bounds}"
    finish(ax, title, [infinite(t, best, "", of.axis)])


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

    def most(self, bound: np.ndarray) -> str:
        """How large a bound gets, in the unit of the axis."""
        return largest_in_words(bound, "", "up to" if self.out.uncertified else "at most")

    @cached_property
    def bounds(self) -> dict[str, np.ndarray]:
        """By estimator, of those that cover most."""
        return {e: self.out.bound[e][:, self.row] for e in widest(self.report.scope) if e in self.out.bound}

    def colour_of_best(self) -> str:
        """That of the sharpest of the bounds that the best one is made of."""
        of = self.bounds
        return look_of(min(of, key=lambda e: (np.count_nonzero(np.isinf(of[e])), largest_finite(of[e]))))[0]

    @cached_property
    def bound_covers_all(self) -> bool:
        """Whether the bound is of all that the estimate is of, the whole error if there is no estimate."""
        has_steps_alone = self.report.time == "sampled" and covers_time(self.out, self.report.time)
        return not self._has_estimate or (self._has_same_scope and not has_steps_alone)

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


def _visible(error: np.ndarray, value: np.ndarray) -> np.ndarray:
    """|error| without what is rounding of the value: of a first instant, say, which would set the axis, 1e-25 m."""
    return np.where((error > 0) & (error < np.finfo(float).eps * np.max(np.abs(value))), np.nan, error)


def _estimate(ax: Any, of: _Row, estimate: np.ndarray, half: np.ndarray, limits: tuple | None) -> None:
    """|estimate| as a dashed line in a band, which leaves the axis where it goes to zero: a logarithm has none."""
    size, label = np.abs(estimate), f"|estimate|{of.within(estimate, half)}"
    style = {"color": COLOURS["estimate"], "linestyle": GAPS, "linewidth": 1.5 * THIN, "marker": ".", "every": ()}
    is_known = np.isfinite(half) & (size + half > 0)
    if is_known.any():
        low, high = (np.where(is_known, x, 1.0) for x in (np.maximum(size - half, limits[0] / 2), size + half))
        _fill(ax, of.t, low, high, is_known, label=label, **_look(COLOURS["estimate"], PALE))
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


def _band(
    ax: Any, t: np.ndarray, middle: np.ndarray, bound: np.ndarray, colour: str, label: str, alpha: float, **more
) -> None:
    """Middle ± bound where that is finite."""
    known = np.isfinite(bound)
    low, high = (np.where(known, middle + sign * bound, middle) for sign in (-1, 1))
    _fill(ax, t, low, high, known, label=label, **_look(colour, alpha), **more)


def _look(colour: str, alpha: float) -> dict[str, Any]:
    """A band's colours: its edges are seen where it is narrow, too."""
    from matplotlib.colors import to_rgba

    return {"facecolor": to_rgba(colour, alpha), "edgecolor": to_rgba(colour, 2 * alpha), "linewidth": EDGE}


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
