"""Kernels: upper bounds of |Phi11(t)|_M and |Phi12(t)|_M, the norms of the fundamental matrix (theory.md 2).

Every kernel has the contract of `Kernel`; a `LagTable` has its maxima over lag intervals.
"""

from __future__ import annotations

import numpy as np

from ...checks import check_choice
from ...errors import AssumptionError
from ...linalg import oscillator
from ...model.body import ElasticBody

KERNELS = ("certified", "spectrum", "envelope")
CELLS_PER_RADIAN = 32  # of the first mode: rounding a lag interval outwards costs about 1/32 of the kernel's peak
MOST_CELLS = 2**20  # 20 levels of them take 170 MB, twice that while they grow
DECAY_SHARES = (0.0, 0.5, 0.8, 0.95, 1.0)  # of the largest admissible decay rate: long lags want 1, short ones 0


class Kernel:
    """Contract of a kernel: phi11(t) bounds |Phi11(t)|_M, phi12_on(lo, hi) |Phi12|_M over lag intervals [lo, hi].

    Attributes
    ----------
    C11, C12 : float
        Suprema over time; C12 in s. C11 is None where damping allows no bound of |Phi11|_M.
    certified : bool
        True if proved to be an upper bound for this body.
    envelopes : list of (amplitude, rate)
        |Phi12(t)| <= amplitude exp(-rate t) for each; empty: only `phi12_on` is known.
    omega_1 : float
        Lower bound of all angular frequencies (rad/s).
    """

    C11: float | None
    C12: float
    certified: bool
    envelopes: list[tuple[float, float]]
    omega_1: float

    def phi12(self, t: np.ndarray) -> np.ndarray:
        """Return the bound of |Phi12(t)|_M (s) at times t >= 0."""
        return self.phi12_on(t, t)

    def free_motion(self, t: np.ndarray, e0_M: float, e0_K: float, v0_M: float) -> np.ndarray:
        """Bound |Phi11 e0 + Phi12 e0'|_M from |e0|_M, |e0|_K and |e0'|_M."""
        if e0_M == 0 and v0_M == 0:
            return np.zeros_like(t)
        displaced = e0_K / self.omega_1 if self.C11 is None else self.phi11(t) * e0_M
        return displaced + self.phi12(t) * v0_M


def make_kernel(body: ElasticBody, name: str) -> Kernel:
    """Return the kernel of that name; InputError for unknown names, AssumptionError where it is no bound."""
    check_choice("kernels", name, KERNELS)
    kernel = {"certified": CertifiedKernel, "spectrum": SpectrumKernel, "envelope": EnvelopeKernel}[name](body)
    if not kernel.certified:
        raise AssumptionError(
            "kernels='envelope' is no upper bound for this body: the first mode decays faster than some higher mode "
            "((alpha + beta omega_1^2)/2 > 1/beta); use kernels='certified'"
        )
    return kernel


class CertifiedKernel(Kernel):
    """Closed-form bound over all omega >= omega_1 at once; needs omega_1, alpha, beta only.

    For 0 <= r <= min(a_1, 1/beta), a_1 = (alpha + beta omega_1^2)/2, and kappa = omega_1^2 - 2 a_1 r + r^2 >= 0,
    exp(r t) s(t) is the response of an oscillator with damping >= 2(a_1 - r) and stiffness >= kappa, hence

        |s(t)| <= exp(-r t) min( (1 - exp(-c t))/c , 1/sqrt(kappa) ),   c = 2(a_1 - r)
        |p(t)| <= exp(-r t) sqrt(1 + r^2/kappa)   and <= 1

    and the minimum over a few r is taken (docs/theory.md has the proof). A general dissipative damping matrix
    leaves |s(t)| <= min(t, 1/omega_1) and no bound of |Phi11|_M.
    """

    certified = True

    def __init__(self, body: ElasticBody):
        self.omega_1 = body.modes(1).omega[0]
        general = body.rayleigh is None
        self._set_rates(*((0.0, 0.0) if general else body.rayleigh))
        self.C11 = None if body.proportional is None else 1.0  # ratios by mode: every mode for itself

    def _set_rates(self, alpha: float, beta: float) -> None:
        w = self.omega_1
        a = (alpha + beta * w**2) / 2
        limit = oscillator.largest_decay_rate(w, alpha, beta)
        self.r = r = limit * np.array(DECAY_SHARES if limit > 0 else (0.0,))
        self.kappa = w**2 - 2 * a * r + r**2
        self.c = c = 2 * (a - r)
        with np.errstate(divide="ignore", invalid="ignore"):
            self.cap = 1 / np.sqrt(np.maximum(self.kappa, 0.0))
            bend = np.where(c * self.cap < 1, np.where(c > 0, -np.log1p(-c * self.cap) / c, self.cap), np.inf)
            top = np.where(r > 0, np.where(c > 0, np.log1p(c / r) / c, 1 / r), np.inf)
        self.peak = np.minimum(bend, top)
        amplitude = np.minimum(np.where(c > 0, 1 / np.where(c > 0, c, 1.0), np.inf), self.cap)
        self.envelopes = list(zip(amplitude.tolist(), r.tolist(), strict=True))
        finite = np.isfinite(self.peak)
        tops = self._at(np.where(finite, self.peak, 0.0)[:, None])[:, 0]
        self.C12 = float(np.min(np.where(finite, tops, amplitude)))

    def _at(self, t: np.ndarray) -> np.ndarray:
        """Bounds of |s| for every r (rows) at times t (r, T)."""
        rise = t * oscillator.one_minus_exp_over(self.c[:, None] * t)
        return np.exp(-self.r[:, None] * t) * np.minimum(rise, self.cap[:, None])

    def phi11(self, t):
        """Return the bound of |Phi11(t)|_M at times t >= 0."""
        t = np.asarray(t, dtype=float)
        useful = self.kappa > 0
        r, kappa = self.r[useful, None], self.kappa[useful, None]
        decaying = np.exp(-r * t.ravel()) * np.sqrt(1 + r**2 / kappa)
        return np.minimum(1.0, decaying.min(axis=0)).reshape(t.shape)

    def phi12_on(self, lo, hi):
        """Return the bound of |Phi12|_M over each lag interval [lo, hi]; exact maximum for every r."""
        lo, hi = np.broadcast_arrays(np.asarray(lo, dtype=float), np.asarray(hi, dtype=float))
        at = np.clip(self.peak[:, None], lo.ravel(), hi.ravel())
        return self._at(at).min(axis=0).reshape(lo.shape)


