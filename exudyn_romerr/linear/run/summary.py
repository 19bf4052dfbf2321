"""From the bounds of a run to its report: the best bound, the corrected output, causes, messages at its head."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...report.causes import ESTIMATE_PARTS
from ...report.data import made_here
from ...report.report import BoundReport, OutputReport
from ...report.scope import with_doubts
from ...report.wording import NO_OUTPUTS
from ..estimators.bounds import Bounds, of_output
from ..residual.interface_stiffening import interface_share
from ..residual.reconstruction import ROUNDING_SHARE
from .prepare import Offline
from .record import RunRecord

RESOLVED = 1e-6  # of the largest input: below it what lies between the nodes does not matter
FROM_SAMPLES = "motion of the frame, loads and wrenches are those at the samples, and linear between them"

FEW_DIGITS = (
    "came in fewer than 16 digits: bounds are those of the numbers as they are; what their rounding alone may move "
    "is report.output(name).round_off"
)


def assemble(run: RunRecord) -> BoundReport:
    """Return the report of what the run has bounded so far."""
    offline, t, total, doubts = run.offline, run.times, run.streams()["total"], run.doubts()
    return BoundReport(
        t=t,
        position_bound={name: b.position for name, b in total.items()},
        velocity_bound={name: b.velocity for name, b in total.items()},
        outputs=output_reports(run, is_requested=True),
        scope=dict.fromkeys(total, offline.scene.scope),
        scope_reason=with_doubts(offline.scene.reason, doubts),
        reasons={name: _reason(name, text, t, total[name], offline) for name, text in run.assumptions().items()},
        plan=offline.plan,
        messages=_messages(run),
        time=run.time,
        total_mass=offline.total_mass,
        nodes=run.node_fields,
        made=made_here(),
        planned_end=run.planned_end,
        uncertified=doubts,
    )


def output_reports(run: RunRecord, is_requested: bool) -> dict[str, OutputReport]:
    """Return the outputs that were asked for, or (is_requested=False) the internal ones beside them."""
    frames, bounds, found = run.kept("frames"), run.streams(), {}
    for out, part, view in run.offline.shown:
        if out.is_requested != is_requested:
            continue
        streams = {s: {e: of_output(b, part, view, frames) for e, b in of.items()} for s, of in bounds.items()}
        value, round_off = run.kept("values")[:, part], run.kept("round_off")[:, part]
        static = None if run.offline.static_errors is None else run.kept("static")[:, :, part]
        if view is not None:
            H = view.matrices(frames)
            round_off = np.einsum("srk,sk->sr", np.abs(H), round_off)
            static = None if static is None else np.einsum("srk,sek->ser", H, static)
            value = view.values(value, frames, run.offline.scene.pose)
        total, interfaces = streams["total"], 0.0 if static is None else interface_share(static)
        bound = _with_best(total)
        found[out.name] = OutputReport(
            name=out.name,
            unit=out.unit,
            quantity=out.quantity,
            of=out.of,
            value=value,
            round_off=round_off,
            bound=bound,
            reduction_bound=_with_best(streams["reduction"]),
            causes=_causes(bound["best"], streams, interfaces),
            labels=out.labels,
            tolerance=run.tolerances.get(out.name),
            stopped=run.stopped,
            beside_steps=run.beside_steps,
            uncertified=run.doubts(),
            **_estimated(value, streams, interfaces, run.offline.scene.scope),
        )
    return found


def _estimated(
    value: np.ndarray, streams: dict[str, dict[str, Bounds]], interfaces: np.ndarray | float, scope: str
) -> dict[str, Any]:
    """What is known of an output's error, by the estimator that leaves least of it unknown.

    What that leaves is bounded, which is the half width, under what the scope says. interfaces : their share (r,) in
    what the basis makes, that of static errors. The part follows the whole in time: static errors lack the
    frequencies that free interfaces lower, 60 to 80 % off where a bar rings.
    """
    known = [name for name, b in streams["total"].items() if b.correction is not None]
    if not known:
        return {"corrected": None, "corrected_bound": None}
    name = min(known, key=lambda name: np.max(streams["total"][name].correction_bound))
    total, left = streams["total"][name].correction, streams["total"][name].correction_bound
    none = np.broadcast_to(0.0, total.shape)  # takes no memory
    reduction = streams["reduction"][name].correction
    initial = streams["initial"][name].correction if "initial" in streams else None
    initial = none if initial is None else initial
    basis = reduction - initial
    of_basis = ((1 - interfaces) * basis, interfaces * basis) if np.any(interfaces) else (basis, none)
    parts = dict(zip(ESTIMATE_PARTS, (*of_basis, total - reduction, initial, none), strict=True))
    return {
        "corrected": value + total,
        "corrected_bound": left,
        "estimate": sum(parts.values()),
        "estimate_parts": parts,
        "uncertainty": left,
        "uncertainty_parts": {"proved": left},
        "estimate_scope": scope,
    }


def _with_best(bounds: dict[str, Bounds]) -> dict[str, np.ndarray]:
    outputs = {name: b.outputs for name, b in bounds.items()}
    return {**outputs, "best": np.min([*outputs.values()], axis=0)}


def _causes(
    best: np.ndarray, streams: dict[str, dict[str, Bounds]], interfaces: np.ndarray | float
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


def _messages(run: RunRecord) -> list[str]:
    """Return the messages of a run, the gravest first."""
    offline, is_dynamic, end, few_digits = run.offline, run.time != "static", run.planned_end, run.offline.single
    found = [
        is_dynamic and len(run.times) == 1 and "only the first instant was bounded",
        *(doubt for doubt in run.doubts() if doubt not in run.messages),
        not any(out.is_requested for out in offline.outputs) and NO_OUTPUTS,
        *dict.fromkeys(run.messages),
        *(offline.notes if is_dynamic else ()),
        end is not None and f"the run ends at t = {run.times[-1]:g} s; the solver was to go to {end:g} s",
        is_dynamic and _between_samples(run),
        few_digits and f"{', '.join(few_digits)} {FEW_DIGITS}",
    ]
    return list(filter(None, found))


def _between_samples(run: RunRecord) -> str:
    offline = run.offline
    if offline.scene.pose is not None and offline.signal is None:
        return FROM_SAMPLES
    if run.quintic is None:
        return ""
    if run.quintic.rounding_share > ROUNDING_SHARE:
        share = f"{min(100 * run.quintic.rounding_share, 100):.0f} %"
        return f"steps so short that rounding makes about {share} of the bound: longer steps are better"
    if offline.signal is None and offline.coordinates.p:
        return "inputs taken as linear between samples: pass input_function to cover what lies between"
    if run.quintic.largest_miss > RESOLVED:
        return (
            f"the inputs change within single steps: up to {run.quintic.largest_miss:.1e} of their largest value is "
            "not followed by the reconstruction (estimated, and added to the bounds): give jump times as jumps=, "
            "or take smaller steps"
        )
    return ""
