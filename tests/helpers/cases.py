"""A case: model, basis, load and initial state, solved exactly in full and reduced form at the same samples."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la

from exudyn_romerr import Basis, ElasticBody, Output, Trajectory, evaluate, gramian_basis, krylov_basis, modal_basis
from tests.helpers.bodies import Model
from tests.helpers.loads import Load
from tests.helpers.truth import linear_inputs, state_form

BASES = ("modal", "krylov", "gramian", "random", "petrov-static", "petrov-random")
INITIALS = ("rest", "span", "state", "equilibrium")
SAMPLING = 0.06  # rad: step times the fastest rate of the reduced model; halving it changes bounds by < 1 %


@dataclass(frozen=True)
class Case:
    """B (N, p), coarse times t, load, initial state of the full model ("rest": zero) and rows C (r, N)."""

    model: Model
    basis: Basis
    B: np.ndarray
    t: np.ndarray
    load: Load
    initial: str
    q0: np.ndarray
    q0_t: np.ndarray
    C: np.ndarray

    @cached_property
    def samples(self):
        """Coarse samples and the middles between them: every second one is coarse."""
        fine = np.empty(2 * len(self.t) - 1)
        fine[::2], fine[1::2] = self.t, (self.t[:-1] + self.t[1:]) / 2
        return fine

    @cached_property
    def reduced_start(self):
        """Reduced initial coordinates by (31)-(32); static equilibrium of the reduced model for "equilibrium"."""
        V, W, M, K = self.basis.V, self.basis.W, self.model.M, self.model.K
        if self.initial == "equilibrium":
            return la.solve(W.T @ K @ V, W.T @ (K @ self.q0)), np.zeros(V.shape[1])
        return la.solve(W.T @ V, W.T @ self.q0), la.solve(W.T @ M @ V, W.T @ M @ self.q0_t)

    @cached_property
    def full(self):
        m = self.model
        return self._solve(state_form(m.M, m.D, m.K, self.B), self.q0, self.q0_t)

    @cached_property
    def reduced(self):
        m, V, W = self.model, self.basis.V, self.basis.W
        form = state_form(*(W.T @ A @ V for A in (m.M, m.D, m.K)), W.T @ self.B)
        return self._solve(form, *self.reduced_start)

    def _solve(self, form, q0, q0_t):
        """States (3, T, n) at the samples; a jump inside a step is one more knot of the exact solution."""
        knots = np.unique(self.samples if self.load.jump is None else np.append(self.samples, self.load.jump))
        motion = form.propagate(np.diff(knots), linear_inputs(*self.load.sides(knots)), q0, q0_t)
        at = np.searchsorted(knots, self.samples)
        return np.array([motion.q[at], motion.q_t[at], motion.q_tt[at]])

    @cached_property
    def errors(self):
        """E and e' at the samples, each (T, N)."""
        return self.full[0] - self.reduced[0] @ self.basis.V.T, self.full[1] - self.reduced[1] @ self.basis.V.T

    @property
    def outputs(self):
        return Output("y", self.C, unit="m"), Output("v", self.C, unit="m", of="velocity")

    def report(self, stride=1, **options):
        """Evaluate every stride-th sample: 1 fine, 2 coarse."""
        t = self.samples[::stride]
        u = np.array([self.load(time) for time in t])
        traj = Trajectory(t, *(x[::stride] for x in self.reduced), u)
        jumps = {} if self.load.jump is None else {"jumps": [self.load.jump], "input_function": self.load}
        common = {"inputs": self.B, "outputs": self.outputs, "initial": self.initial_argument, "time": "sampled"}
        return evaluate(self.model.body, self.basis, traj, **{**common, **jumps, **options})

    @property
    def initial_argument(self):
        return {"state": (self.q0, self.q0_t), "equilibrium": "equilibrium"}.get(self.initial)


def make_basis(kind, model, B, n, rng):
    """Return one of BASES with n columns."""
    M, K, (omega, _) = model.M, model.K, model.modes
    if kind == "modal":
        return modal_basis(model.body, n)
    if kind == "krylov":
        shifts = ((0.0,), (omega[0],), (0.0, 2 * omega[0]))[rng.integers(0, 3)]
        return krylov_basis(model.body, B, n, shifts=shifts)
    if kind == "gramian":
        # an undamped body's Gramian is infinite in resonance: take that of a damped twin
        damped = ElasticBody(M, K, rayleigh=(0.02 * omega[0], 0.0)) if model.rayleigh == (0.0, 0.0) else model.body
        return gramian_basis(damped, B, n, band=(0.0, 1.1 * omega[n]))
    V = np.linalg.qr(rng.standard_normal((model.N, n)))[0]
    if kind == "petrov-static":
        V = krylov_basis(model.body, B, n).V if model.N > n + 4 else V
        return Basis(V, la.solve(K, M @ V))  # with Rayleigh damping the reduced matrices stay symmetric, definite
    return Basis(V) if kind == "random" else Basis(V, V + 0.15 * rng.standard_normal(V.shape))


def reduced_rates(model, basis):
    """Eigenvalues of the reduced model, 1/s."""
    V, W = basis.V, basis.W
    M, D, K = (W.T @ A @ V for A in (model.M, model.D, model.K))
    n = len(M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-la.solve(M, K), -la.solve(M, D)]])
    return la.eigvals(A)
