"""Generalised-alpha is passive: the storage's identity, and bounds of errors under any dampers, joints and loads."""

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr.mechanism_bounds.passive_steps import Means, PassiveSteps

EXACT = 1e-12  # rounding of an identity's terms
ROUNDING = 1e-8  # of the bound: accelerations of stiff modes are 1e6 times those that count, and steps are 60
RADII = (0.0, 0.2, 0.3, 0.5, 0.7, 0.9, 0.99, 1.0)
SEEDS = range(120)
# |e + K^-1 f|_K and |e'|_M of single modes that began at rest, of all damping ratios: 1 and 1.0155 at most
OF_MODES = 1.0, 1.016


def parameters(kappa):
    """alpha_m, alpha_f, beta, gamma of Chung and Hulbert."""
    return (1 - 3 * kappa) / 2, (1 - kappa) / 2, (1 + kappa) ** 2 / 4, 0.5 + kappa


def newmark(x, v, a, new, h, kappa):
    """Displacement and velocity after a step to the acceleration `new`."""
    _, _, beta, gamma = parameters(kappa)
    return x + h * v + h**2 * ((0.5 - beta) * a + beta * new), v + h * ((1 - gamma) * a + gamma * new)


def storage(x, v, a, h, kappa):
    """Parts of 2 S of a coordinate, or of a motion: what M weighs (2, ...), and what K weighs (2, ...)."""
    k = kappa * h
    return (v + k * a / 2, k * a / np.sqrt(2)), (x + k * v / 2 - k**2 * a / 4, k * (v - k * a / 2) / 2)


def test_the_identity_of_a_step():
    rng = np.random.default_rng(0)
    x, v, a, new = rng.standard_normal((4, 1000))
    h, kappa = rng.uniform(0.01, 3, 1000), rng.uniform(0, 1, 1000)
    x1, v1 = newmark(x, v, a, new, h, kappa)
    alpha_m, alpha_f, _, _ = parameters(kappa)
    before, after = storage(x, v, a, h, kappa), storage(x1, v1, new, h, kappa)
    grown = [sum(np.square(one)) / 2 - sum(np.square(other)) / 2 for one, other in zip(after, before, strict=True)]
    felt = [(1 - share) * one + share * other for share, one, other in
            ((alpha_f, v1, v), (alpha_f, x1, x), (alpha_m, new, a))]  # fmt: skip
    speed, place, pushed = felt
    jump = new - a
    lost = 0.75 * kappa**3 * h**2 * jump**2, kappa**3 * h**4 * ((a + new) / 2 + kappa * jump / 2) ** 2 / 4
    work = h * speed * pushed, h * speed * place
    for part, taken, done in zip(grown, lost, work, strict=True):
        assert part + taken == pytest.approx(done, abs=EXACT * 1e3)
    assert min(map(np.min, lost)) >= 0


def spd(rng, n, low, high):
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    return Q * np.exp(rng.uniform(np.log(low), np.log(high), n)) @ Q.T


