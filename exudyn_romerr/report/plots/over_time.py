"""Pictures of a report over time: signal with its band, bounds, causes. Matplotlib is imported when one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...checks import check_count
from ...linear.estimators.causes import BY_STEPS, RESOLVED
from ..scope import NOT_CERTIFIED, SCOPES
from ..wording import covers_time, estimate_scope, largest, rounded_up, under, widest, widest_scope, with_unit
from .style import (
    CAUSE_STYLES,
    COLOURS,
    MARKERS,
    OF_BOUND,
    OF_HALF_WIDTH,
    OTHERS,
    STYLES,
    THIN,
    WIDE,
    above,
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

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..data import OutputReport, ReportData

RASTER_FROM = 5000  # instants: areas of more are pixels in PDF and SVG too, which have 10 MB and more otherwise
GAPS = (0, (4, 4))  # dashes of the estimate: a bound or true error that it lies on shows between them
BAR = 12  # points: how wide a band is at a single instant
EDGE = 2.0  # points: of a band that is narrower than the line in it this much is seen beside the line
PALE, FULL = 0.15, 0.35  # how much of its colour a band has


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
    out, t = _row_of(report, name, row), report.t
    value, bound = out.value[:, row], out.bound["best"][:, row]
    lines = [value, *([] if out.error is None else [value + out.error[:, row]])]
    has_bound, best = _bound_covers(report, out), _corrected(report, out, row)
    bands = [((value - bound, value + bound), OF_BOUND)] if has_bound else []
    if best is not None:
        guess, half, word, label = best
        bands += [((guess, guess), OF_BOUND), ((guess - half, guess + half), OF_HALF_WIDTH)]
    limits, leaves = limits_of_signal(lines, bands)
    ax.plot(t, value, color=COLOURS["value"], marker=_dots(t), label="reduced model")
    if has_bound and np.isfinite(bound).any():
        cut = ", cut off" * leaves[0]
        _band(ax, t, value, bound, _colour(report, out, row), f"± {_bound(out)}, {_most(out, bound)}{cut}", FULL)
    if best is not None:
        style = {"color": COLOURS["estimate"], "label": f"{label}{', cut off' * any(leaves[-2:])}"}
        # wider than the band of the bound it would hide that one
        below = not has_bound or bool(np.max(half) > np.max(bound))
        _band(ax, t, guess, half, *style.values(), PALE, zorder=0.9 if below else 1)
        ax.plot(t, guess, linestyle=GAPS, marker=_dots(t), **style)
    if out.error is not None:
        ax.plot(t, lines[1], ":", color=COLOURS["error"], marker=_dots(t), label="truth")
    if limits is not None:
        ax.set_ylim(*limits)
    shown = ["reduced model", *["bound"] * has_bound, *([] if best is None else [word])]
    shown[-2:] = [" and ".join(shown[-2:])]
    title = f"{out.row_names[row]}: {', '.join(shown)}{_said_of_bounds(report, out) * has_bound}"
    notes = [infinite(t, bound, "", _axis(report))] if has_bound else []
    ax.set(xlabel=_time(report), ylabel=quantity(out.row_names[row], out.unit))
    finish(ax, title, notes)


def draw_bounds(ax: Any, report: ReportData, name: str, row: int = 0, tolerance: float | None = None) -> None:
    """Draw the bounds of one row of an output, |estimate| and |true error| if known, of the same error, semilog.

    The estimate has a band, its half width to both sides. tolerance : in the output's unit, a line; None: what the
    report was made with. Other parameters, and errors, as in draw_signal.
    """
    out, t = _row_of(report, name, row), report.t
    drawn = _same_error(report, out, row)
    tolerance = out.tolerance if tolerance is None else tolerance
    error = None if drawn.error is None else _visible(np.abs(drawn.error), out.value[:, row])
    size = None if drawn.estimate is None else np.abs(drawn.estimate)
    bands = {} if size is None else {"half width": size + drawn.half}
    others = [x for x in (size, error, None if tolerance is None else np.array([tolerance])) if x is not None]
    limits = limits_of_errors({**drawn.bounds, **bands}, others, float(np.max(np.abs(out.value[:, row]))))
    for place, e in enumerate(drawn.bounds):
        kinds = zip((COLOURS, STYLES, MARKERS), OTHERS, strict=True)
        color, line, marker = (known.get(e, other) for known, other in kinds)
        style = {"linestyle": line, "marker": marker, "every": spread(len(t), place), "markersize": 5}
        alone = not drawn.bounds.keys() - {e}
        label = f"{_bound(out)}, {_most(out, drawn.bounds[e])}" if alone else f"bound '{e}'{_doubt(out)}"
        log_line(ax, t, drawn.bounds[e], color=color, linewidth=WIDE, label=label, **style)
    if drawn.estimate is not None:
        label = f"|estimate|{_not_resolved(size, drawn.half, out.value[:, row])}{_within(drawn.half)}"
        _estimate(ax, t, drawn, label, limits)
    if error is not None:
        style = {"color": COLOURS["error"], "linewidth": THIN, "marker": ".", "every": ()}
        log_line(ax, t, error, label="|true error|", **style)
    if drawn.bounds and out.at_round_off()[row]:
        style = {"color": "#777777", "linestyle": ":", "linewidth": THIN, "marker": ".", "every": ()}
        log_line(ax, t, out.round_off[:, row], label="rounding: nothing below is known", **style)
    if tolerance is not None:
        ax.axhline(tolerance, color=COLOURS["tolerance"], linestyle=(0, (8, 2, 2, 2)), label="tolerance")
    said = _said_of_bounds(report, out) if drawn.bounds else ""
    notes = [*_beyond(report, out, drawn, limits), *drawn.left_out]
    ylabel = quantity(f"{drawn.kind} of {out.row_names[row]}", out.unit)
    ax.set(xlabel=_time(report), ylabel=ylabel, yscale="log", ylim=limits)
    finish(ax, f"{out.row_names[row]}: {drawn.kind}{said}", notes)


def draw_causes(ax: Any, report: ReportData, name: str, row: int = 0) -> None:
    """Draw what the best bound of one row of an output comes from, in % of it, stacked over time.

    The legend has the shares at the worst instant, of causes that are not zero throughout. Where the bound is zero or
    infinite there are no shares. Parameters and errors as in draw_signal.
    """
    out, t = _row_of(report, name, row), report.t
    best, worst = out.bound["best"][:, row], int(np.argmax(out.bound["best"][:, row]))
    known = (best > 0) & np.isfinite(best)
    below = np.zeros(len(t))
    for cause, (words, colour, hatch) in CAUSE_STYLES.items():
        of_cause = out.causes.get(cause, np.zeros_like(out.bound["best"]))  # older files have fewer causes
        share = np.divide(100 * of_cause[:, row], best, out=np.zeros(len(t)), where=known)
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
    worst_label = _worst(report, out, row, worst)
    ax.axvline(t[worst], color=COLOURS["value"], linestyle="--", linewidth=THIN, label=worst_label)
    title = f"{out.row_names[row]}: what the bound of the {_kind_of_bound(report)} comes from"
    ax.set(xlabel=_time(report), ylabel="share of the bound / %", ylim=(0, 100))
    ax.margins(x=0.01)
    finish(ax, f"{title}{_said_of_bounds(report, out)}", [infinite(t, best, "", _axis(report))])


def _visible(error: np.ndarray, value: np.ndarray) -> np.ndarray:
    """|error| without what is rounding of the value: of a first instant, say, which would set the axis, 1e-25 m."""
    return np.where((error > 0) & (error < np.finfo(float).eps * np.max(np.abs(value))), np.nan, error)


def _corrected(report: ReportData, out: OutputReport, row: int) -> tuple[np.ndarray, np.ndarray, str, str] | None:
    """Best guess of the full model's output, half width, name, label; where it is proved the corrected output."""
    if _has_estimate(report, out) and _is_estimated(out):
        value, estimate, half = (x[:, row] for x in (out.value, out.estimate, out.uncertainty))
        return value + estimate, half, "estimate", f"+ estimate{_not_resolved(estimate, half, value)}{_within(half)}"
    if out.corrected is None:
        return None
    half = out.corrected_bound[:, row]
    return out.corrected[:, row], half, "corrected output", f"corrected{_within(half)}{_doubt(out)}"


