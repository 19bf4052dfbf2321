"""From the bounds of a run to its report: the best bound, the corrected output, the causes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..estimators import Auxiliary
from ..report.formats.provenance import made_here
from ..report.report import BoundReport, OutputReport
from ..report.scope import COUPLED, FROZEN, with_doubts
from ..residual.interface_stiffening import interface_share
from ..trajectory.bounds import seen_in, unbounded
from ..trajectory.estimate import Estimate, estimated
from .run_messages import planned_end, run_messages, stopped_at

if TYPE_CHECKING:
    from ..model.global_axes import View
    from ..model.outputs import Output
    from ..offline.prepared import Offline
    from ..report.scope import Scene
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
        scope={name: scene.scope_of(name) for name in total},
        scope_reason=with_doubts(scene.reason, run.doubts),
        reasons={name: _reason(name, text, t, total[name], offline) for name, text in run.assumptions.items()},
        plan=offline.plan,
        messages=run_messages(run),
        time=run.time,
        total_mass=offline.total_mass,
        nodes=run.nodes,
        remainder=run.remainder,
        made=made_here(),
        planned_end=planned_end(run),
        uncertified=run.doubts,
    )


def internal_reports(run: RunRecord) -> dict[str, OutputReport]:
    """Return the outputs beside those that were asked for."""
    return _output_reports(run, is_requested=False)


def _output_reports(run: RunRecord, is_requested: bool) -> dict[str, OutputReport]:
    """Return the outputs that were asked for, or (is_requested=False) the internal ones beside them."""
    offline, found, widest = run.offline, {}, run.offline.scene.widest(run.streams["total"])
    for i, (out, part, view) in enumerate(zip(offline.outputs, offline.slices, offline.views, strict=True)):
        if out.is_requested == is_requested:
            rows = _Seen(run.values[:, part], run.round_off[:, part], _rows_of(run.streams, part))
            seen = rows if view is None else _turned(view, rows, run)
            share = _interface_share(run, part, view)
            known = _estimate(run, i, seen.streams, share)
            if run.estimate is not None:  # static parts lack the inertia that sets what a mechanism's modes leave
                share = known.estimate.interface_share(share)
            if view is not None and offline.scene.coupled:
                seen = seen.of_a_moving_frame(offline.scene, _in_global_axes(run, i))
            found[out.name] = _output_report(run, out, seen, widest, share, known)
    return found


class _Seen(NamedTuple):
    """One output as it is shown: values (T, r), what rounding may move them by, stream -> estimator -> bounds."""

    values: np.ndarray
    round_off: np.ndarray
    streams: dict[str, dict[str, Bounds]]

    def of_a_moving_frame(self, scene: Scene, known: tuple[np.ndarray, np.ndarray]) -> _Seen:
        """Return the same with bounds of scope coupled by a known error (T, r), of which so much is left (T, r).

        Only vectors that react with the mechanism know how the frame moves.
        """
        error, left = known

        def seen(name: str, b: Bounds) -> Bounds:
            if scene.scope_of(name) != COUPLED:
                return b
            if name != Auxiliary.name or np.isinf(left).all():
                return unbounded(b)
            bound = np.abs(error) + left
            return replace(b, outputs=bound, jumped=None, correction=error, correction_bound=left)

        streams = {stream: {e: seen(e, b) for e, b in bounds.items()} for stream, bounds in self.streams.items()}
        return self._replace(streams=streams)


def _in_global_axes(run: RunRecord, i: int) -> tuple[np.ndarray, np.ndarray]:
    """What is known of the error (T, r) of output i in global axes of a mechanism, and a bound of the rest."""
    part = run.offline.shown_slices[i]
    none = np.zeros((len(run.t), part.stop - part.start))
    if run.estimate is None or not run.left.size:
        return none, none + np.inf
    parts = run.estimate.of_rows(part).parts
    error, left = parts["basis"] + parts["interfaces"], none + np.inf
    left[: len(run.left)] = run.left[:, part]
    return error, left


class _Known(NamedTuple):
    """An estimate, and what it covers, as bounds have it: see OutputReport.estimate_scope."""

    estimate: Estimate | None
    scope: str


def _estimate(
    run: RunRecord, i: int, streams: dict[str, dict[str, Bounds]], interfaces: np.ndarray | float
) -> _Known:
    """Return what is known of the error of output i: by the mechanism, else by the estimator that leaves least."""
    scene = run.offline.scene
    if run.estimate is not None:
        return _Known(run.estimate.of_rows(run.offline.shown_slices[i]), COUPLED)
    # in a mechanism that does not answer: under frozen inputs
    names = list(streams["total"]) if scene.coupled else scene.widest(streams["total"])
    known = _sharpest(streams["total"], names)
    if known is None:
        return _Known(None, "")
    return _Known(estimated(streams, known, interfaces), FROZEN if scene.coupled else scene.scope_of(known))


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
    """An output in global axes; the total error holds where the frame really is."""
    (values, round_off, streams), frames, driven, offline = rows, run.frames, run.driven_frames, run.offline
    turned = {name: {e: seen_in(view, b, frames) for e, b in bounds.items()} for name, bounds in streams.items()}
    if offline.driven is not None:
        shift = view.shift_between(values, frames, driven, offline.scene.pose)
        turned["total"] = {e: seen_in(view, b, driven, shift) for e, b in streams["total"].items()}
    spread = np.einsum("srk,sk->sr", np.abs(view.matrices(frames)), round_off)
    return _Seen(view.values(values, frames, offline.scene.pose), spread, turned)


def _output_report(
    run: RunRecord,
    out: Output,
    seen: _Seen,
    widest: list[str],
    interfaces: np.ndarray | float,
    found: _Known,
) -> OutputReport:
    value, round_off, streams = seen
    bound, estimate = _with_best(streams["total"], widest), found.estimate
    known = _sharpest(streams["total"], widest)
    return OutputReport(
        name=out.name,
        unit=out.unit,
        quantity=out.quantity,
        of=out.of,
        value=value,
        round_off=round_off,
        bound=bound,
        reduction_bound=_with_best(streams["reduction"], widest),
        corrected=None if known is None else value + streams["total"][known].correction,
        corrected_bound=None if known is None else streams["total"][known].correction_bound,
        causes=_causes(bound["best"], streams, widest, interfaces),
        estimate=None if estimate is None else estimate.total,
        estimate_parts={} if estimate is None else estimate.parts,
        uncertainty=None if estimate is None else estimate.uncertainty,
        uncertainty_parts={} if estimate is None else estimate.half_widths,
        estimate_scope=found.scope,
        labels=out.labels,
        tolerance=run.tolerances.get(out.name),
        stopped=stopped_at(run),
        beside_steps=run.beside_steps,
        uncertified=run.doubts,
    )


def _with_best(bounds: dict[str, Bounds], widest: list[str]) -> dict[str, np.ndarray]:
    outputs = {name: b.outputs for name, b in bounds.items()}
    return {**outputs, "best": np.min([outputs[name] for name in widest], axis=0)}


def _sharpest(bounds: dict[str, Bounds], widest: list[str]) -> str | None:
    """Return the estimator that leaves least of an output's error unknown; None if none knows any of it."""
    known = [name for name in widest if bounds[name].correction is not None]
    return min(known, key=lambda name: np.max(bounds[name].correction_bound), default=None)


def _causes(
    best: np.ndarray, streams: dict[str, dict[str, Bounds]], widest: list[str], interfaces: np.ndarray | float = 0.0
) -> dict[str, np.ndarray]:
    """Shares of the best bound by cause, each (T, r), with sum `best`.

    The bound of the initial error alone, the share of load jumps, what the sampled residual adds to these (the basis)
    and what the reconstruction adds to that (the time step), scaled to the sum. interfaces : their share (r,) in what
    the basis makes.
    """
    reduction = _with_best(streams["reduction"], widest)["best"]
    initial = _with_best(streams["initial"], widest)["best"] if "initial" in streams else np.zeros_like(best)
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
    if offline.scene.coupled and offline.scene.scope_of(name) == FROZEN:
        text += f"; {offline.scene.frozen}"
    if (finite := np.isfinite(bounds.position)).all():
        return text
    why = "the residual's square cancelled below zero"
    if offline.scene.turns:
        why = (
            f"the frame turns faster than the body's lowest frequency in it ({offline.omega_1:.4g} rad/s), or the "
            "bound grew beyond all numbers"
        )
    return f"{text}; inf from t = {t[np.argmin(finite)]:g} s: {why}"