class System:
    """Free bodies with singular K, ideal joints, springs, dampers of low rank, gyroscopic forces; loads; an error.

    All is in units of the step, h = 1.
    """

    def __init__(self, seed, radius=None):
        rng = np.random.default_rng([seed, 35])
        self.kappa = (1 - (rho := rng.choice(RADII) if radius is None else radius)) / (1 + rho)
        self.steps_of = PassiveSteps(self.kappa)
        count, m = int(rng.integers(1, 4)), int(rng.integers(4, 9))
        n = self.n = count * m
        M, K, self.betas = [], [], 10 ** rng.uniform(-3, 2, count) * (rng.random(count) < 0.4)
        for _ in range(count):
            omega = 10 ** rng.uniform(-3, 3, m) * (np.arange(m) >= 2)  # two rigid motions
            X = np.linalg.inv(la.cholesky(spd(rng, m, 0.1, 10)).T) @ np.linalg.qr(rng.standard_normal((m, m)))[0]
            inverse = np.linalg.inv(X)
            M.append(inverse.T)
            K.append(inverse.T * omega)
        self.blocks = K
        self.root_M, self.root_K = la.block_diag(*M), la.block_diag(*K)  # A = B B^T: squares of norms stay positive
        self.M, self.K = (root @ root.T for root in (self.root_M, self.root_K))
        self.D = la.block_diag(*(b * k @ k.T for b, k in zip(self.betas, K, strict=True)))
        self.half_inverse_mass = np.linalg.inv(self.root_M.T)
        # K^-1 = H H^T of loads that balance, and of rows that see no rigid motion
        self.half_inverse = la.block_diag(*(np.linalg.pinv(k.T) for k in K))
        self.body = np.repeat(np.arange(count), m)
        rows = rng.standard_normal((int(rng.integers(0, 3)), n))
        self.root_s = rows.T * 10 ** rng.uniform(-1, 2.5, len(rows))
        self.K_s = self.root_s @ self.root_s.T
        dampers = rng.standard_normal((int(rng.integers(0, 4)), n))
        self.D = self.D + dampers.T * 10 ** rng.uniform(-3, 6, len(dampers)) @ dampers
        turning = rng.standard_normal((n, n)) * (rng.random() < 0.3)
        self.D = self.D + turning - turning.T
        joints = rng.standard_normal((int(rng.integers(0, 4)), n))
        self.T = la.null_space(joints) if len(joints) else np.eye(n)
        self.h = np.ones(60)
        t = np.arange(61)[:, None]
        shapes = {
            "sudden": 1.0 + 0 * t,
            "steps": np.floor(t / 7) % 3,
            "rings": (-1.0) ** t * np.cos(0.3 * t),
            "random": rng.standard_normal((61, n)),
            "slow": np.sin(0.2 * t),
        }
        self.kind = str(rng.choice(list(shapes)))
        sizes = np.sqrt(np.diag(self.K)) * rng.standard_normal(n)
        self.R = self.balanced(shapes[self.kind] * sizes)
        self.C = self.balanced(rng.standard_normal((3, n)))

    def balanced(self, rows):
        """Rows that see no rigid motion."""
        return rows @ self.half_inverse @ self.root_K.T

    def motion(self, a0=None):
        """e, e' and algorithmic a (steps + 1, n) of the scheme under -R; f (steps, n) that the steps feel."""
        T, kappa = self.T, self.kappa
        alpha_m, alpha_f, beta, gamma = parameters(kappa)
        M, D, K, R = T.T @ self.M @ T, T.T @ self.D @ T, T.T @ (self.K + self.K_s) @ T, self.R @ T
        x, v = np.zeros((2, len(M)))
        a = -np.linalg.solve(M, R[0]) if a0 is None else a0
        found, fs = [(x, v, a)], (1 - alpha_f) * self.R[1:] + alpha_f * self.R[:-1]
        for h, f in zip(self.h, fs @ T, strict=True):
            ahead, speed = newmark(x, v, a, 0.0, h, kappa)
            A = (1 - alpha_m) * M + (1 - alpha_f) * (gamma * h * D + beta * h**2 * K)
            known = alpha_m * M @ a + D @ (alpha_f * v + (1 - alpha_f) * speed)
            known += K @ (alpha_f * x + (1 - alpha_f) * ahead) + f
            new = -np.linalg.solve(A, known)
            x, v, a = ahead + beta * h**2 * new, speed + gamma * h * new, new
            found.append((x, v, a))
        return [np.array(rows) @ T.T for rows in zip(*found, strict=True)], fs

    def inverse_norm(self, f):
        """|f|_{K^-1} of balanced rows, over the bodies."""
        return np.linalg.norm(f @ self.half_inverse, axis=-1)

    def static(self, f):
        """K^-1 f of balanced rows, up to rigid motions."""
        return f @ self.half_inverse @ self.half_inverse.T

    def still(self, x):
        """Motions without their rigid part, of which no momentum is left."""
        X = la.block_diag(*(la.null_space(k.T, rcond=1e-12) for k in self.blocks))
        return x - x @ self.M @ X @ np.linalg.solve(X.T @ self.M @ X, X.T)

    def stored(self, d, e, v, a):
        """(2 S)^1/2, d: what bodies see of e, beside what has no energy."""
        of_mass, of_bodies = storage(d, v, a, 1.0, self.kappa)
        of_springs = storage(e, v, a, 1.0, self.kappa)[1]
        pairs = (self.root_M, of_mass), (self.root_K, of_bodies), (self.root_s, of_springs)
        return np.sqrt(sum(size(root, x) ** 2 for root, parts in pairs for x in parts))

    def start(self, a):
        """Of a start at rest with accelerations a."""
        return self.steps_of.start(
            self.h[0], size(self.root_M, a), np.hypot(size(self.root_K, a), size(self.root_s, a))
        )

    def bound(self, a0):
        """G (steps,): start and variation of what steps feel."""
        alpha_f = parameters(self.kappa)[1]
        f = (1 - alpha_f) * self.R[1:] + alpha_f * self.R[:-1]
        return self.start(a0) + np.cumsum(self.inverse_norm(np.diff(f, axis=0, prepend=0 * f[:1])))