def _is_estimated(out: OutputReport) -> bool:
    """Whether there is an estimate that no proof stands behind."""
    return out.estimate is not None and set(out.uncertainty_parts) != {"proved"}


def _estimate(ax: Any, t: np.ndarray, drawn: SameError, label: str, limits: tuple | None) -> None:
    """|estimate| as a dashed line in a band, which leaves the axis where it goes to zero: a logarithm has none."""
    size, half = np.abs(drawn.estimate), drawn.half
    style = {"color": COLOURS["estimate"], "linestyle": GAPS, "linewidth": 1.5 * THIN, "marker": ".", "every": ()}
    is_known = np.isfinite(half) & (size + half > 0)
    if is_known.any():
        low, high = (np.where(is_known, x, 1.0) for x in (np.maximum(size - half, limits[0] / 2), size + half))
        _fill(ax, t, low, high, is_known, label=label, **_look(COLOURS["estimate"], PALE))
    log_line(ax, t, size, label=label, zorder=2.5, **style)  # above the other lines


def _beyond(report: ReportData, out: OutputReport, drawn: SameError, limits: tuple | None) -> Iterator[str]:
    """What is not to be seen of the bounds."""
    for e, bound in drawn.bounds.items():
        by = f" by '{e}'" if drawn.bounds.keys() - {e} else ""
        yield infinite(report.t, bound, by, _axis(report))
        leaves = above(limits, bound, out.unit)
        yield leaves and f"{_bound(out)}{by} {leaves}"


