"""What generalised-alpha feels of residuals: bounds of errors that the scheme itself makes of random ones."""

from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr.decay.passive_steps import PassiveSteps
from exudyn_romerr.estimates.overshoot import Overshoot
from exudyn_romerr.residual.felt_residuals import STARTED, FeltResiduals
from exudyn_romerr.trajectory.scheme import Scheme
from tests.estimators.test_rough_steps import answers, share

RADII = (0.0, 0.3, 0.6, 0.8, 0.9, 0.99, 1.0)
OMEGA, BETA = np.geomspace(0.02, 1e4, 100), np.append(0.0, np.geomspace(1e-3, 1e3, 19))  # times and over the step
EXACT = 1 + 1e-9  # rounding of sums
SEEDS = range(40)


def responses(scheme, force, steps):
    """omega^2 q, omega q' (steps, modes) of modes of unit mass under -force[n] felt in step n, from rest."""
    omega, beta = (x.ravel() for x in np.meshgrid(OMEGA, BETA))
    K, D = omega**2, beta * omega**2
    q, v, a, found = 0 * K, 0 * K, 0 * K, []
    for n in range(steps):
        ahead, speed = q + v + (0.5 - scheme.beta) * a, v + (1 - scheme.gamma) * a
        known = scheme.alpha_m * a + D * (scheme.alpha_f * v + (1 - scheme.alpha_f) * speed)
        known += K * (scheme.alpha_f * q + (1 - scheme.alpha_f) * ahead) + force[n]
        a = -known / (1 - scheme.alpha_m + (1 - scheme.alpha_f) * (D * scheme.gamma + K * scheme.beta))
        q, v = ahead + scheme.beta * a, speed + scheme.gamma * a
        found.append([K * q, omega * v])
    return np.array(found).swapaxes(0, 1), beta


@pytest.mark.parametrize("radius", RADII)
def test_work_of_what_is_felt_bounds_the_energy(radius):
    """Of all forces of one work, sum |f|^2/(2 beta), the worst one is known: e_n is linear in f."""
    (q, v), beta = responses(Scheme.of_radius(radius), np.append(1.0, np.zeros(999)), 1000)
    for x in (q, v):
        assert np.sqrt((x**2).sum(axis=0) * 2 * beta).max() <= EXACT


@pytest.mark.parametrize("radius", [0.0, 0.6, 0.9, 1.0])
def test_accelerations_of_a_start_are_covered(radius):
    """Of all residuals the worst one is known; without STARTED the first accelerations count for nothing."""
    scheme, h, found = Scheme.of_radius(radius), np.ones(10), []
    for beta in np.geomspace(0.005, 500, 8):
        more = Overshoot(scheme, 0.0, [(0.0, beta)]).advance(np.cumsum(h))
        for omega in (0.05, 0.5, 1.5, 5.0, 50.0, 1e4):
            for n, (rows, extra) in enumerate(zip(answers(scheme, omega, beta, h, True), more, strict=True), 2):
                felt = (1 - scheme.alpha_f) * np.eye(n)[1:] + scheme.alpha_f * np.eye(n)[:-1]
                work = felt.T @ felt + STARTED * np.diag(np.eye(n)[0])
                for row, size_of in zip(rows[:, :n], (omega * extra[0], extra[1]), strict=True):
                    found.append(share(row, size_of, work / (2 * beta * omega**2), True))
    assert 0.9 < max(found) <= EXACT