def size(root, x):
    return np.linalg.norm(x @ root, axis=-1)


def shares(system, with_accelerations=True):
    """Largest error over its bound: of g itself, |e + K^-1 f|_K, |e'|_M, of outputs and of their rates."""
    (e, v, a), f = system.motion(None if with_accelerations else np.zeros(system.T.shape[1]))
    e, v, d = e[1:], v[1:], e[1:] + system.static(f)
    g = system.bound(a[0])
    # random rows, and those that see most of the error at some instants
    C = np.vstack([system.C, *(system.balanced(x[::6] @ A) for x, A in ((d, system.K), (v, system.M)))])
    by_mass = np.linalg.norm(C @ system.half_inverse_mass, axis=1)
    by_stiffness, passive = system.inverse_norm(C), system.steps_of
    C, by_mass, by_stiffness = (x[by_stiffness > 0] for x in (C, by_mass, by_stiffness))
    squares = (by_mass / by_stiffness) ** 2
    pushed = size(system.root_M, system.still(system.static(C))) ** 2 / by_stiffness**2
    twice = system.inverse_norm(system.still(system.static(C)) @ system.M) ** 2 / by_stiffness**2
    means = Means(squares), Means(squares, pushed, twice)
    places, rates = (np.minimum(*(of(1.0, x) for x in means)) for of in (passive.displacement, passive.velocity))
    norms = passive.norms
    if not with_accelerations:
        norms = passive.from_rest
        places, rates = np.minimum(places, norms[0]), np.minimum(rates, norms[1])
    found = {
        "storage": share(system.stored(d, e, v, a[1:]), g),
        "displacement": share(size(system.root_K, d), norms[0] * g),
        "velocity": share(size(system.root_M, v), norms[1] * g),
        "outputs": share(np.abs(d @ C.T), places * by_stiffness * g[:, None]),
        "rates": share(np.abs(v @ C.T), rates * by_mass * g[:, None]),
    }
    return {name: float(np.max(x)) for name, x in found.items()}


def share(error, bound):
    """Largest error over its bound; where there is no bound there is no error."""
    assert not np.any(error[bound == 0])
    return float(np.max(error[bound > 0] / bound[bound > 0], initial=0.0))


def worst(**options):
    found = [shares(System(seed), **options) for seed in SEEDS]
    return {name: max(x[name] for x in found) for name in found[0]}


