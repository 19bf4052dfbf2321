"""What rounding leaves open in the bounds: of the numbers that the input came in, and of computing with 16 digits."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from ...model.body import ElasticBody
from ...model.matrix_checks import DOUBLE
from ..residual.problem import Problem
from ..residual.samples import Samples


class Rounded(NamedTuple):
    """What rounding may move at S instants: position and velocity (S,) in the M-norm, outputs (S, R)."""

    position: np.ndarray
    velocity: np.ndarray
    outputs: np.ndarray


class RoundOff:
    """How far reduced motion and full body may be off if every number they follow from is off by its eps, relative.

        r = eps_K max(sum_j |qr_j| | |K| |V_j| |_{K^-1} , x) + eps_M sum_j |qr_j''| | |M| |V_j| |_{K^-1}
            + eps_D sum_j |qr_j'| | |D| |V_j| |_{K^-1} + eps_B sum_i |u_i| | |B_i| |_{K^-1}

    x = max(sum_i |u_i| | |K| |K^-1 B_i| |_{K^-1} , | |K| |q0| |_{K^-1}) is of the full body's own motion, which the
    reduced one may lack: the equilibrium that it starts in, under the inputs u then, and may ring in from then on, or
    that of a load step; or its initial state. Else x = 0.

    |e'|_M <= r, |e|_M <= r / omega_1, |C e| <= |C|_{K^-1} r + (eps_C + eps_q) |C V| |qr|; of velocities
    |C e'| <= |C|_{M^-1} r + ... |C V| |qr'|. What is off at an instant, not what it adds up to over many periods. The
    terms of M, D and B are left out where these have 16 digits: they are 1e-16 of the response itself.

    Parameters
    ----------
    problem : Problem
    eps : dict
        Relative spacing of the numbers of "mass", "stiffness", "damping", "inputs", "samples", and (R,) of "outputs".

    Notes
    -----
    Source: docs/theory.md 10. Does not cover: where K is so close to singular that its rounding changes K^-1 itself;
    rounding of a given initial state.
    """

    def __init__(self, problem: Problem, eps: dict[str, Any]):
        self.per_mass = 1 / problem.body.modes(1).omega[0]
        self.eps_K = eps["stiffness"]
        body, V = problem.body, np.abs(problem.V)
        norm, KV = body.stiffness_factor.half_solve, abs(body.K) @ V
        # of a unit of every input (p,)
        self.of_responses = cache(lambda: self._of_motion(body, body.stiffness_factor.solve(problem.B)))
        self.of_start = 0.0
        if problem.initial_state is not None:
            self.of_start = float(self._of_motion(body, problem.initial_state[0][:, None])[0])
        self.of_K, self.of_balance = np.linalg.norm(norm(KV), axis=0), self.eps_K * np.abs(problem.W).T @ KV
        others = (
            ("q_tt", eps["mass"], lambda: abs(body.M) @ V),
            ("q_t", eps["damping"], lambda: abs(body.D) @ V),
            ("u", eps["inputs"], lambda: abs(problem.B)),
        )
        self.others = [(x, e, np.linalg.norm(norm(make()), axis=0)) for x, e, make in others if e > DOUBLE]
        self.rows = problem.rows
        self.value_rows = (eps["samples"] + eps["outputs"])[:, None] * np.abs(problem.rows.C @ problem.V)

    def of_equilibrium(self, u: np.ndarray) -> np.ndarray:
        """Return | |K| |x| |_{K^-1} (S,) of the full body's equilibria x under inputs u (S, p)."""
        return np.abs(u) @ self.of_responses()

    def _of_motion(self, body: ElasticBody, X: np.ndarray) -> np.ndarray:
        """| |K| |x| |_{K^-1} of every column x of X."""
        return np.linalg.norm(body.stiffness_factor.half_solve(abs(body.K) @ np.abs(X)), axis=0)

    def __call__(self, at: Samples, own: float | np.ndarray) -> Rounded:
        """Return it at samples; own: x, one for all or (S,)."""
        q, q_t = np.abs(at.q), np.abs(at.q_t)
        r = self.eps_K * np.maximum(q @ self.of_K, own)
        for name, eps, sizes in self.others:
            r += eps * (np.abs(getattr(at, name)) @ sizes)
        values = np.where(self.rows.velocity_rows, q_t @ self.value_rows.T, q @ self.value_rows.T)
        return Rounded(r * self.per_mass, r, self.rows.share(r, r) + values)

    def in_balance(self, q: np.ndarray) -> float:
        """Return what rounding leaves of W^T R = 0 at most, in any mode, at samples q (S, n)."""
        return float(np.max(np.abs(q) @ self.of_balance.T))


def of_input(problem: Problem, samples: float) -> tuple[dict[str, Any], list[str]]:
    """Return the relative spacing of all that came in, and the names of what came with fewer than 16 digits."""
    eps = {**problem.body.precision, "inputs": problem.precision, "samples": samples}
    eps["outputs"] = np.array(problem.rows_precision)
    return eps, [name for name, x in eps.items() if np.max(x, initial=0.0) > DOUBLE]
