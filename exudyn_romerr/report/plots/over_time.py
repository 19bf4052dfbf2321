"""Pictures of a report over time: signal with its band, bounds, causes. Matplotlib is imported when one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...checks import check_count
from ...estimates.estimate import RESOLVED
from ..scope import NOT_CERTIFIED
from ..wording import (
    at_round_off,
    axis_label,
    error_kind,
    estimated_kind,
    estimated_under,
    is_known,
    rounded_up,
    under,
    with_unit,
)
from .readable_axes import OF_BOUND, OF_HALF_WIDTH, above, largest_in_words, limits_of_errors, limits_of_signal
from .style import (
    CAUSE_STYLES,
    COLOURS,
    MARKERS,
    STYLES,
    THIN,
    WIDE,
    finish,
    isolated,
    log_line,
    mark_edges,
    spread,
)

if TYPE_CHECKING:
    from ..data import OutputData, ReportData

RASTER_FROM = 5000  # instants: areas of more are pixels in PDF and SVG too, which have 10 MB and more otherwise
GAPS = (0, (4, 4))  # dashes of the estimate: a bound or true error that it lies on shows between them
BAR = 12  # points: how wide a band is at a single instant


def draw_signal(ax: Any, report: ReportData, name: str, row: int = 0) -> None:
    """Draw one row of an output with its band, value ± bound, and the corrected output with its own if there is one.

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
    bands = [((value - bound, value + bound), OF_BOUND)]
    if (best := _corrected(report, out, row)) is not None:
        corrected, half, within, name_of_line = best
        bands += [((corrected, corrected), OF_BOUND), ((corrected - half, corrected + half), OF_HALF_WIDTH)]
    limits, leaves = limits_of_signal(lines, bands)
    cut = [", cut off" * leaving for leaving in leaves]
    if is_bounded := bool(np.isfinite(bound).any()) or not _is_estimated(out):
        label = f"value ± bound{_of_what(report, out)}{under(report.scope, doubts=out.uncertified)}, "
        label += largest_in_words(bound, out.unit, "up to" if out.uncertified else "at most") + cut[0]
        _band(ax, t, value, bound, COLOURS["fast"], label)
    ax.plot(t, value, color=COLOURS["value"], marker=_dots(t), label="reduced model")
    if best is not None:
        below = not is_bounded or bool(np.max(half) > np.max(bound))  # the band of the bound, which it would hide
        style = {"zorder": 0.9, "alpha": 0.25} if below else {}
        _band(ax, t, corrected, half, COLOURS["auxiliary"], within + cut[2], **style)
        ax.plot(t, corrected, "--", color=COLOURS["auxiliary"], marker=_dots(t), label=name_of_line + cut[1])
    if out.error is not None:
        ax.plot(t, lines[1], ":", color=COLOURS["error"], marker=_dots(t), label="truth")
    if limits is not None:
        ax.set_ylim(*limits)
    shown = f"{error_kind(report.time)} bound{_doubt(out)}" if is_bounded else "estimate; no bound"
    title = f"{out.row_names[row]}: reduced model with its {shown}"
    ax.set(xlabel=_time(report), ylabel=axis_label(out.row_names[row], out.unit), title=title)
    finish(ax)


