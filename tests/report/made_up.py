"""Reports made up to be drawn, and what is to be seen of a picture."""

from copy import deepcopy

import numpy as np

from exudyn_romerr.report.data import NodeFields, Plan
from exudyn_romerr.report.plots.style import picture
from exudyn_romerr.report.report import BoundReport, OutputReport

ZERO = "zero"  # marks at the lower edge of a logarithmic axis


def made_up(best=None, t=None, truth=True, corrected=True, time="reconstructed", rows=1, labels=(), **nodes):
    """A report whose numbers are easily told apart; best: (T,) bound of its first row."""
    t = np.linspace(0, 1, 5 if best is None else len(best)) if t is None else np.asarray(t, dtype=float)
    best = np.linspace(1, 2, len(t)) if best is None else np.asarray(best, dtype=float)
    best = np.column_stack([best * (1 + row) for row in range(rows)])
    value, zero = np.full_like(best, 10.0) + t[:, None], np.zeros_like(best)
    with np.errstate(invalid="ignore"):
        shares = {"basis": 0.25 * best, "time step": 0.75 * best}
    shares = {cause: np.where(np.isfinite(x), x, 0.0) for cause, x in shares.items()} | {
        "initial": zero,
        "jumps": zero,
    }
    bound = {"energy": 3 * best, "auxiliary": best, "best": best}
    known = {"corrected": value + 0.5, "corrected_bound": zero + 0.1} if corrected else {}
    known = {"corrected": None, "corrected_bound": None} | known
    error = np.full_like(best, -0.5) if truth else None
    out = OutputReport("tip", "mm", "displacement", value, zero, bound, bound, causes=shares, error=error, **known)
    out.labels = labels
    norms = {e: best[:, 0] for e in ("energy", "auxiliary")}
    scope = dict.fromkeys(norms, "complete")
    head = {"scope_reason": "", "reasons": dict.fromkeys(norms, ""), "plan": Plan((), ()), "messages": []}
    return BoundReport(
        t,
        norms,
        norms,
        {"tip": out},
        scope,
        **head,
        time=time,
        total_mass=1.0,
        nodes=NodeFields(nodes) if nodes else None,
    )


def axes_of(draw, *arguments, **options):
    """Axes with one picture, drawn to the last artist: warnings are errors."""
    figure = picture(draw, None, *arguments, **options)
    figure.draw_without_rendering()
    return figure.axes[0]


def legend(ax):
    """Labels, however many lines they take."""
    return [" ".join(text.get_text().split("\n")) for text in ax.get_legend().get_texts()]


def line(ax, label):
    """The (x, y) of the line with this label."""
    (found,) = [found for found in ax.lines if found.get_label() == label]
    return found.get_data()


def edge(ax, words):
    """Where the marks at an edge are, for each curve that has some."""
    return [np.flatnonzero(~np.isnan(mark.get_ydata())) for mark in ax.lines if mark.get_gid() == words]


def area(ax, label):
    """Lowest and highest y of a filled area, by its label."""
    (found,) = [found for found in ax.collections if found.get_label().startswith(label)]
    y = np.concatenate([path.vertices[:, 1] for path in found.get_paths()])
    return y.min(), y.max()


def with_estimate(report, half, checks=("steps",)):
    """Estimate 0.25 t less 0.1 of the first output; its half width."""
    out = report.output("tip")
    out.estimate = np.column_stack([0.25 * report.t - 0.1] * out.value.shape[1])
    out.uncertainty = np.full_like(out.value, half)
    out.estimate_parts = {"basis": out.estimate}
    out.uncertainty_parts = dict.fromkeys(checks, out.uncertainty / len(checks))
    return report


def several(count, rows):
    """A report of outputs "out 0", "out 1" ...; the last row of each and the last output have the largest bounds."""
    report = made_up(rows=rows, labels="xyz"[:rows] if rows > 1 else ())
    outputs = [deepcopy(report.output("tip")) for _ in range(count)]
    for number, out in enumerate(outputs):
        out.name = f"out {number}"
        out.bound = {e: (1 + number) * x for e, x in out.bound.items()}
    report.outputs = {out.name: out for out in outputs}
    return report


def notes(figure):
    """The lines below all panels: every space and end of line the same."""
    return " ".join(figure.get_supxlabel().split())


def drawn(figure):
    """What panels show, by their titles."""
    return list(dict.fromkeys(ax.get_title().split(":")[0] for ax in figure.axes))
