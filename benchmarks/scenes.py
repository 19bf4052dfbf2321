"""Seeded scenes of sweep.py: body, basis, load, damping, initial state, steps, integrator, and the exact solution.

Bodies, bases and truth are those of tests/helpers; tests/ also holds a small selection of these scenes.
"""

import sys
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import scipy.linalg as la

import exudyn_romerr as romerr
from models import solid_bar
from tests.helpers.bodies import DAMPINGS, RAYLEIGH, Model, model, pencil
from tests.helpers.cases import make_basis, reduced_rates
from tests.helpers.mbs_scenes import SOLVERS, Recorder, new_mbs, settings
from tests.helpers.total_truth import LOADS, Exact, Signal

BODIES = {"chain": 0.25, "pencil": 0.25, "tiny": 0.08, "wide": 0.1, "beam": 0.15, "linkage": 0.12, "solid": 0.05}
BASES = ("modal", "krylov", "gramian", "random", "petrov-static", "petrov-random", "full")
INTEGRATORS = ("alpha 0.5", "alpha 0.9", "alpha 1.0", "trapezoidal", "DOPRI5", "exact samples", "disturbed samples")
INITIALS = ("rest", "span", "state", "equilibrium")
TOO_STIFF = 1000.0  # fastest reduced rate times the span: more takes an explicit integrator too long
GROWTH = 2.0  # exponent: a reduced Petrov-Galerkin model need not be stable
DISTURBED = 1e-3  # of the largest q, q', q'': any trajectory may be bounded


@dataclass(frozen=True)
class Choice:
    """Names of everything a scene is made of."""

    seed: int
    body: str
    damping: str
    basis: str
    load: str
    initial: str
    integrator: str

    def __str__(self):
        return " ".join(map(str, vars(self).values()))


def choice(seed):
    """Draw a combination; without load the motion comes from an initial state."""
    rng = np.random.default_rng([seed, 17])
    body = str(rng.choice(list(BODIES), p=list(BODIES.values())))
    damping = str(rng.choice(DAMPINGS[:-2] if body == "solid" else DAMPINGS))
    basis = str(rng.choice(BASES[:3] if body == "solid" else BASES))
    load = str(rng.choice(list(LOADS)))
    initial = str(rng.choice(INITIALS, p=[0.5, 0.1, 0.2, 0.2]))
    initial = "state" if load == "none" else initial
    return Choice(seed, body, damping, basis, load, initial, str(rng.choice(INTEGRATORS)))


