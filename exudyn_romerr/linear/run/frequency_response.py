"""frequency_response: the reduced response to harmonic loads, an estimate of its error, and a bound.

A reduced response V q to loads B exp(i w t) leaves R = L z, and A e = -R with A = K + i w D - w^2 M (theory.md 12).
Modes of the full body answer to the residual, and the rest is bounded.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...basis.basis import Basis
from ...checks import check_array, check_type, real_array
from ...errors import AssumptionError, InputError
from ...linalg.eigenmodes import count_below
from ...model.body import ElasticBody
from ...model.outputs import Output
from ...process.blas_threads import one_thread
from ...report.wording import axis_label, digits, percent, rounded_up, with_unit
from ..estimators.round_off import RoundOff, of_input
from ..residual.modal_split import AUTO_WITHOUT_OUTPUTS, LARGEST_CAP, above
from ..residual.problem import BoundOptions, Problem

ABOVE = 2.0  # times the highest frequency: what modes that ring there or below answer is known with its phase
RINGING = "the reduced body is in resonance: it has no response"
ROUNDED = 8  # times: what sums of some hundred terms are off by, as in "auxiliary"
RESONANCE = "resonance: the frequency is an eigenfrequency of the undamped body, to the digits that this is known in"
TOO_HIGH = "the undamped body has eigenfrequencies there that are not among the {} modes that are computed"


@dataclass(frozen=True)
class FrequencyResponse:
    """The response of an output to unit harmonic loads, its error as estimated, and a bound of that error.

    Attributes
    ----------
    frequencies : ndarray, (F,)
        In rad/s.
    value : ndarray of complex, (F, r, p)
        Of the reduced body: row i of the output under column j of the input. inf where it is in resonance.
    estimate : ndarray of complex, (F, r, p)
        About what the full body's response has beside value: value + estimate is the corrected response.
    bound : ndarray, (F, r, p)
        |full - value| is at most that; inf where nothing is proved.
    reasons : tuple of str, (F,)
        Why the bound is inf; "" where it is finite.
    output : Output
    """

    frequencies: np.ndarray
    value: np.ndarray
    estimate: np.ndarray
    bound: np.ndarray
    reasons: tuple[str, ...]
    output: Output

    def __str__(self) -> str:
        hertz = self.frequencies / (2 * np.pi)
        lines = [f"unit loads, frequencies: {len(hertz)}, {digits(min(hertz), 4)} to {digits(max(hertz), 4)} Hz"]
        lines += [self._line(*pair, hertz) for pair in product(*map(range, self.value.shape[1:]))]
        for why in dict.fromkeys(filter(None, self.reasons)):
            at = [k for k, reason in enumerate(self.reasons) if reason == why]
            lines.append(f"no bound at {len(at)} of them, such as {digits(hertz[at[0]], 6)} Hz: {why}")
        return "\n".join(lines)

    def _line(self, row: int, column: int, hertz: np.ndarray) -> str:
        size, about, bound = (np.abs(x[:, row, column]) for x in (self.value, self.estimate, self.bound))
        name, known = self._name(row, column), np.flatnonzero(np.isfinite(bound))
        if not known.size:
            return f"{name}: no bound"
        k, unit = known[np.argmax(bound[known])], self.output.unit
        largest = np.max(size[known])
        share = percent(bound[k] / largest) if largest > 0 else ""
        most = with_unit(rounded_up(bound[k], 2), unit) + (f" ({share})" if share else "")
        there = f"about {with_unit(digits(about[k], 2), unit)} there, at {digits(hertz[k], 4)} Hz"
        return f"{name}: up to {with_unit(digits(largest), unit)}, error at most {most}, {there}"

    def _name(self, row: int, column: int) -> str:
        labels = self.output.labels or tuple(f"row {i + 1}" for i in range(self.value.shape[1]))
        of = f" {labels[row]}" if self.value.shape[1] > 1 else ""
        return f"{self.output.name}{of}" + (f", load {column + 1}" if self.value.shape[2] > 1 else "")

    def plot(self, path: str | os.PathLike | None = None, row: int = 0, column: int = 0) -> Any:
        """Draw sizes of response, estimated error and bound; save to path if given, return the figure.

        Parameters
        ----------
        path : .png, .svg or .pdf
        row, column : int
            Of output and input.
        """
        from ...report.plots.style import picture

        return picture(self._draw, path, row, column)

    def _draw(self, ax: Any, row: int, column: int) -> None:
        from ...report.plots.style import COLOURS, WIDE, finish, log_line

        order = np.argsort(self.frequencies)
        hertz = self.frequencies[order] / (2 * np.pi)
        size, about, bound = (np.abs(x[order, row, column]) for x in (self.value, self.estimate, self.bound))
        wide = hertz[0] > 0 and hertz[-1] > 10 * hertz[0]
        ax.set(yscale="log", xscale="log" if wide else "linear", xlabel="frequency / Hz")
        ax.set_ylabel(axis_label(f"size of {self._name(row, column)}", self.output.unit))
        log_line(ax, hertz, size, color=COLOURS["value"], label="reduced response")
        log_line(ax, hertz, bound, color=COLOURS["auxiliary"], linewidth=WIDE, label="its error: bound")
        log_line(ax, hertz, about, color=COLOURS["estimate"], linestyle="--", label="its error: estimate")
        count = int(np.sum(~np.isfinite(bound)))
        notes = [f"no bound at {count} frequencies"] if count else []
        finish(ax, f"{self._name(row, column)}: response to unit loads", notes)


@one_thread()
def frequency_response(
    body: ElasticBody, basis: Basis, input: Any, output: Output, frequencies: Any
) -> FrequencyResponse:
    """Return the reduced body's response to harmonic loads, an estimate of its error and a bound of that.

        |C (K + i w D - w^2 M)^-1 B - C V q(w)| <= bound

    Full-size work is done once, for all frequencies: static responses to the columns of the residual, and modes of
    the full body up to twice the highest frequency, at least 20, at most 200.

    Parameters
    ----------
    input : ndarray, (N, p) or (N,)
        Input matrix B; every column is a load of unit size.
    output : Output
        In the body's axes; of="velocity": i w times the displacement.
    frequencies : float or sequence of float, (F,)
        w in rad/s, zero or above: 2 pi times Hz. What is printed and drawn is in Hz.

    Returns
    -------
    FrequencyResponse
        Bounds are inf, with the reason, at eigenfrequencies of an undamped body, and above the 200th mode of one.

    Raises
    ------
    InputError
        Shapes, nan or inf, frequencies below zero, an output in global axes.
    AssumptionError
        A damping matrix.

    Notes
    -----
    Source: docs/theory.md 12. Does not cover: bodies in moving frames, damping matrices, structural damping.
    """
    check_type("body", body, ElasticBody)
    check_type("output", output, Output)
    if output.frame == "global":
        raise InputError(f"output {output.name!r} is in global axes; needed: frame='body', the body is held")
    w = check_array("frequencies", np.atleast_1d(real_array("frequencies", frequencies)), (None,))
    if not w.size or np.any(w < 0):
        found = f"has {w.min():g}" if w.size else "is empty"
        raise InputError(f"frequencies {found}; needed: at least one, none below zero, in rad/s")
    if body.proportional is None:
        raise AssumptionError(
            "frequency_response needs Rayleigh damping, ratios by mode or none; found a damping matrix, bounds of "
            "which are too large to tell anything. Compare with a basis of more columns"
        )
    modes = _mode_count(body, w.max())
    problem = Problem(body, basis, BoundOptions(inputs=input, outputs=[output], auxiliary_modes=modes))
    q, ringing = _reduced(problem, w)
    F, p, n = q.shape
    u = np.broadcast_to(np.eye(p), (F, p, p)).reshape(F * p, p)
    q, at = q.reshape(F * p, n), np.repeat(w, p)
    iw = 1j * at[:, None]
    motion = SimpleNamespace(q=q, q_t=iw * q, q_tt=iw**2 * q, u=u)
    rounding = RoundOff(problem, of_input(problem, 0.0)[0])
    r = ROUNDED * rounding(motion, rounding.of_equilibrium(u)).velocity
    errors, left, why = ProportionalDamping(problem)(at, problem.map.coordinates(q, iw * q, iw**2 * q, u), r)
    reasons = np.where(ringing, RINGING, why.reshape(F, p)[:, 0])
    slack = np.where(np.repeat(reasons == "", p)[:, None], left + np.abs(q) @ rounding.value_rows.T, np.inf)
    factor = iw if output.of == "velocity" else np.ones_like(iw)  # a velocity is i w times a displacement

    def shaped(x: np.ndarray, factor: np.ndarray) -> np.ndarray:
        known = np.isfinite(x) & ~np.repeat(ringing, p)[:, None]
        x = np.where(known, factor * np.where(known, x, 0), np.inf)
        return x.reshape(F, p, -1).transpose(0, 2, 1)

    value = shaped(q @ (problem.rows.C @ problem.V).T, factor)
    bound = shaped(np.abs(errors) + slack, np.abs(factor))
    return FrequencyResponse(w, value, shaped(errors, factor), bound, tuple(reasons.tolist()), output)


def _mode_count(body: ElasticBody, highest: float) -> int:
    """Modes up to ABOVE times the highest frequency (rad/s), as far as they may be."""
    least = max(AUTO_WITHOUT_OUTPUTS, body.modal.count if body.modal else 0)
    found = count_below(body.M, body.K, ABOVE * highest) if highest else 0
    return min(max(min(found, LARGEST_CAP), least), body.free.size)


def _reduced(problem: Problem, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reduced responses q (F, p, n) to all inputs, and where there is none, in resonance (F,): q is then zero."""
    body, V, W = problem.body, problem.V, problem.W
    M, K, B = W.T @ (body.M @ V), W.T @ (body.K @ V), np.asarray(W.T @ problem.B)
    D = np.zeros_like(M) if body.D is None else W.T @ (body.D @ V)
    q = np.array([_solved(K + 1j * x * D - x**2 * M, B.astype(complex)).T for x in w.tolist()])
    ringing = ~np.isfinite(q).all(axis=(1, 2))
    return np.where(ringing[:, None, None], 0.0, q), ringing


