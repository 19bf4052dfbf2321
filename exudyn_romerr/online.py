"""Run and StaticRun: bounds of one solve, fed with blocks of accepted steps; small arrays only."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

from .errors import InputError, RunError, check_finite
from .estimators.base import Block, Bounds, Start
from .reconstruct import Jump, linear_segments, make_jumps
from .report import BoundReport, OutputReport

if TYPE_CHECKING:
    from .offline import Offline

GALERKIN_DEFECT = 1e-6  # of the largest term: above it a load was missed, or the solver's tolerance is coarse


class Run:
    """The bounds along one dynamic solve."""

    def __init__(self, offline: Offline):
        self.offline = offline
        self.messages: list[str] = []
        self.defect = 0.0
        self._estimators = {name: copy.copy(e) for name, e in offline.estimators.items()}
        self._t: list[np.ndarray] = []
        self._values: list[np.ndarray] = []
        self._bounds: dict[str, list[Bounds]] = {name: [] for name in self._estimators}
        self._jumps = self._make_jumps()
        self._last: tuple | None = None  # t, z, u of the last sample

    def start(self, t: float, q, q_t, q_tt, u=None, after: Run | None = None) -> None:
        """Take the first sample: q, q_t, q_tt (n,), u (p,) unless the input function is known.

        after: a run whose last state this one starts in; its bounds go on.
        """
        times, states = self._checked(np.array([t]), *(np.asarray(x)[None] for x in (q, q_t, q_tt)))
        u = self._inputs(times, None if u is None else np.asarray(u)[None])
        z = self.offline.coordinates(*states, u)
        if after is None:
            begin = self._start(t, z[0], *(x[0] for x in states[:2]), u[0])
            bounds = {name: e.start(begin) for name, e in self._estimators.items()}
        else:
            self._estimators = {name: copy.copy(e) for name, e in after._estimators.items()}
            bounds = {name: _last_instant(chunks[-1]) for name, chunks in after._bounds.items()}
            self.messages.append(f"continues the run before from t = {t:g} s")
        self._record(times, states, bounds)
        self._last = (float(t), z[0], u[0])

    def extend(self, t, q, q_t, q_tt, u=None) -> None:
        """Take further accepted steps: t (S,), q, q_t, q_tt (S, n), u (S, p) unless the input function is known."""
        if self._last is None:
            raise RunError("extend was called before start; give the first sample to start")
        times, states = self._checked(np.asarray(t, dtype=float), q, q_t, q_tt)
        if not times.size:
            return
        u = self._inputs(times, u)
        z = self.offline.coordinates(*states, u)
        before = self._last
        knots = (np.append(before[0], times), np.vstack([before[1], z]), np.vstack([before[2], u]))
        segments = linear_segments(*knots, self._jumps)
        block = Block(segments.t, segments.h, segments.c)
        bounds = {name: _at(e.advance(block), segments.step_end) for name, e in self._estimators.items()}
        self._record(times, states, bounds)
        self._measure_defect(z)
        self._last = (float(times[-1]), z[-1], u[-1])

    def best_now(self) -> dict[str, np.ndarray]:
        """Return the smallest bound of each output (r,) at the last step given."""
        best = np.min([chunks[-1].outputs[-1] for chunks in self._bounds.values()], axis=0)
        return {out.name: best[part] for out, part in zip(self.offline.outputs, self.offline.slices, strict=True)}

    def report(self) -> BoundReport:
        """Return what was bounded so far; RunError before the first sample."""
        if self._last is None:
            raise RunError("report was asked before the first sample of the run")
        bounds = {name: _joined(chunks) for name, chunks in self._bounds.items()}
        values = np.vstack(self._values)
        return BoundReport(
            t=np.concatenate(self._t),
            position_bound={name: b.position for name, b in bounds.items()},
            velocity_bound={name: b.velocity for name, b in bounds.items()},
            outputs=self._output_reports(values, bounds),
            scope=dict.fromkeys(bounds, "complete"),
            reasons={name: self._reason(name, b) for name, b in bounds.items()},
            plan=self.offline.plan,
            messages=self._all_messages(),
            time=self.offline.time,
            total_mass=self.offline.total_mass,
        )

    def _output_reports(self, values, bounds) -> dict[str, OutputReport]:
        reports = {}
        for out, part in zip(self.offline.outputs, self.offline.slices, strict=True):
            by_estimator = {name: b.outputs[:, part] for name, b in bounds.items()}
            best = np.min(list(by_estimator.values()), axis=0)
            bound = {**by_estimator, "best": best}
            reports[out.name] = OutputReport(out.name, out.unit, out.of, values[:, part], bound, dict(bound))
        return reports

    def _reason(self, name: str, bounds: Bounds) -> str:
        assumes = f"assumes {self._estimators[name].assumes}"
        if np.isfinite(bounds.position).all():
            return assumes
        t = np.concatenate(self._t)[np.argmin(np.isfinite(bounds.position))]
        return f"{assumes}; inf from t = {t:g} s: the norm of the residual could not be computed (cancellation)"

    def _all_messages(self) -> list[str]:
        if self.defect <= GALERKIN_DEFECT:
            return list(self.messages)
        return [
            f"Galerkin defect {self.defect:.1e} of the largest term (expected below {GALERKIN_DEFECT:g}): a load on "
            "the body is missing in inputs, or the solver's tolerance is coarse; the bound holds for the inputs given",
            *self.messages,
        ]

    def _checked(self, t: np.ndarray, *states) -> tuple[np.ndarray, list[np.ndarray]]:
        n = self.offline.coordinates.n
        states = [np.asarray(x, dtype=float) for x in states]
        if t.ndim != 1 or any(x.shape != (len(t), n) for x in states):
            raise InputError(f"trajectory arrays have shapes {[x.shape for x in states]}; needed: ({len(t)}, {n})")
        for name, x in zip(("t", "q", "q_t", "q_tt"), (t, *states), strict=True):
            check_finite(name, x)
        before = -np.inf if self._last is None else self._last[0]
        steps = np.diff(t, prepend=before)
        if np.any(steps <= 0):
            at = int(np.argmax(steps <= 0))
            raise InputError(f"t does not increase at entry {at}: {t[at]:.9g} s after {([before, *t])[at]:.9g} s")
        return t, states

    def _inputs(self, t: np.ndarray, u) -> np.ndarray:
        if self.offline.signal is not None and u is None:
            return self.offline.signal(t)
        p = self.offline.coordinates.p
        u = np.asarray(u, dtype=float)
        if u.shape != (len(t), p):
            raise InputError(f"u has shape {u.shape}; needed: ({len(t)}, {p})")
        check_finite("u", u)
        return u

    def _start(self, t, z, q, q_t, u) -> Start:
        layout = self.offline.coordinates
        if self.offline.initial is None:
            return Start(float(t), z)
        if self.offline.initial == "equilibrium":
            y0, y0_t = -layout(q, 0 * q, 0 * q, u), np.zeros(layout.k)
        else:
            y0, y0_t = np.zeros((2, layout.k + 2))
            y0[layout.stiffness_slot] = -q
            y0[layout.k], y0_t[layout.k + 1] = 1.0, 1.0
        y0_t[layout.mass_slot] = -q_t
        return Start(float(t), z, y0, y0_t)

    def _make_jumps(self) -> list[Jump]:
        layout = self.offline.coordinates

        def response(du: np.ndarray) -> np.ndarray:
            dz = np.zeros(layout.k)
            dz[layout.mass_slot], dz[layout.input_slot] = self.offline.jump_response @ du, du
            return dz

        return make_jumps(self.offline.jumps, self.offline.signal.at, response) if self.offline.jumps else []

    def _measure_defect(self, z: np.ndarray) -> None:
        rows = self.offline.galerkin
        terms = np.max(np.abs(z) @ np.abs(rows).T)
        if terms > 0:
            self.defect = max(self.defect, float(np.max(np.abs(z @ rows.T)) / terms))

    def _record(self, t, states, bounds: dict[str, Bounds]) -> None:
        rows = self.offline.value_rows.T
        self._t.append(t)
        self._values.append(np.where(self.offline.velocity_rows, states[1] @ rows, states[0] @ rows))
        for name, b in bounds.items():
            self._bounds[name].append(b)


class StaticRun(Run):
    """The error along one static solve: K e = -R at every load step, hence exact, C e = -C K^-1 R.

    t is the load factor. q_t and q_tt are ignored; dynamic estimators are left out.
    """

    def __init__(self, offline: Offline):
        super().__init__(offline)
        self._estimators = {"static": offline.static()}
        self._bounds = {"static": []}

    def start(self, t: float, q, q_t=None, q_tt=None, u=None) -> None:
        """Take the first load step: q (n,)."""
        zero = np.zeros_like(np.asarray(q, dtype=float))
        times, states = self._checked(np.array([t], dtype=float), *(np.asarray(x)[None] for x in (q, zero, zero)))
        self._take(times, states, None if u is None else np.asarray(u)[None])

    def extend(self, t, q, q_t=None, q_tt=None, u=None) -> None:
        """Take further load steps: t (S,), q (S, n)."""
        zero = np.zeros_like(np.asarray(q, dtype=float))
        self._take(*self._checked(np.asarray(t, dtype=float), q, zero, zero), u)

    def _take(self, t, states, u) -> None:
        if not t.size:
            return
        u = self._inputs(t, u)
        z = self.offline.coordinates(*states, u)
        self._record(t, states, {"static": self._estimators["static"](z)})
        self._last = (float(t[-1]), z[-1], u[-1])


def _at(bounds: Bounds, index: np.ndarray) -> Bounds:
    return Bounds(bounds.position[index], bounds.velocity[index], bounds.outputs[index])


def _last_instant(bounds: Bounds) -> Bounds:
    return _at(bounds, np.array([-1]))


def _joined(chunks: list[Bounds]) -> Bounds:
    return Bounds(
        np.concatenate([b.position for b in chunks]),
        np.concatenate([b.velocity for b in chunks]),
        np.vstack([b.outputs for b in chunks]),
    )