def test_errors_under_any_dampers_stay_below():
    found = worst()
    assert max(found.values()) <= 1 + ROUNDING
    assert min(found.values()) > 0.5  # and bounds are reached
    assert found["storage"] > 0.999


def test_from_rest_less_is_enough():
    found = worst(with_accelerations=False)
    assert max(found.values()) <= 1 + ROUNDING
    assert found["displacement"] > 0.7


@pytest.mark.parametrize("radius", [*RADII, 0.999])
def test_single_modes_under_a_sudden_force(radius):
    """Of any damping less than from_rest is enough, and no less than 1: slow modes move as exactly as they do."""
    kappa = (1 - radius) / (1 + radius)
    alpha_m, alpha_f, beta, gamma = parameters(kappa)
    omega, damping = (x.ravel() for x in np.meshgrid(np.geomspace(1e-2, 1e4, 150), [0, *np.geomspace(1e-3, 1e3, 13)]))
    K, D = omega**2, damping * omega**2
    x, v, a = np.zeros((3, K.size))
    places, rates = [], []
    for _ in range(600):
        ahead, speed = newmark(x, v, a, 0.0, 1.0, kappa)
        known = alpha_m * a + D * (alpha_f * v + (1 - alpha_f) * speed) + 1.0
        known += K * (alpha_f * x + (1 - alpha_f) * ahead)
        a = -known / (1 - alpha_m + (1 - alpha_f) * (D * gamma + K * beta))
        x, v = ahead + beta * a, speed + gamma * a
        places.append(np.abs(K * x + 1))
        rates.append(np.abs(omega * v))
    assert 0.99 < np.max(places) <= OF_MODES[0] * (1 + ROUNDING)
    assert 0.99 < np.max(rates) <= OF_MODES[1] * (1 + ROUNDING)
    assert min(PassiveSteps(kappa).from_rest) >= 1


def wrong(monkeypatch, name, value):
    """Whether any bound is missed with something of PassiveSteps replaced."""
    with monkeypatch.context() as changed:
        changed.setattr(PassiveSteps, name, value)
        return max(worst().values()) > 1.01


def test_every_part_is_needed(monkeypatch):
    start = PassiveSteps.start
    assert wrong(monkeypatch, "start", lambda *of: start(*of) / 2)
    assert wrong(monkeypatch, "start", lambda self, h, mass, stiffness: start(self, h, mass, 0.0))
    assert wrong(monkeypatch, "start", lambda self, h, mass, stiffness: start(self, h, 0.0, stiffness))


def test_every_jump_counts(monkeypatch):
    original = System.inverse_norm

    def forgetful(self, f):
        found = original(self, f)
        if found.ndim and len(found) == 60:
            found[np.argmax(found)] = 0.0
        return found

    monkeypatch.setattr(System, "inverse_norm", forgetful)
    stepped = [System(seed) for seed in SEEDS if System(seed).kind in ("steps", "random")]
    assert max(max(shares(system).values()) for system in stepped) > 1.01


@pytest.mark.parametrize("kappa", [0.01, 0.0526, 0.3, 1.0])
def test_factors_are_those_of_the_worst_state(kappa):
    """Of a single mode there is nothing to lose: the largest |omega x| and |v| of one storage.

    But for rounding of 1 less nearly 1, at omega h kappa of 1e-4.
    """
    passive = PassiveSteps(kappa)
    for omega in np.geomspace(1e-2, 1e3, 30):
        (m, n), (p, q) = storage(*np.diag([1 / omega, 1.0, 1.0]), 1.0, kappa)
        inverse = np.linalg.pinv(np.array([m, n, omega * p, omega * q]))
        place, rate = np.linalg.norm(inverse[:2], axis=1)
        squares = np.array([omega**2])
        for means in (Means(squares), Means(squares, 1 / squares, 1 / squares**2)):
            assert place == pytest.approx(passive.displacement(1.0, means)[0], rel=1e-6)
            assert rate == pytest.approx(passive.velocity(1.0, means)[0], rel=1e-6)


