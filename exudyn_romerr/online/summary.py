"""From the bounds of a run to its report: the best bound, the corrected output, the causes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..report.formats.provenance import made_here
from ..report.report import BoundReport, OutputReport
from ..report.scope import with_doubts
from ..residual.interface_stiffening import interface_share
from ..trajectory.bounds import seen_in
from ..trajectory.estimate import estimated
from .run_messages import planned_end, run_messages, stopped_at

if TYPE_CHECKING:
    from ..model.outputs import Output, View
    from ..offline.prepared import Offline
    from ..trajectory.bounds import Bounds
    from .run_record import RunRecord


def assemble(run: RunRecord) -> BoundReport:
    """Return the report of what the run has bounded so far."""
    offline, t, total, scene = run.offline, run.t, run.streams["total"], run.offline.scene
    return BoundReport(
        t=t,
        position_bound={name: b.position for name, b in total.items()},
        velocity_bound={name: b.velocity for name, b in total.items()},
        outputs=_output_reports(run, is_requested=True),
        scope=dict.fromkeys(total, scene.scope),
        scope_reason=with_doubts(scene.reason, run.doubts),
        reasons={name: _reason(name, text, t, total[name], offline) for name, text in run.assumptions.items()},
        plan=offline.plan,
        messages=run_messages(run),
        time=run.time,
        total_mass=offline.total_mass,
        nodes=run.nodes,
        made=made_here(),
        planned_end=planned_end(run),
        uncertified=run.doubts,
    )


def internal_reports(run: RunRecord) -> dict[str, OutputReport]:
    """Return the outputs beside those that were asked for."""
    return _output_reports(run, is_requested=False)


def _output_reports(run: RunRecord, is_requested: bool) -> dict[str, OutputReport]:
    """Return the outputs that were asked for, or (is_requested=False) the internal ones beside them."""
    offline, found = run.offline, {}
    for out, part, view in zip(offline.outputs, offline.slices, offline.views, strict=True):
        if out.is_requested == is_requested:
            rows = _Seen(run.values[:, part], run.round_off[:, part], _rows_of(run.streams, part))
            seen = rows if view is None else _turned(view, rows, run)
            share = _interface_share(run, part, view)
            found[out.name] = _output_report(run, out, seen, share)
    return found


class _Seen(NamedTuple):
    """One output as it is shown: values (T, r), what rounding may move them by, stream -> estimator -> bounds."""

    values: np.ndarray
    round_off: np.ndarray
    streams: dict[str, dict[str, Bounds]]


def _interface_share(run: RunRecord, part: slice, view: View | None) -> np.ndarray | float:
    """Return the share (r,) of rigid interfaces in the error of the basis: that in its static part."""
    if run.offline.static_errors is None:
        return 0.0
    errors = run.static_errors[:, :, part]
    if view is not None:
        errors = np.einsum("srk,sek->ser", view.matrices(run.frames), errors)
    return interface_share(errors)


def _rows_of(streams: dict[str, dict[str, Bounds]], part: slice) -> dict[str, dict[str, Bounds]]:
    """The bounds of one output's rows."""
    return {stream: {name: b.of_rows(part) for name, b in bounds.items()} for stream, bounds in streams.items()}


def _turned(view: View, rows: _Seen, run: RunRecord) -> _Seen:
    """An output in global axes."""
    (values, round_off, streams), frames = rows, run.frames
    turned = {name: {e: seen_in(view, b, frames) for e, b in bounds.items()} for name, bounds in streams.items()}
    spread = np.einsum("srk,sk->sr", np.abs(view.matrices(frames)), round_off)
    return _Seen(view.values(values, frames, run.offline.scene.pose), spread, turned)