def _solved(stiffness: np.ndarray, forces: np.ndarray) -> np.ndarray:
    try:
        return np.linalg.solve(stiffness, forces)
    except np.linalg.LinAlgError:
        return np.full(forces.shape, np.inf, dtype=complex)


class ProportionalDamping:
    """Rayleigh's or modal damping: m modes P answer one by one, the rest above them is static but for a gain g.

        C e = C P eta - C K^-1 R_rest/(1 + i w beta) + rest,   |rest| <= |C|_rest g(w) |R_rest|_{K^-1}

    What computed modes lack of being eigenvectors, and rounding, are bounded and added.
    """

    def __init__(self, problem: Problem):
        body, split, modes = problem.body, problem.split, problem.split.modes
        rest, k = above(problem.rows, modes), problem.map.coordinates.k
        self.omega, self.cut = modes.omega, modes.cut
        self.damping, self.rayleigh = 2 * body.damping_ratios(modes.omega) * modes.omega, body.proportional
        self.PL, self.CP = split.PL, rest.C @ modes.P
        self.static_rows = rest.Y_C_K.T @ problem.dual.Y_K[:, :k]
        self.norm, self.C_rest, self.C_K = split.norm_K, rest.C_K, problem.rows.C_K
        rounded = body.stiffness_factor.half_solve(abs(body.K) @ np.abs(modes.P))
        eps = ROUNDED * body.precision["stiffness"]
        self.inexact = modes.residual + eps * np.linalg.norm(rounded, axis=0) / modes.omega

    def __call__(self, w: np.ndarray, z: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return errors of displacements at w (S,) in rad/s: what is known, of what is not at most, each (S, R).

        And why that is inf, "" where it is not (S,). z (S, k) complex; r (S,): |R|_{K^-1} that rounding may hide.
        """
        kappa = 1 + 1j * w * self.rayleigh[1]
        of_K = np.abs(kappa)
        with np.errstate(divide="ignore", invalid="ignore"):  # resonances
            stiffness = self.omega**2 - w[:, None] ** 2 + 1j * w[:, None] * self.damping
            eta = -(z @ self.PL.T) / stiffness
            known = eta @ self.CP.T - (z / kappa[:, None]) @ self.static_rows.T
            amplified = self.omega**2 / np.abs(stiffness)
            gain = self.gain(w)
            rest = 1 / of_K + gain
            largest = np.maximum(rest, amplified.max(axis=1))
            left = np.hypot(self.norm(z.real), self.norm(z.imag))
            # E = K P - M P Omega^2 makes every mode, and the rest, feel of_K * inexact * |e|_K beside R
            coupled = of_K[:, None] * self.inexact * amplified
            kept = 1 - np.hypot(np.linalg.norm(coupled, axis=1), rest * of_K * np.linalg.norm(self.inexact))
            whole = (np.hypot(np.linalg.norm(eta * self.omega, axis=1), rest * left) + largest * r) / kept
            slack = np.outer(gain * left + rest * of_K * np.linalg.norm(self.inexact) * whole, self.C_rest)
            slack += (whole[:, None] * coupled / self.omega) @ np.abs(self.CP).T + np.outer(largest * r, self.C_K)
        high, resonant = ~np.isfinite(gain), ~(kept > 0)
        reasons = np.where(high, TOO_HIGH.format(len(self.omega)), np.where(resonant, RESONANCE, ""))
        known[reasons == RESONANCE] = np.inf
        return known, np.where((reasons == "")[:, None], slack, np.inf), reasons

    def gain(self, w: np.ndarray) -> np.ndarray:
        """Return max |1/kappa - 1/(kappa - (w^2 - i w alpha) s)| over all s = 1/omega^2 <= 1/cut^2, (S,).

        kappa = 1 + i w beta. With (w^2 - i w alpha) s/kappa = exp(i theta)/y it is 1/|kappa (y - exp(i theta))|.
        """
        alpha, beta = self.rayleigh
        kappa = 1 + 1j * w * beta
        c = (w**2 - 1j * w * alpha) / kappa
        theta = np.angle(c)
        with np.errstate(divide="ignore"):
            y = np.maximum(self.cut**2 / np.abs(c), np.cos(theta))
            return 1 / (np.abs(kappa) * np.hypot(y - np.cos(theta), np.sin(theta)))