def draw_bounds(ax: Any, report: ReportData, name: str, row: int = 0) -> None:
    """Draw the bounds of one row of an output by all estimators, |estimate| and |true error| if known, semilog.

    The estimate has a band, its half width to both sides. Parameters and errors as in draw_signal.
    """
    out, t = _row_of(report, name, row), report.t
    bounds = {e: out.bound[e][:, row] for e in out.bound if e != "best"}
    error = None if out.error is None else _visible(np.abs(out.error[:, row]), out.value[:, row])
    size = None if out.estimate is None else np.abs(out.estimate[:, row])
    bands = {} if size is None else {"half width": size + out.uncertainty[:, row]}
    others = [x for x in (size, error) if x is not None]
    limits = limits_of_errors({**bounds, **bands}, others, float(np.max(np.abs(out.value[:, row]))))
    for place, e in enumerate(bounds):
        style = {"linestyle": STYLES[e], "marker": MARKERS[e], "every": spread(len(t), place)}
        label = f"bound '{e}'{_of_what(report, out)}{under(report.scope, e, out.uncertified)}"
        label += above(limits, bounds[e], out.unit)
        log_line(ax, t, bounds[e], color=COLOURS[e], linewidth=WIDE, label=label, markersize=5, **style)
    if out.estimate is not None:
        _estimate(ax, report, out, row, limits)
    if error is not None:
        style = {"color": COLOURS["error"], "linewidth": THIN, "marker": ".", "every": ()}
        log_line(ax, t, error, label="|true error|", **style)
    if at_round_off(out)[row]:
        label = "rounding of the input: nothing below is known"
        style = {"color": "#777777", "linestyle": ":", "linewidth": THIN, "marker": ".", "every": ()}
        log_line(ax, t, out.round_off[:, row], label=label, **style)
    title = f"{out.row_names[row]}: bounds{_doubt(out)}{'' if out.estimate is None else ' and estimate'} of its error"
    ylabel = axis_label(f"{estimated_kind(out, report.time)} of {out.row_names[row]}", out.unit)
    ax.set(xlabel=_time(report), ylabel=ylabel, yscale="log", title=title, ylim=limits)
    finish(ax)


def draw_causes(ax: Any, report: ReportData, name: str, row: int = 0) -> None:
    """Draw what the best bound of one row of an output comes from, in % of it, stacked over time.

    The legend has the shares at the worst instant, of causes that are not zero throughout. Where the bound is zero or
    infinite there are no shares: marks at the edges show it. Parameters and errors as in draw_signal.
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
    mark_edges(ax, t, best, COLOURS["value"])
    ax.axvline(
        t[worst], color=COLOURS["value"], linestyle="--", linewidth=THIN, label=_worst(report, out, row, worst)
    )
    kind = error_kind(report.time)
    title = f"{out.row_names[row]}: where its {kind} bound{_doubt(out)} comes from"
    ylabel = f"share of the\n{kind} bound / %"
    ax.set(xlabel=_time(report), ylabel=ylabel, ylim=(0, 100), title=title)
    ax.margins(x=0.01)
    finish(ax)


def _visible(error: np.ndarray, value: np.ndarray) -> np.ndarray:
    """|error| without what is rounding of the value: of a first instant, say, which would set the axis, 1e-25 m."""
    return np.where((error > 0) & (error < np.finfo(float).eps * np.max(np.abs(value))), np.nan, error)


def _corrected(report: ReportData, out: OutputData, row: int) -> tuple | None:
    """Best guess of the full model's output, half width, labels; the corrected output where that is proved."""
    if _is_estimated(out):
        half = out.uncertainty[:, row]
        within = f"half width{estimated_under(out, report.scope)}, {largest_in_words(half, out.unit, 'up to')}"
        line = f"value + estimate{_not_resolved(out, row)}"
        return out.value[:, row] + out.estimate[:, row], half, f"value + estimate ± {within}", line
    if out.corrected is None:
        return None
    bound = out.corrected_bound[:, row]
    by = "auxiliary" if "auxiliary" in report.scope else "best"  # coupled, "energy" knows a correction too
    most = largest_in_words(bound, out.unit, "up to" if out.uncertified else "at most")
    label = f"corrected ± its bound{under(report.scope, by, out.uncertified)}, {most}"
    return out.corrected[:, row], bound, label, "corrected output"


def _is_estimated(out: OutputData) -> bool:
    """Whether there is an estimate that no proof stands behind."""
    return out.estimate is not None and set(out.uncertainty_parts) != {"proved"}