@dataclass(frozen=True)
class Scene:
    """Model, basis, B (N, p), load u, full initial state, nominal step h, span T, rows C (2, N), keywords."""

    pick: Choice
    model: Model
    basis: romerr.Basis
    B: np.ndarray
    u: Signal
    q0: np.ndarray
    q0_t: np.ndarray
    h: float
    T: float
    C: np.ndarray
    options: dict

    @property
    def outputs(self):
        """Displacement output y and velocity output v."""
        return [romerr.Output("y", self.C), romerr.Output("v", self.C, of="velocity")]

    @property
    def initial(self):
        """What attach and evaluate take as initial; "rest" and "span" start in the span of V."""
        return {"state": (self.q0, self.q0_t), "equilibrium": "equilibrium"}.get(self.pick.initial)

    @cached_property
    def exact(self):
        """Exact motions of the full model."""
        return exact_solid(self.pick.damping) if self.pick.body == "solid" else exact(self.model)

    def run(self):
        """Return the report, and reduced coordinates and velocities at its instants."""
        return self._stored() if "samples" in self.pick.integrator else self._simulated()

    def _simulated(self):
        mbs, seen = new_mbs(), Recorder()
        flex = romerr.add_reduced_body(
            mbs, self.model.body, self.basis, inputs=self.B, input_function=self.u, initial=(self.q0, self.q0_t)
        )
        jumps = {"jumps": self.u.jumps, **self.options}
        monitor = romerr.attach(mbs, flex, hook=seen, outputs=self.outputs, initial=self.initial, **jumps)
        mbs.Assemble()
        solve(mbs, flex, self.pick.integrator, self.h, self.T)
        return monitor.report(), seen.rows(0), seen.rows(1)

    def _stored(self):
        """Exact samples of the reduced body at uneven instants, perhaps disturbed at random."""
        rng = np.random.default_rng([self.pick.seed, 19])
        t = np.cumsum(self.h * np.concatenate([[0.0], rng.uniform(0.02, 1.98, round(self.T / self.h))]))
        states = self._reduced(t)
        if self.pick.integrator == "disturbed samples":
            for x in states:
                x[1:] += DISTURBED * np.abs(x).max() * rng.standard_normal(x[1:].shape)
        traj = romerr.Trajectory(t, *states)
        common = {"inputs": self.B, "input_function": self.u, "jumps": self.u.jumps, "initial": self.initial}
        report = romerr.evaluate(self.model.body, self.basis, traj, outputs=self.outputs, **common, **self.options)
        return report, *states[:2]

    def _reduced(self, t):
        """Exact q, q', q'' of the Galerkin model in the span of V (W != V too: any trajectory may be bounded)."""
        V, m = self.basis.V, self.model
        M, D, K, B = (V.T @ A for A in (m.M @ V, m.D @ V, m.K @ V, self.B))
        start = romerr.initial_coordinates(m.body, self.basis, self.q0, self.q0_t)
        q, q_t = Exact((M + M.T) / 2, D, (K + K.T) / 2, m.rayleigh).motion(B, self.u, *start, t)
        return q, q_t, la.solve(M, B @ self.u.at(t).T - D @ q_t.T - K @ q.T).T


def scene(seed):
    """Return the Scene of choice(seed)."""
    pick = choice(seed)
    rng = np.random.default_rng([seed, 18])
    full = _model(pick, seed)
    omega = full.modes[0]
    steps = int(rng.integers(600, 1100) if rng.random() < 0.15 else rng.integers(20, 400))
    span = 10 ** rng.uniform(-3, -1) if rng.random() < 0.1 else 10 ** rng.uniform(-0.7, 1.3)  # periods of mode 1
    T = span * 2 * np.pi / omega[0]
    h, p = T / steps, int(rng.integers(1, 3))
    B = _columns(full, p, rng) * 10 ** rng.uniform(-3, 3)
    pick, basis = _basis(pick, full, B, T, rng)
    u, C = LOADS[pick.load](p, T, h, omega, rng), _columns(full, 2, rng).T
    return Scene(pick, full, basis, B, u, *_start(pick, full, basis, B, u, rng), h, T, C, _options(full, rng))


def _model(pick, seed):
    if pick.body == "solid":
        return solid(pick.damping)
    return tiny(pick.damping, seed) if pick.body == "tiny" else model(pick.body, pick.damping, seed)


@lru_cache(maxsize=5)
def solid(damping):
    """The coarse solid bar on its free coordinates, with Rayleigh damping."""
    body, _, _ = solid_bar.build(0)
    M, K = body.M.toarray(), body.K.toarray()
    highest = la.eigvalsh(K, M, subset_by_index=[len(M) - 1, len(M) - 1])[0]
    rayleigh = RAYLEIGH[damping](body.modes(1).omega[0], np.sqrt(highest), np.random.default_rng(3))
    alpha, beta = map(float, rayleigh)
    return Model(f"solid/{damping}", M, alpha * M + beta * K, K, (alpha, beta))


def tiny(damping, seed):
    """Two to four coordinates."""
    rng = np.random.default_rng([seed, 23])
    M, K = pencil(rng, size=int(rng.integers(2, 5)))
    omega = np.sqrt(la.eigvalsh(K, M))
    if damping in ("matrix", "gyroscopic"):
        A, G = rng.standard_normal((2, *M.shape))
        return Model("tiny", M, A @ A.T + (G - G.T) * (damping == "gyroscopic"), K, None)
    alpha, beta = map(float, RAYLEIGH[damping](omega[0], omega[-1], rng))
    return Model("tiny", M, alpha * M + beta * K, K, (alpha, beta))