class SpectrumKernel(Kernel):
    """Exact norms |Phi11|_M, |Phi12|_M as maxima over all modes; for study, refused above 2000 coordinates."""

    certified = True

    def __init__(self, body: ElasticBody):
        body.require_rayleigh("kernels='spectrum'")
        self.omega = body.all_modes().omega
        self.zeta = body.damping_ratios(self.omega)
        self.omega_1 = self.omega[0]
        self.C11, self.C12 = 1.0, float(np.max(oscillator.largest_impulse_response(self.omega, self.zeta)))
        self.envelopes = []

    def phi11(self, t):
        """Return |Phi11(t)|_M at times t >= 0."""
        return self._largest(oscillator.step_release, t)

    def phi12_on(self, lo, hi):
        """Return the exact maximum of |Phi12|_M over each lag interval [lo, hi]."""
        return self._largest(oscillator.impulse_response_on, lo, hi)

    def _largest(self, function, *times):
        times = np.broadcast_arrays(*(np.asarray(t, dtype=float) for t in times))
        largest = np.zeros(times[0].shape)
        for omega, zeta in zip(self.omega, self.zeta, strict=True):  # mode by mode: memory stays that of the times
            np.maximum(largest, np.abs(function(omega, zeta, *times)), out=largest)
        return largest


class EnvelopeKernel(Kernel):
    """The paper's (36)-(37): exponential envelopes of the k lowest modes stand for the whole body.

    A bound only if a_1 <= 1/beta and zeta_1 < 1 (`certified` tells); beyond, some overdamped mode decays slower.
    """

    def __init__(self, body: ElasticBody, k: int = 1):
        alpha, beta = body.require_rayleigh("kernels='envelope'")
        omega = body.modes(k).omega
        zeta = oscillator.damping_ratios(omega, alpha, beta)
        if np.any(zeta >= 1):
            raise AssumptionError(
                f"kernels='envelope' needs underdamped modes; mode {int(np.argmax(zeta >= 1)) + 1} is not: use "
                "kernels='certified'"
            )
        self.omega_1, self.rate, damped = omega[0], zeta * omega, omega * np.sqrt((1 - zeta) * (1 + zeta))
        self.amplitude11, self.amplitude12 = omega / damped, 1 / damped
        self.C11, self.C12 = float(self.amplitude11.max()), float(self.amplitude12.max())
        self.certified = bool(beta * self.rate[0] <= 1)
        self.envelopes = [(float(self.amplitude12[0]), float(self.rate[0]))] if k == 1 else []

    def _largest(self, amplitude, t):
        decay = np.multiply.outer(self.rate, np.asarray(t, dtype=float))
        return np.max(np.exp(-decay) * amplitude.reshape(-1, *[1] * np.ndim(t)), axis=0)

    def phi11(self, t):
        """Return the envelope of |Phi11(t)|_M at times t >= 0."""
        return self._largest(self.amplitude11, t)

    def phi12_on(self, lo, hi):
        """Return the envelope of |Phi12|_M over each lag interval [lo, hi]; it falls, so its value at lo."""
        return self._largest(self.amplitude12, lo)


class LagTable:
    """Maxima of |Phi12| over cells of equal length and over runs of 2^j cells; grows with the lags asked for."""

    def __init__(self, kernel: Kernel):
        self.kernel = kernel
        self.cell = 1 / (CELLS_PER_RADIAN * kernel.omega_1)
        self.levels = np.zeros((1, 0))

    def __call__(self, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
        """Upper bounds of max |Phi12| over [lo, hi] (any shape), never below it."""
        # the interval is widened by rounding of the division, then outwards to whole cells
        first = np.floor(lo / self.cell * (1 - 1e-14)).astype(int)
        last = np.floor(hi / self.cell * (1 + 1e-14)).astype(int)
        self._grow(int(last.max()) + 1)
        level = np.floor(np.log2(last - first + 1)).astype(int)
        # row j is padded at its end; both runs of 2^j cells lie inside [first, last]
        return np.maximum(self.levels[level, first], self.levels[level, last - 2**level + 1])

    def _grow(self, cells: int) -> None:
        have = self.levels.shape[1]
        if cells <= have:
            return
        if cells > MOST_CELLS:
            longest = MOST_CELLS * self.cell
            raise AssumptionError(
                "sums over all steps before ('convolution' of kernels without exponentials) were asked for in a run "
                f"of more than {longest:.4g} s, {MOST_CELLS // CELLS_PER_RADIAN} rad of the first mode: take "
                "'auxiliary' or 'energy', or kernels='certified'"
            )
        edges = self.cell * np.arange(have, max(cells, 2 * have) + 1)
        levels = [np.concatenate([self.levels[0], self.kernel.phi12_on(edges[:-1], edges[1:])])]
        while 2 ** len(levels) <= levels[0].size:
            half = 2 ** (len(levels) - 1)
            levels.append(np.maximum(levels[-1], np.append(levels[-1][half:], np.zeros(half))))
        self.levels = np.array(levels)
