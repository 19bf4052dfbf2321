"""What is rough: what generalised-alpha makes of residuals that change from sample to sample stays below `rough`.

One mode of unit mass, damped by beta K, under -r. e_n is linear in r and rough^2 is quadratic, so the largest of
|e_n|_K / rough_n and |e_n'|_M / rough_n over all r is known.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.estimates.overshoot import Overshoot
from exudyn_romerr.estimators.coupled_energy import MechanismEnergy
from exudyn_romerr.trajectory.scheme import Scheme

NEWMARK = Scheme(0.0, 0.0, 0.5, 1.0)
SCHEMES = {**{f"radius {r}": Scheme.of_radius(r) for r in (0.0, 0.3, 0.6, 1.0)}, "Newmark": NEWMARK}
STEPS = {"one size": np.ones(12), "halved, doubled": np.array([1, 1, 1, 1, 0.5, 0.25, 0.125, 0.125, 0.25, 0.5, 1, 1])}
BETAS, OMEGAS = np.geomspace(0.02, 200, 12), (0.05, 0.5, 1.5, 5.0, 15.0, 50.0, 1e4)  # over and times the longest step


def works(omega, beta, h):
    """Matrices Q_n (n, T, T) with rough_n^2 = r^T Q_n r, from the estimator's own integrals."""
    T = len(h) + 1
    Q = np.zeros((T, T, T))
    energy = SimpleNamespace(beta=beta, norm=lambda z: np.abs(z[..., 0]) / omega)

    def of(r):
        c = np.stack([r[:-1], r[1:]], axis=1)[..., None]
        block = SimpleNamespace(h=h, c=c, norms=lambda norm: norm(c))
        return np.append(0.0, np.cumsum(MechanismEnergy.roughness(energy, block)[0]))

    one = np.eye(T)
    for j in range(T):
        Q[:, j, j] = of(one[j])
    for j in range(T - 1):
        Q[:, j, j + 1] = Q[:, j + 1, j] = (of(one[j] + one[j + 1]) - Q[:, j, j] - Q[:, j + 1, j + 1]) / 2
    return Q[1:]


def answers(scheme, omega, beta, h, starts):
    """Return omega e_n and e_n' (n, 2, T) under -r, of every value of r; starts: the first accelerates at once."""
    K, D, x, found = omega**2, beta * omega**2, np.zeros((4, len(h) + 1)), []
    x[2:, 0] = -1.0 if starts else 0.0
    ahead, onward = scheme.ahead(h), scheme.next(h)
    for n, (mass, damping) in enumerate(zip(*scheme.mass_and_damping(h), strict=True)):
        known = ahead[n] @ x
        force = -np.eye(len(h) + 1)[n + 1]
        e = (force + mass * known[0] + D * (damping * known[0] - known[1])) / (mass + damping * D + K)
        x = onward[n] @ np.vstack([known, e - known[0]])
        found.append([omega * x[0], x[1]])
    return np.array(found)


def largest(scheme, h, starts=False):
    """Largest share of rough, and of the overshoot that goes with a start."""
    found = 0.0
    for beta in BETAS:
        more = Overshoot(scheme, 0.0, [(0.0, beta)]).advance(np.cumsum(h)) if starts else np.zeros((len(h), 2))
        for omega in OMEGAS:
            rows = zip(answers(scheme, omega, beta, h, starts), works(omega, beta, h), more, strict=True)
            for n, (row, Q, (E, F)) in enumerate(rows, 2):
                for a, extra in zip(row[:, :n], (omega * E, F), strict=True):
                    found = max(found, share(a, extra, Q[:n, :n], starts))
    return found


def share(a, extra, Q, starts):
    """Largest (|a r| - extra |r_0|) / (r^T Q r)^(1/2); r_0 = 0 unless the run starts with it."""
    if not starts:
        return np.sqrt(a[1:] @ np.linalg.solve(Q[1:, 1:], a[1:]))
    found = [0.0]
    for sign in (1.0, -1.0):
        turn = np.append(sign, np.ones(len(a) - 1))
        b = turn * a - extra * (np.arange(len(a)) == 0)
        r = np.linalg.solve(turn[:, None] * Q * turn, b)
        found += [np.sqrt(b @ r)] * int(r[0] > 0)
    return max(found)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("name", SCHEMES)
def test_integrated_motion_stays_below_rough(name, steps):
    assert largest(SCHEMES[name], STEPS[steps]) < 1


@pytest.mark.parametrize("name", ["radius 0.0", "radius 0.6"])
def test_integrated_motion_stays_below_rough_from_a_start_on(name):
    assert largest(SCHEMES[name], np.ones(6), starts=True) < 1