def _output_report(
    run: RunRecord,
    out: Output,
    seen: _Seen,
    interfaces: np.ndarray | float,
) -> OutputReport:
    value, round_off, streams = seen
    bound, known = _with_best(streams["total"]), _sharpest(streams["total"])
    estimate = None if known is None else estimated(streams, known, interfaces)
    return OutputReport(
        name=out.name,
        unit=out.unit,
        quantity=out.quantity,
        of=out.of,
        value=value,
        round_off=round_off,
        bound=bound,
        reduction_bound=_with_best(streams["reduction"]),
        corrected=None if known is None else value + streams["total"][known].correction,
        corrected_bound=None if known is None else streams["total"][known].correction_bound,
        causes=_causes(bound["best"], streams, interfaces),
        estimate=None if estimate is None else estimate.total,
        estimate_parts={} if estimate is None else estimate.parts,
        uncertainty=None if estimate is None else estimate.uncertainty,
        uncertainty_parts={} if estimate is None else estimate.half_widths,
        estimate_scope="" if estimate is None else run.offline.scene.scope,
        labels=out.labels,
        tolerance=run.tolerances.get(out.name),
        stopped=stopped_at(run),
        beside_steps=run.beside_steps,
        uncertified=run.doubts,
    )


def _with_best(bounds: dict[str, Bounds]) -> dict[str, np.ndarray]:
    outputs = {name: b.outputs for name, b in bounds.items()}
    return {**outputs, "best": np.min([*outputs.values()], axis=0)}


def _sharpest(bounds: dict[str, Bounds]) -> str | None:
    """Return the estimator that leaves least of an output's error unknown; None if none knows any of it."""
    known = [name for name, b in bounds.items() if b.correction is not None]
    return min(known, key=lambda name: np.max(bounds[name].correction_bound), default=None)


def _causes(
    best: np.ndarray, streams: dict[str, dict[str, Bounds]], interfaces: np.ndarray | float = 0.0
) -> dict[str, np.ndarray]:
    """Shares of the best bound by cause, each (T, r), with sum `best`.

    The bound of the initial error alone, the share of load jumps, what the sampled residual adds to these (the basis)
    and what the reconstruction adds to that (the time step), scaled to the sum. interfaces : their share (r,) in what
    the basis makes.
    """
    reduction = _with_best(streams["reduction"])["best"]
    initial = _with_best(streams["initial"])["best"] if "initial" in streams else np.zeros_like(best)
    jumped = [b.jumped for b in streams["total"].values() if b.jumped is not None]
    jumps = np.min(jumped, axis=0) if jumped else np.zeros_like(best)
    # a part may be inf where its sum is not: the square of an expanded residual that cancelled at a sample
    reduction, initial, jumps = (np.minimum(part, best) for part in (reduction, initial, jumps))  # new arrays
    with np.errstate(invalid="ignore"):  # inf - inf: sorted out below
        weights = {
            "basis": (1 - interfaces) * np.maximum(reduction - initial - jumps, 0.0),
            "interfaces": interfaces * np.maximum(reduction - initial - jumps, 0.0),
            "time step": np.maximum(best - reduction, 0.0),
            "initial": initial,
            "jumps": jumps,
        }
        total = sum(weights.values())
        scale = np.where(total > 0, best / np.where(total > 0, total, 1.0), 0.0)
        for share in weights.values():  # in place: in long runs each of these arrays is large
            share *= scale
    # an infinite bound has no shares: all of it is put down to the basis
    for name, share in weights.items():
        share[~np.isfinite(best)] = np.inf if name == "basis" else 0.0
    return {name: share if share.any() else np.broadcast_to(0.0, share.shape) for name, share in weights.items()}


def _reason(name: str, assumes: str, t: np.ndarray, bounds: Bounds, offline: Offline) -> str:
    text = f"assumes {assumes}"
    if (finite := np.isfinite(bounds.position)).all():
        return text
    why = "the residual's square cancelled below zero"
    if offline.scene.turns:
        why = (
            f"the frame turns faster than the body's lowest frequency in it ({offline.omega_1:.4g} rad/s), or the "
            "bound grew beyond all numbers"
        )
    return f"{text}; inf from t = {t[np.argmin(finite)]:g} s: {why}"
