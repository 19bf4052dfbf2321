"""Outputs and reports made by hand: two instants, zero at the first, so that every number is known."""

import numpy as np

from exudyn_romerr.report.causes import ESTIMATE_PARTS
from exudyn_romerr.report.data import Plan
from exudyn_romerr.report.report import BoundReport, OutputReport
from exudyn_romerr.report.scope import COMPLETE, COUPLED


def output(value, bounds, scope, round_off=0.0, shares=(0.25, 0.75, 0.0, 0.0), of="displacement", **known):
    """One row, two instants, and the scope of its estimators."""
    bound = {e: np.array([[0.0], [x]]) for e, x in bounds.items()}
    widest = [bound[e] for e in bounds if scope[e] == (COUPLED if COUPLED in scope.values() else scope[e])]
    best = np.min(widest, axis=0)
    parts = zip(("basis", "time step", "initial", "jumps"), shares, strict=True)
    causes = {name: np.where(np.isfinite(best), best, 0.0) * share for name, share in parts}
    if not np.isfinite(best).all():
        causes["basis"] = best
    value, off = np.array([[0.0], [-value]]), np.full((2, 1), round_off)
    return OutputReport("tip z", "m", of, value, off, {**bound, "best": best}, {}, None, None, causes, **known)


def estimated(value, bound, parts, half=None, covers=COMPLETE, estimate_scope="", **options):
    """The same with an estimate that is zero at the first instant, and its scope."""
    out = output(value, {"auxiliary": bound}, {"auxiliary": covers}, **options)
    out.estimate_parts = {cause: np.array([[0.0], [parts.get(cause, 0.0)]]) for cause in ESTIMATE_PARTS}
    out.uncertainty_parts = {check: np.array([[0.0], [x]]) for check, x in (half or {"proved": 0.0}).items()}
    out.estimate, out.uncertainty = (sum(found.values()) for found in (out.estimate_parts, out.uncertainty_parts))
    out.estimate_scope = estimate_scope
    return out, {"auxiliary": covers}


def corrected(value, bound, known, left, **options):
    """An output whose error is `known` within `left`, by a bound of scope complete."""
    out, scope = estimated(value, bound, {"basis": known}, {"proved": left}, **options)
    out.corrected, out.corrected_bound = out.value + out.estimate, out.uncertainty
    return out, scope


def with_rows(out, factors, labels):
    """The same output with a row for each factor."""
    for name in ("value", "round_off", "estimate", "uncertainty"):
        setattr(out, name, getattr(out, name) * np.array(factors))
    for fields in (out.bound, out.causes, out.estimate_parts, out.uncertainty_parts):
        fields.update({key: x * np.array(factors) for key, x in fields.items()})
    out.labels = labels
    return out


def report_of(made, time="reconstructed", reason="", **options):
    """A report of one output made as above."""
    out, scope = made
    plan, t = Plan((), ()), np.array([0.0, 1.0])
    reasons = dict.fromkeys(scope, "assumes nothing")
    return BoundReport(t, {}, {}, {out.name: out}, scope, reason, reasons, plan, [], time, None, **options)
