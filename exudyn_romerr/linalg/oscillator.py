"""Closed forms of the damped oscillator x'' + 2 zeta omega x' + omega^2 x = 0: one mode of the full body.

    s(t): response to a unit initial velocity      (entry of Phi12)
    p(t): response to a unit initial displacement  (entry of Phi11),  p = s' + 2 zeta omega s

Valid for every zeta >= 0: undamped, under-, critically and overdamped (theory.md 2). omega, zeta and t broadcast.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Constants:
    """Suprema over time of the fundamental matrix' norms in the M-norm (paper, section 4).

    C1 bounds |Phi(t)| of the first-order form (dimension mixed), C11 bounds |Phi11|, C12 (s) bounds |Phi12|.
    """

    C1: float
    C11: float
    C12: float


def damping_ratios(omega: np.ndarray, alpha: float, beta: float) -> np.ndarray:
    """Return zeta of modes with angular frequency omega (rad/s) under D = alpha M + beta K."""
    return 0.5 * (alpha / omega + beta * omega)


def largest_decay_rate(omega: float, alpha: float, beta: float) -> float:
    """Return the largest r (1/s) such that exp(r t) s(t) has damping and stiffness >= 0 for all modes >= omega."""
    a = (alpha + beta * omega**2) / 2
    limit = min(a, 1 / beta if beta else np.inf)
    if a >= omega:  # the stiffness vanishes at the slow root of the overdamped lowest mode
        limit = min(limit, omega**2 / (a + np.sqrt((a - omega) * (a + omega))) * (1 - 1e-12))
    return limit


def impulse_response(omega: np.ndarray, zeta: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return s(t) in seconds: the displacement after a unit initial velocity."""
    return _solve(omega, zeta, t)[0]


def step_release(omega: np.ndarray, zeta: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return p(t): the displacement after a unit initial displacement."""
    s, fast, decay = _solve(omega, zeta, t)
    return fast * s + decay


def _solve(omega, zeta, t):
    """Return s, and (fast, decay) such that p = fast s + decay without cancellation when overdamped."""
    omega, zeta, t = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (omega, zeta, t)))
    a = zeta * omega
    # (1 - zeta)(1 + zeta), not 1 - zeta^2: keeps all digits of zeta = 1 +- 1e-12
    q = omega**2 * (1 - zeta) * (1 + zeta)
    root = np.sqrt(np.abs(q))
    under = q > 0
    slow = np.where(under, a, omega**2 / np.where(a + root > 0, a + root, 1.0))
    shape = np.where(under, np.sinc(root * t / np.pi), one_minus_exp_over(2 * root * t))
    s = np.exp(-slow * t) * t * shape
    fast = np.where(under, a, a + root)
    decay = np.exp(-fast * t) * np.where(under, np.cos(root * t), 1.0)
    return s, fast, decay


def one_minus_exp_over(x: np.ndarray) -> np.ndarray:
    """(1 - exp(-x)) / x with its limit 1 at x = 0."""
    safe = np.where(x == 0, 1.0, x)
    return np.where(x == 0, 1.0, -np.expm1(-safe) / safe)


def peak_time(omega: np.ndarray, zeta: np.ndarray) -> np.ndarray:
    """Return t* > 0, the first (and largest) extremum of s: s'(t*) = 0."""
    a = zeta * omega
    q = omega**2 * (1 - zeta) * (1 + zeta)
    root = np.sqrt(np.abs(q))
    safe = np.where(root == 0, 1.0, root)
    # log((a + root)/omega), not arctanh(root/a): keeps the digits of very strong damping
    over = (
        np.log1p((omega * (zeta - 1) + np.where(q < 0, root, 0.0)) / omega, where=q < 0, out=np.zeros_like(q)) / safe
    )
    return np.where(q > 0, np.arctan2(root, a) / safe, np.where(q < 0, over, 1 / np.where(a > 0, a, 1.0)))


def largest_impulse_response(omega: np.ndarray, zeta: np.ndarray) -> np.ndarray:
    """Return max over t >= 0 of |s(t)| = exp(-zeta omega t*)/omega, in seconds."""
    return np.exp(-zeta * omega * peak_time(omega, zeta)) / omega


def largest_state_response(omega: np.ndarray, s_max: np.ndarray) -> float:
    """Return a bound of |Phi(t)| of all modes in state form: the root of the squared suprema of its four blocks.

    omega and s_max (largest |s|) in one unit of time, which the result depends on: Phi12 is a time, Phi21 a rate.
    """
    return float(np.sqrt(np.max((omega**2 * s_max) ** 2 + s_max**2 + 2.0)))  # |Phi11|, |Phi22| <= 1


def impulse_response_on(omega: np.ndarray, zeta: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
    """Return max of |s| over each interval [lo, hi]: an end, or the first extremum inside (peaks decay)."""
    ends = np.maximum(np.abs(impulse_response(omega, zeta, lo)), np.abs(impulse_response(omega, zeta, hi)))
    first = peak_time(omega, zeta)
    root = omega * np.sqrt(np.maximum((1 - zeta) * (1 + zeta), 0.0))
    period = np.where(root > 0, np.pi / np.where(root > 0, root, 1.0), np.inf)
    count = np.maximum(np.ceil((lo - first) / period), 0.0)
    # overdamped: one extremum only (period inf, count 0; 0 * inf would be nan)
    peak = first + np.where(count > 0, count * np.where(np.isfinite(period), period, 0.0), 0.0)
    inside = (peak >= lo) & (peak <= hi)
    return np.where(inside, np.maximum(ends, np.abs(impulse_response(omega, zeta, peak))), ends)