def _bound(out: OutputReport) -> str:
    return f"bound{_doubt(out)}"


def _most(out: OutputReport, bound: np.ndarray) -> str:
    """How large a bound gets, in the unit of the axis."""
    return largest_in_words(bound, "", "up to" if out.uncertified else "at most")


def _within(half: np.ndarray) -> str:
    """For a legend: the largest half width, in the unit of the axis."""
    return f" {largest_in_words(half, '', '±')}" if np.isfinite(half).any() else ", half width not known"


def _colour(report: ReportData, out: OutputReport, row: int) -> str:
    """That of the sharpest of the bounds that the best one is made of."""
    bounds = _same_error(report, out, row).bounds
    sharpest = min(bounds, key=lambda e: (np.count_nonzero(np.isinf(bounds[e])), largest_finite(bounds[e])))
    return COLOURS.get(sharpest, OTHERS[0])


def _not_resolved(*row: np.ndarray) -> str:
    """For a legend: that an estimate, of this half width, of this value, is no number to rely on."""
    size, half, value = (float(np.max(np.abs(x))) for x in row)
    return " (not resolved)" if half > max(RESOLVED * size, value) else ""


def _doubt(out: OutputReport) -> str:
    """What is said of bounds beside what they are of."""
    return f", {NOT_CERTIFIED}" if out.uncertified else ""


def _said_of_bounds(report: ReportData, out: OutputReport) -> str:
    """What a title says of bounds: what they hold under, and that they are not certified."""
    said = under(report.scope, doubts=out.uncertified).removeprefix(", ")
    return said and f" (bound {said})"


def _row_of(report: ReportData, name: str, row: int) -> OutputReport:
    out = report.output(name)
    check_count(f"row of output {name!r}", row, out.value.shape[1] - 1, "its rows, from 0", least=0)
    return out


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


def _dots(t: np.ndarray) -> str | None:
    """A single instant has no line."""
    return "o" if len(t) == 1 else None


def _axis(report: ReportData) -> tuple[str, str]:
    """Name and unit of what everything is drawn over."""
    return ("load factor", "") if report.time == "static" else ("t", "s")


def _time(report: ReportData) -> str:
    return quantity(*_axis(report))


def _percent(share: float) -> str:
    if 0 < share < 0.5:
        return "< 1 %"
    return "> 99 %" if 99.5 <= share < 100 else f"{share:.0f} %"