@pytest.mark.parametrize("dropped", range(4))
def test_every_term_of_the_storage_is_needed(dropped):
    """Without any of the four it grows by more than work, in a step without loads or dampers."""
    rng, grown = np.random.default_rng(1), []
    for _ in range(300):
        kappa, omega = rng.uniform(0.05, 1), 10 ** rng.uniform(-2, 3)
        alpha_m, alpha_f, beta, _ = parameters(kappa)
        x, v, a = rng.standard_normal(3) / [omega, 1, 1 / omega]
        ahead, _ = newmark(x, v, a, 0.0, 1.0, kappa)
        known = alpha_m * a + omega**2 * (alpha_f * x + (1 - alpha_f) * ahead)
        new = -known / (1 - alpha_m + (1 - alpha_f) * beta * omega**2)
        sums = []
        for state in ((x, v, a), (*newmark(x, v, a, new, 1.0, kappa), new)):
            (m, n), (p, q) = storage(*state, 1.0, kappa)
            terms = np.square([m, n, omega * p, omega * q])
            sums.append((terms.sum(), np.delete(terms, dropped).sum()))
        assert sums[1][0] <= sums[0][0] * (1 + ROUNDING)
        grown.append(sums[1][1] / sums[0][1])
    assert max(grown) > 1.01


@pytest.mark.parametrize("seed", range(25))
def test_rough_loads_of_damped_bodies_do_bounded_work(seed):
    """D >= beta_b K: 2 S <= s0^2 + h sum |f|^2/(2 beta_b), of e itself."""
    system = System(seed)
    system.betas = np.maximum(system.betas, 1e-3)
    blocks = (b * system.K * np.outer(system.body == i, system.body == i) for i, b in enumerate(system.betas))
    system.D = system.D + sum(blocks)
    (e, v, a), f = system.motion()
    work = sum(system.inverse_norm(f * (system.body == i)) ** 2 / (2 * b) for i, b in enumerate(system.betas))
    g = np.hypot(system.start(a[0]), np.sqrt(np.cumsum(work)))
    assert np.all(size(system.root_K, e[1:]) <= system.steps_of.norms[0] * g * (1 + ROUNDING))
    assert np.all(size(system.root_M, v[1:]) <= system.steps_of.norms[1] * g * (1 + ROUNDING))


def test_impulses_beside():
    """Forces that no K^-1 norm bounds, of one step from rest: c h |f|_{M^-1}, which is reached."""
    found = []
    for seed in SEEDS:
        system = System(seed)
        rng = np.random.default_rng(seed)
        system.R[:] = 0.0
        system.R[1:] = rng.standard_normal(system.n) if seed % 2 else rng.standard_normal((60, system.n))
        alpha_f = parameters(system.kappa)[1]
        system.R[0] = system.R[1] if seed % 2 else system.R[0]
        (e, v, a), f = system.motion(np.zeros(system.T.shape[1]))
        own = system.stored(e, e, v, a)
        pushed = np.sqrt(np.sum(f * np.linalg.solve(system.M, f.T).T, axis=1))
        found.append(np.max(own[1:] / (system.steps_of.impulse * np.cumsum(pushed))))
        assert alpha_f <= 0.5
    assert 0.9 < max(found) <= 1 + ROUNDING


def test_which_schemes_are_passive():
    assert PassiveSteps.of(0.0, 0.0, 0.25, 0.5) == PassiveSteps(0.0)
    for radius in RADII:
        kappa = (1 - radius) / (1 + radius)
        assert PassiveSteps.of(*parameters(kappa)).kappa == pytest.approx(kappa, abs=1e-15)
    assert PassiveSteps.of(0.0, 0.0, 0.3025, 0.6) is None
    assert PassiveSteps.of(0.0, 0.0, 1 / 6, 0.5) is None
    assert PassiveSteps(0.0).norms == (1.0, 1.0)