def _estimate(ax: Any, report: ReportData, out: OutputData, row: int, limits: tuple | None) -> None:
    """|estimate| as a dashed line in a band, which ends where the smallest of them is: a logarithm has no zero."""
    size, half, t = np.abs(out.estimate[:, row]), out.uncertainty[:, row], report.t
    style = {"color": COLOURS["estimate"], "linestyle": GAPS, "linewidth": 1.5 * THIN, "marker": ".", "every": ()}
    style["zorder"] = 2.5  # above the other lines
    log_line(ax, t, size, label=f"|estimate|{estimated_under(out, report.scope)}{_not_resolved(out, row)}", **style)
    is_known = np.isfinite(half) & (size + half > 0)
    if is_known.any():
        high = np.where(is_known, size + half, 1.0)
        low = np.maximum(size - half, min(np.min(high[is_known]), np.min(size, where=size > 0, initial=np.inf)))
        style = {"facecolor": COLOURS["estimate"], "alpha": 0.25, "linewidth": 0}
        label = f"half width of the estimate{above(limits, half, out.unit)}"
        _fill(ax, t, np.where(is_known, low, 1.0), high, is_known, label=label, **style)


def _not_resolved(out: OutputData, row: int) -> str:
    """For a legend: that the estimate is no number to rely on."""
    if not is_known(out, row):
        return ""
    size, half, value = (float(np.max(np.abs(x[:, row]))) for x in (out.estimate, out.uncertainty, out.value))
    return " (not resolved)" if half > RESOLVED * size and half > value else ""


def _doubt(out: OutputData) -> str:
    """What a title says of bounds beside what they are of."""
    return f" ({NOT_CERTIFIED})" if out.uncertified else ""


def _of_what(report: ReportData, out: OutputData) -> str:
    """What a bound bounds, where the estimate beside it is of more."""
    kind = error_kind(report.time)
    return "" if kind == estimated_kind(out, report.time) else f" of the {kind}"


def _row_of(report: ReportData, name: str, row: int) -> OutputData:
    out = report.output(name)
    check_count(f"row of output {name!r}", row, out.value.shape[1] - 1, "its rows, from 0", least=0)
    return out


def _band(ax: Any, t: np.ndarray, middle: np.ndarray, bound: np.ndarray, colour: str, label: str, **more) -> None:
    """Middle ± bound; where it is infinite, marks at the upper edge instead."""
    known = np.isfinite(bound)
    low, high = (np.where(known, middle + sign * bound, middle) for sign in (-1, 1))
    _fill(ax, t, low, high, known, facecolor=colour, linewidth=0, label=label, **{"alpha": 0.6, **more})
    mark_edges(ax, t, np.where(known, 1.0, np.inf), colour)


def _fill(ax: Any, t: np.ndarray, low: np.ndarray, high: np.ndarray, known: np.ndarray, **style: Any) -> None:
    """An area over the runs of instants that are known; a bar where such a run is a single instant."""
    ax.fill_between(t, low, high, where=known, rasterized=len(t) > RASTER_FROM, **style)
    alone = isolated(known)
    if alone.size:
        opaque = {"colors": style["facecolor"], "alpha": style.get("alpha"), "zorder": style.get("zorder", 1)}
        ax.vlines(t[alone], low[alone], high[alone], linewidth=BAR, **opaque)


def _dots(t: np.ndarray) -> str | None:
    """A single instant has no line."""
    return "o" if len(t) == 1 else None


def _time(report: ReportData) -> str:
    return "load factor" if report.time == "static" else "t / s"


def _percent(share: float) -> str:
    if 0 < share < 0.5:
        return "< 1 %"
    return "> 99 %" if 99.5 <= share < 100 else f"{share:.0f} %"


def _worst(report: ReportData, out: OutputData, row: int, at: int) -> str:
    axis = "load factor" if report.time == "static" else "t"
    unit = "" if report.time == "static" else " s"
    bound = with_unit(rounded_up(out.bound["best"][at, row]), out.unit)
    return f"worst instant, {axis} = {report.t[at]:.4g}{unit}: {bound}"