def _worst(report: ReportData, out: OutputReport, row: int, at: int) -> str:
    name, unit = _axis(report)
    bound = with_unit(rounded_up(out.bound["best"][at, row]), out.unit)
    return f"worst, {name} = {report.t[at]:.4g} {unit}".rstrip() + f": {bound}"


# --- what covers the same: that alone is drawn together, for a bound of the modes is none of the steps ---

WHOLE, OF_MODES = "error", "error of the modes"


class SameError(NamedTuple):
    """Of one row what is of the same error: `kind`; what is None is not known of it, or not drawn.

    bounds : (T,) by estimator, of those that cover most. estimate, error : (T,), signed. half : of the estimate.
    left_out : what is not drawn beside these, in words.
    """

    kind: str
    bounds: dict[str, np.ndarray]
    estimate: np.ndarray | None
    half: np.ndarray | None
    error: np.ndarray | None
    left_out: tuple[str, ...] = ()


def _kind_of_bound(report: ReportData) -> str:
    """Return what the bounds bound."""
    return OF_MODES if report.time == "sampled" else WHOLE


def _has_estimate(report: ReportData, out: OutputReport) -> bool:
    """Return whether there is an estimate of all that the bound is of, or of more."""
    if out.estimate is None:
        return False
    return SCOPES.index(estimate_scope(out, report.scope)) <= SCOPES.index(widest_scope(report.scope))


def _bound_covers(report: ReportData, out: OutputReport) -> bool:
    """Return whether the bound is of all that the estimate is of, the whole error if there is no estimate."""
    if not _has_estimate(report, out):
        return True
    has_steps_alone = report.time == "sampled" and covers_time(out, report.time)
    return _same_scope(report, out) and not has_steps_alone


def _same_error(report: ReportData, out: OutputReport, row: int) -> SameError:
    """Return what is drawn together of a row: of the modes where the bound is of these alone.

    Of the whole error where a truth was compared that has other steps, where the bound takes forces as they are, or
    where no bound is finite.
    """
    bounds = {e: out.bound[e][:, row] for e in widest(report.scope) if e in out.bound}
    error = None if out.error is None else out.error[:, row]
    if not _has_estimate(report, out):
        return SameError(_kind_of_bound(report), bounds, None, None, error, _narrower(report))
    whole, half = out.estimate[:, row], out.uncertainty[:, row]
    if _bound_covers(report, out):
        kind = WHOLE if covers_time(out, report.time) else _kind_of_bound(report)
        return SameError(kind, bounds, whole, half, error, _narrower(report))
    if not any(np.isfinite(bound).any() for bound in bounds.values()):
        return SameError(WHOLE, {}, whole, half, error, ("no finite bound",))
    modes, half_of_modes = _of_modes(out, row)
    if _same_scope(report, out) and (error is None or largest(error - modes) < largest(error - whole)):
        return SameError(OF_MODES, bounds, modes, half_of_modes, error, _narrower(report))
    why = "of the modes alone" if _same_scope(report, out) else under(report.scope).removeprefix(", ")
    doubt = f", {NOT_CERTIFIED}" if out.uncertified else ""
    return SameError(WHOLE, {}, whole, half, error, (f"bound {why}{doubt}: not drawn",))


def _same_scope(report: ReportData, out: OutputReport) -> bool:
    return estimate_scope(out, report.scope) == widest_scope(report.scope)


def _narrower(report: ReportData) -> tuple[str, ...]:
    """Estimators whose bounds cover less than those of others."""
    names = [e for e in report.scope if e not in widest(report.scope)]
    return tuple(f"'{e}'{under(report.scope, e)}: not drawn" for e in names)


def _of_modes(out: OutputReport, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Estimate and half width of a row without time steps."""
    steps = out.estimate_parts.get("time step", np.zeros_like(out.estimate))
    halves = [x[:, row] for check, x in out.uncertainty_parts.items() if check not in BY_STEPS]
    return out.estimate[:, row] - steps[:, row], np.zeros(len(out.value)) + sum(halves)