class Joined:
    """Bodies of different stiffness and damping, joined by random constraints, under random residuals."""

    def __init__(self, seed, radius=None):
        rng = np.random.default_rng([seed, 41])
        self.count, self.steps = int(rng.integers(1, 4)), 60
        n = 3 * self.count
        bodies = [(spd(rng, 0.1, 10), 10 ** rng.uniform(-2, 4) * spd(rng, 0.01, 10)) for _ in range(self.count)]
        self.betas = 10 ** rng.uniform(-2, 2, self.count) * (rng.random(self.count) < 0.6)
        self.M, self.K = (la.block_diag(*of) for of in zip(*bodies, strict=True))
        self.D = la.block_diag(*(b * K for b, (_, K) in zip(self.betas, bodies, strict=True)))
        self.T = la.null_space(rng.standard_normal((rng.integers(1, 3), n)))
        self.scheme = Scheme.of_radius(rng.choice(RADII) if radius is None else radius)
        t = np.arange(self.steps + 1)[:, None]
        slow, rings = np.sin(t * rng.uniform(0, 0.5, n)), (-1.0) ** t * np.cos(t * rng.uniform(0, 0.3, n))
        sizes = 10 ** rng.uniform(-2, 0, n) * np.sqrt(np.diag(self.K))
        self.R = sizes * (
            rng.choice([0.0, 0.1, 1.0]) * slow + rings * rng.choice([0.0, 1.0]) + (t > 20) * rng.random()
        )
        self.R *= np.minimum(1.0, t / rng.choice([1.0, 10.0]))  # from 0 on: what a start adds is looked at by itself
        self.roots = [np.linalg.inv(la.cholesky(K, lower=True)) for _, K in bodies]

    def errors(self):
        """|e + K^-1 R|_K, |e|_K and |e'|_M (steps) of the scheme's own motion."""
        s, T = self.scheme, self.T
        M, D, K, R = T.T @ self.M @ T, T.T @ self.D @ T, T.T @ self.K @ T, self.R @ T
        A = (1 - s.alpha_m) * M + (1 - s.alpha_f) * (D * s.gamma + K * s.beta)
        q, v, found = np.zeros(len(M)), np.zeros(len(M)), []
        a = np.zeros(len(M))
        for last, r in pairwise(R):
            ahead, speed = q + v + (0.5 - s.beta) * a, v + (1 - s.gamma) * a
            known = s.alpha_m * M @ a + D @ (s.alpha_f * v + (1 - s.alpha_f) * speed)
            known += K @ (s.alpha_f * q + (1 - s.alpha_f) * ahead) + (1 - s.alpha_f) * r + s.alpha_f * last
            a = -np.linalg.solve(A, known)
            q, v = ahead + s.beta * a, speed + s.gamma * a
            found.append((T @ q, T @ v))
        e, e_t = (np.array(x) for x in zip(*found, strict=True))
        d = e + np.linalg.solve(self.K, self.R[1:].T).T
        return size(self.K, d), size(self.K, e), size(self.M, e_t)

    def bounds(self, blocks=(0, 1, 25, 60)):
        norms = [lambda z, root=root: np.linalg.norm(z @ root.T, axis=-1) for root in self.roots]
        felt = FeltResiduals(self.scheme.alpha_f, norms, self.betas, (0.0, 0.0))
        chains = np.split(self.R, self.count, axis=1)
        found = []
        for a, b in pairwise(blocks):
            none = np.zeros(b - a)
            found.append(felt.advance(none + 1.0, [z[a : b + 1] for z in chains], none, none))
        return levels(self.scheme, np.hstack(found))


def levels(scheme, found):
    """Bounds of |e + K^-1 R|_K, |e|_K, |e'|_M, of what begins at rest; found: of FeltResiduals."""
    (g, rough, beside, others), (place, rate) = found, PassiveSteps.of(**vars(scheme)).from_rest
    return np.minimum(place * g + beside, place * rough + others), place * rough, rate * np.minimum(g, rough)


def spd(rng, low, high):
    Q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    return Q * np.exp(rng.uniform(np.log(low), np.log(high), 3)) @ Q.T


def size(A, x):
    return np.sqrt(np.einsum("ti,ij,tj->t", x, A, x))


def above(case, floor=1e-9):
    """Names of bounds that are below the error, but for rounding."""
    (d, e, e_t), (g, rough, speed) = case.errors(), case.bounds()
    least = floor * max(d.max(), e.max(), e_t.max())
    pairs = {"g": (d, g), "speed": (e_t, speed)}
    if all(case.betas):
        pairs["rough"] = e, rough
    return [name for name, (error, bound) in pairs.items() if np.any(error > bound + least)]


@pytest.mark.parametrize("seed", SEEDS)
def test_errors_of_joined_bodies_stay_below(seed):
    assert not above(Joined(seed))


def test_what_is_beside_averages_is_needed(monkeypatch):
    original = FeltResiduals._summed
    monkeypatch.setattr(
        FeltResiduals, "_summed", lambda self, *parts: original(self, *parts[:3], 0 * parts[3], parts[4])
    )
    assert any("g" in above(Joined(seed)) for seed in SEEDS)


