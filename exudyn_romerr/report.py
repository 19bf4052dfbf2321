"""BoundReport: the bounds of one run, printed, saved, loaded, compared with a truth and plotted."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError, check_array, check_choice, real_array
from .plan import Plan
from .scope import FROZEN, SCOPES

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable

CAUSES = {
    "basis": "basis: add modes",
    "time step": "step size, not the basis: halve it",
    "initial": "initial error: start from equilibrium, or add modes that hold the initial state",
    "jumps": "load jumps: add modes, or let the load grow over a short time",
}
SAMPLED = (
    "reduction error at sampled residuals; the error of the time integration is not covered, nor what the residual "
    "does between the samples"
)
DICTS = ("bound", "reduction_bound", "causes", "effectivity")  # fields of an output that are dicts of arrays
OPTIONAL = ("corrected", "corrected_bound", "error")  # fields that may be None
FORMAT = 2  # of the saved file; a file of another format is refused


@dataclass
class OutputReport:
    """One output along a run.

    value : (T, r) output of the reduced body. bound[e] : (T, r) bound of its error by estimator e, bound["best"]
    the smallest. reduction_bound[e] : the same for the residual at the samples only, which does not see the time
    integration. corrected (T, r) : the output with the known part of its error taken out, within corrected_bound of
    the truth; None without auxiliary modes. causes[cause] : (T, r), shares of bound["best"]. error (T, r) and
    effectivity[e] (r,) = max_t bound / max_t |error| once a truth was compared.
    """

    name: str
    unit: str
    of: str
    value: np.ndarray
    round_off: np.ndarray
    bound: dict[str, np.ndarray]
    reduction_bound: dict[str, np.ndarray]
    corrected: np.ndarray | None
    corrected_bound: np.ndarray | None
    causes: dict[str, np.ndarray]
    error: np.ndarray | None = None
    effectivity: dict[str, np.ndarray] = field(default_factory=dict)

    def verdict(self, time: str, scope: dict[str, str]) -> list[str]:
        """Return a line for each row: largest value, bound at the worst instant, the estimator that gave it."""
        return [self._row_verdict(row, time, scope) for row in range(self.value.shape[1])]

    def _row_verdict(self, row: int, time: str, scope: dict[str, str]) -> str:
        largest = np.max(np.abs(self.value[:, row]), initial=0.0)
        worst = np.max(self.bound["best"][:, row], initial=0.0)
        share = f" ({100 * worst / largest:.2g} %)" if largest > 0 and np.isfinite(worst) else ""
        best = min((e for e in self.bound if e != "best"), key=lambda e: np.max(self.bound[e][:, row]))
        name = f"{self.name}, row {row + 1}" if self.value.shape[1] > 1 else self.name
        kind = "reduction error" if time == "sampled" else "error"
        by = f"by '{best}', inputs frozen" if scope[best] == FROZEN else f"by '{best}'"
        return f"{name}: up to {largest:.4g} {self.unit}, {kind} at most {worst:.3g} {self.unit}{share}, {by}"

    def at_round_off(self) -> bool:
        """Whether the largest bound is below what rounding of the FE matrices alone does to the output."""
        return bool(np.max(self.bound["best"]) < np.max(self.round_off))

    def advice(self) -> str:
        """Return one line: the cause that dominates the bound at its worst instant, and what to do."""
        at = np.unravel_index(np.argmax(self.bound["best"]), self.value.shape)
        shares = {cause: share[at] for cause, share in self.causes.items()}
        total = sum(shares.values())
        if self.at_round_off():
            return f"at round-off: the FE matrices' own rounding moves it by {np.max(self.round_off):.1g} {self.unit}"
        if not 0 < total < np.inf:
            return "nothing to improve" if total == 0 else "no finite bound: ask for another estimator"
        cause = max(shares, key=shares.get)
        rest = np.max(self.bound["best"] - self.causes[cause])
        left = f"; the rest alone bounds it by {rest:.3g} {self.unit}" if rest > 0 else ""
        return f"{100 * shares[cause] / total:.0f} % of it from the {CAUSES[cause]}{left}"


@dataclass
class BoundReport:
    """The bounds of one run.

    t : (T,) instants in s. position_bound[e], velocity_bound[e] : (T,) bounds of |e|_M and |e'|_M.
    scope[e] : "complete" (loads and supports do not depend on the body's deformation), "coupled (linearised)" (they
    do, and the bound covers it to first order) or "inputs frozen" (they do; the bound holds for the full body under
    those of this simulation). time : "reconstructed",
    "sampled" or "static". messages : what the reader must know first.
    """

    t: np.ndarray
    position_bound: dict[str, np.ndarray]
    velocity_bound: dict[str, np.ndarray]
    outputs: dict[str, OutputReport]
    scope: dict[str, str]
    scope_reason: str
    reasons: dict[str, str]
    plan: Plan
    messages: list[str]
    time: str
    total_mass: float | None
    nodes: Callable[[], dict] | dict | None = field(default=None, repr=False)

    @property
    def node_bound(self) -> dict[str, np.ndarray]:
        """Bound of the displacement's error at every mesh node (nodes,), by every estimator, at its worst instant.

        Computed when first asked for, one solve with K for every coordinate; saved if it was asked for before.

        Raises
        ------
        InputError
            A body without node positions, or a loaded report that was saved without.
        """
        if callable(self.nodes):
            self.nodes = self.nodes()
        if self.nodes is None:
            raise InputError("node_bound was not saved with this report; ask for it before save()")
        return self.nodes

    def output(self, name: str) -> OutputReport:
        """Return the output of that name; InputError lists the known ones."""
        check_choice("output", name, self.outputs)
        return self.outputs[name]

    def reason(self, e: str) -> str:
        """Return in words what estimator e assumes, why its bound is inf where it is, and why it has its scope."""
        check_choice("estimator", e, self.reasons)
        widest = min(self.scope.values(), key=SCOPES.index)
        return "; ".join(filter(None, [self.reasons[e], self.scope_reason if self.scope[e] == widest else ""]))

    def compare(self, name: str, t: Any, y: Any) -> OutputReport:
        """Compare an output with a truth.

        Parameters
        ----------
        name : str
        t : (T,), y : (T,) or (T, r)
            The truth at least at every instant of the report (s, unit of the output).

        Returns
        -------
        OutputReport
            The output, now with `.error` = y - value and `.effectivity`.

        Raises
        ------
        InputError
            Unknown output, wrong shapes, or an instant of the report that t lacks.
        """
        out = self.output(name)
        t, y = check_array("t", t, (None,)), real_array("y", y)
        if not t.size:
            raise InputError("t is empty; give the truth at report.t")
        y = check_array("y", y[:, None] if y.ndim == 1 else y, (len(t), out.value.shape[1]))
        at = np.clip(np.searchsorted(t, self.t), 1, max(len(t) - 1, 1)) if len(t) > 1 else np.zeros(len(self.t), int)
        at = np.where(np.abs(t[at - 1] - self.t) < np.abs(t[at] - self.t), at - 1, at)
        gap = np.abs(t[at] - self.t)
        # solvers add up their steps: rounding of t grows to about 1e-12 of the span
        if gap.max() > 1e-9 * max(np.ptp(self.t), np.finfo(float).tiny):
            raise InputError(f"t lacks the report's instant {self.t[gap.argmax()]:.6g} s; give the truth at report.t")
        out.error = y[at] - out.value
        truth = np.max(np.abs(out.error), axis=0)
        out.effectivity = {e: _ratio(np.max(bound, axis=0), truth) for e, bound in out.bound.items()}
        return out

    def __str__(self) -> str:
        axis = "load factor" if self.time == "static" else "t / s"
        lines = [f"bounds at {len(self.t)} instants, {axis} = {self.t[0]:g} .. {self.t[-1]:g}"]
        lines += [f"! {message}" for message in self.messages]
        if self.time == "sampled":
            lines.append(f"! {SAMPLED}")
        for out in self.outputs.values():
            lines += [*out.verdict(self.time, self.scope), f"  {out.advice()}"]
            if out.corrected is not None:
                left = np.max(out.corrected_bound)
                lines.append(f"  the corrected output is within {left:.3g} {out.unit} of the full model")
            if out.effectivity:
                largest = np.max(np.abs(out.error))
                ratios = ", ".join(f"{e} {np.max(x):.3g}" for e, x in out.effectivity.items() if e != "best")
                lines.append(f"  true error up to {largest:.3g} {out.unit}; bound / error: {ratios}")
        return "\n".join(lines + self._estimator_lines())

    def _estimator_lines(self) -> list[str]:
        divisor = 1.0 if self.total_mass is None else np.sqrt(self.total_mass)
        what = "error in the mass norm" if self.total_mass is None else "mass-weighted RMS error of position"
        return [
            f"  {e:<13} scope {self.scope[e]}; {what} <= {np.max(bound) / divisor:.3g}; {self.reasons[e]}"
            for e, bound in self.position_bound.items()
        ] + ([f"  scope: {self.scope_reason}"] if self.scope_reason else [])

    def save(self, path: str | os.PathLike) -> None:
        """Write everything to one .npz file (no pickle; readable without Exudyn)."""
        arrays = {"t": self.t}
        arrays.update({f"position/{e}": x for e, x in self.position_bound.items()})
        arrays.update({f"velocity/{e}": x for e, x in self.velocity_bound.items()})
        if isinstance(self.nodes, dict):
            arrays.update({f"node/{e}": x for e, x in self.nodes.items()})
        for i, out in enumerate(self.outputs.values()):
            arrays[f"output/{i}/value"], arrays[f"output/{i}/round_off"] = out.value, out.round_off
            for kind in OPTIONAL:
                if getattr(out, kind) is not None:
                    arrays[f"output/{i}/{kind}"] = getattr(out, kind)
            for kind in DICTS:
                arrays.update({f"output/{i}/{kind}/{e}": x for e, x in getattr(out, kind).items()})
        with open(path, "wb") as file:
            np.savez_compressed(file, meta=np.array(json.dumps(self._meta())), **arrays)

    def _meta(self) -> dict:
        return {
            "format": FORMAT,
            "outputs": [(out.name, out.unit, out.of) for out in self.outputs.values()],
            "scope": self.scope,
            "scope_reason": self.scope_reason,
            "reasons": self.reasons,
            "plan": [self.plan.computed, self.plan.left_out],
            "messages": self.messages,
            "time": self.time,
            "total_mass": self.total_mass,
        }

    def plot(self, path: str | os.PathLike | None = None, outputs: list[str] | None = None) -> Any:
        """Draw signal with band, and bound (and true error) over time; save to path if given, return the figure."""
        from .plot import plot_report

        return plot_report(self, path, outputs)


def _ratio(bound: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Bound / truth; 1 where both are zero, inf where only the truth is."""
    both_zero = (bound == 0) & (truth == 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(both_zero, 1.0, bound / truth)


def outputs_of(reports: Iterable[BoundReport]) -> dict[str, OutputReport]:
    """Return the outputs of all reports by name; InputError if two monitors have one of the same name."""
    found: dict[str, OutputReport] = {}
    for report in reports:
        for name, out in report.outputs.items():
            if name in found:
                raise InputError(
                    f"output {name!r} is in two monitors; give outputs of different bodies different names"
                )
            found[name] = out
    return found