def exact(full):
    """Exact motions of a model."""
    return Exact(full.M, full.D, full.K, full.rayleigh)


@lru_cache(maxsize=5)
def exact_solid(damping):
    """Exact motions of the solid bar; its modes take a second to find."""
    return exact(solid(damping))


def _columns(full, count, rng):
    """Unit columns (N, count): single coordinates, or everywhere at random."""
    if rng.random() < 0.5:
        return np.eye(full.N)[:, rng.choice(full.N, count, replace=False)]
    X = full.M @ rng.standard_normal((full.N, count))
    return X / np.linalg.norm(X, axis=0)


def _basis(pick, full, B, T, rng):
    """The choice (no explicit integrator where the reduced body is too stiff) and a basis of 1..N columns."""
    while True:
        if pick.basis == "full":
            basis = romerr.Basis(np.linalg.qr(rng.standard_normal((full.N, full.N)))[0])
        else:
            n = int(np.ceil(min(full.N - 1, 60) ** rng.uniform(0, 1)))
            try:
                basis = make_basis(pick.basis, full, B, n, rng)
            except romerr.InputError:  # fewer directions than asked respond to the load
                continue
        rates = reduced_rates(full, basis)
        if rates.real.max() * T < GROWTH:
            break
    if pick.integrator == "DOPRI5" and np.abs(rates).max() * T > TOO_STIFF:
        pick = Choice(**{**vars(pick), "integrator": "alpha 0.9"})
    return pick, basis


def _start(pick, full, basis, B, u, rng):
    """Initial state of the full model."""
    if pick.initial == "rest":
        return np.zeros((2, full.N))
    size = np.linalg.norm(la.solve(full.K, B)) * (pick.load != "none") or 1.0
    if pick.initial == "equilibrium":
        return la.solve(full.K, B @ u.at(np.zeros(1))[0]), np.zeros(full.N)
    if pick.initial == "span":
        parts = (basis.V @ rng.standard_normal((basis.n, 2))).T
    else:
        parts = la.solve(full.K, full.M @ rng.standard_normal((full.N, 2))).T
    return size * parts[0] / np.linalg.norm(parts[0]), size * full.modes[0][0] * parts[1] / np.linalg.norm(parts[1])


def _options(full, rng):
    """Keywords of attach and evaluate."""
    m = rng.choice(["auto", 1, max(1, full.N // 3), min(full.N, 200)])
    modal = full.rayleigh is not None
    names = ["energy", "auxiliary", "fast", "convolution"]
    return {
        "estimators": names if modal else [name for name in names if name != "auxiliary"],
        "auxiliary_modes": "auto" if m == "auto" else int(m),
        "kernels": "spectrum" if modal and full.N < 20 and rng.random() < 0.1 else "certified",
        "residual": "direct" if full.N < 20 and rng.random() < 0.1 else "orthonormal",
    }


def solve(mbs, flex, integrator, h, T):
    """Solve with one of INTEGRATORS that Exudyn has; tolerances follow the size of the motion."""
    ss = settings(steps=max(1, round(T / h)), end=T)
    time, (name, *radius) = ss.timeIntegration, integrator.split()
    if radius:
        time.generalizedAlpha.spectralRadius, name = float(radius[0]), "generalised-alpha"
    model, start = flex.model, flex.initial or (np.zeros(flex.basis.n),) * 2
    size = np.linalg.norm(la.solve(model.K, model.G)) + np.linalg.norm(start[0])
    time.adaptiveStep = name == "DOPRI5"
    time.newton.absoluteTolerance = 1e-9 * np.linalg.norm(model.K, 2) * size
    time.relativeTolerance, time.absoluteTolerance, time.minimumStepSize = 1e-4, 1e-4 * size, 1e-9 * T
    SOLVERS[name](mbs, ss)