class Turning:
    """A body on two coordinates of a frame that turns by an angle a step; these are in axes that do not turn."""

    def __init__(self, seed, turn, radius):
        rng = np.random.default_rng([seed, 7])
        self.S, self.turn, self.scheme = rng.standard_normal((2, 3)), turn, Scheme.of_radius(radius)
        self.M = la.block_diag(10 ** rng.uniform(-1, 1.5) * np.eye(2), spd(rng, 0.1, 10))
        self.K = 10 ** rng.uniform(-1, 4) * spd(rng, 0.01, 10)  # stiff beside what turns
        t = np.arange(61)
        shape = rng.standard_normal(3) * np.sqrt(np.diag(self.K))
        rings = np.outer((-1.0) ** t * np.minimum(1.0, t / 10), shape)
        walks = np.cumsum(rng.standard_normal((61, 3)) * 0.3, axis=0) * np.sqrt(np.diag(self.K))
        self.R = rings if seed % 2 else walks * (t > 0)[:, None]

    def axes(self, step):
        c, s = np.cos(self.turn * step), np.sin(self.turn * step)
        return np.array([[c, s], [-s, c]])

    def error(self):
        """|e + K^-1 R|_K of the scheme: M x'' + [0; K q] + C^T l = -[0; R], C x = 0, C = [A^T, -S]."""
        s, K = self.scheme, la.block_diag(np.zeros((2, 2)), self.K)
        x, v, a, last, found = np.zeros(5), np.zeros(5), np.zeros(5), np.zeros(5), []
        share = (1 - s.alpha_f) / (1 - s.alpha_m)
        for step, r in enumerate(self.R[1:], 1):
            C = np.hstack([self.axes(step), -self.S])
            known = (s.alpha_f * last - s.alpha_m * a) / (1 - s.alpha_m)
            ahead, speed = x + v + (0.5 - s.beta) * a + s.beta * known, v + (1 - s.gamma) * a
            A = np.block([[self.M + s.beta * share * K, C.T], [s.beta * share * C, np.zeros((2, 2))]])
            last = np.linalg.solve(A, np.concatenate([-np.append([0, 0], r) - K @ ahead, -C @ ahead]))[:5]
            a = known + share * last
            x, v = ahead + s.beta * share * last, speed + s.gamma * a
            found.append(x[2:])
        return size(self.K, np.array(found) + np.linalg.solve(self.K, self.R[1:].T).T)

    def bound(self, turn):
        root, none = np.linalg.inv(la.cholesky(self.K, lower=True)), np.zeros(60)
        norm = lambda z: np.linalg.norm(z @ root.T, axis=-1)  # noqa: E731
        felt = FeltResiduals(self.scheme.alpha_f, [norm], [0.0], (0.0, 0.0))
        return levels(self.scheme, felt.advance(none + 1.0, [self.R], none, none + turn))[0]


@pytest.mark.parametrize("radius", [0.6, 0.9, 1.0])
def test_averages_turn_with_the_frame(radius):
    """0.1 rad a step: averages of what is in different directions."""
    shares = []
    for turn in (0.003, 0.02, 0.1):
        cases = [Turning(seed, turn, radius) for seed in range(40)]
        assert all(np.all(case.error() <= case.bound(turn)) for case in cases)
        shares.append(max(np.max(case.error() / np.maximum(case.bound(0.0), 1e-300)) for case in cases))
    assert max(shares) > 1 or radius < 1


def test_what_alternates_hardly_counts():
    """With spectral radius 1, of what changes its sign from step to step nothing is felt; it varies by 2 a step."""
    case = Joined(0, radius=1.0)
    case.R = (-1.0) ** np.arange(case.steps + 1)[:, None] * np.ones(case.R.shape[1])
    g = case.bounds()[0]
    norms = sum(
        np.linalg.norm(z @ root.T, axis=1) ** 2
        for z, root in zip(np.split(case.R, case.count, 1), case.roots, strict=True)
    )
    assert g[-1] <= 2 * np.sqrt(norms.max())


def test_steps_of_another_size_are_not_covered():
    case = Joined(1)
    felt = FeltResiduals(0.5, [lambda z: np.linalg.norm(z, axis=-1)], [0.0], (0.0, 0.0))
    none = np.zeros(2)
    assert np.isfinite(felt.advance(none + 1.0, [case.R[:3, :3]], none, none)).all()
    assert np.isinf(felt.advance(none + 0.5, [case.R[2:5, :3]], none, none)).all()
    assert np.isinf(felt.advance(none + 1.0, [case.R[4:7, :3]], none, none)).all()
