"""Random cases of the theorem, and the check of its inequalities that the mutation tests share."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from exudyn_romerr import Basis
from tests.helpers import tolerances as tol
from tests.helpers.bodies import BODIES, DAMPINGS, model
from tests.helpers.cases import BASES, INITIALS, SAMPLING, Case, make_basis, reduced_rates
from tests.helpers.loads import LOADS, Load, load, uneven_grid

STIFF_BODIES = ("wide", "beam", "linkage")  # random columns there move so fast that few periods could be sampled
SMOOTH_BASES = ("modal", "krylov", "gramian", "petrov-static")
PETROV_GROWTH = 2.0  # exponent: a reduced Petrov-Galerkin model need not be stable


class ViolationError(AssertionError):
    """A true error above its bound."""


@dataclass(frozen=True)
class Choice:
    """Names of everything a random case is made of."""

    seed: int
    body: str
    damping: str
    basis: str
    load: str
    initial: str

    def __str__(self):
        return f"{self.seed}-{self.body}-{self.damping}-{self.basis}-{self.load}-{self.initial}"


def choice(seed):
    """Draw a combination; a case at rest without load would have no error and is not drawn."""
    rng = np.random.default_rng([seed, 7])
    body = str(rng.choice(BODIES, p=[0.3, 0.3, 0.15, 0.15, 0.1]))
    basis = str(rng.choice(SMOOTH_BASES if body in STIFF_BODIES else BASES))
    kind = str(rng.choice(LOADS))
    initial = "state" if kind == "none" else str(rng.choice(INITIALS))
    return Choice(seed, body, str(rng.choice(DAMPINGS)), basis, kind, initial)


def random_case(seed, steps=400, periods=4.0):
    """Return the Case of choice(seed), sampled finely enough for its fastest reduced mode."""
    pick = choice(seed)
    rng = np.random.default_rng([seed, 8])
    full = model(pick.body, pick.damping, seed)
    B = _inputs(full, pick, rng)
    t, basis = _sampled_basis(full, pick, B, steps, periods, rng)
    omega = full.modes[0][: basis.V.shape[1]].mean()
    u = load(pick.load, t, B.shape[1], omega, rng)
    C = rng.standard_normal((2, full.N))
    return Case(full, basis, B, t, u, pick.initial, *_start(full, basis, B, u, pick, rng), C)


def _inputs(full, pick, rng):
    B = rng.standard_normal((full.N, int(rng.integers(1, 3))))
    return full.M @ B if pick.body in STIFF_BODIES else B


def _sampled_basis(full, pick, B, steps, periods, rng):
    top = 3 if pick.body in STIFF_BODIES else full.N // 2
    while True:  # draw again until a Petrov-Galerkin model is not violently unstable
        basis = make_basis(pick.basis, full, B, int(rng.integers(1, top + 1)), rng)
        rates = reduced_rates(full, basis)
        h = 2.0 ** np.floor(np.log2(SAMPLING / np.abs(rates).max()))
        steps_needed = int(np.ceil(periods * 2 * np.pi / full.modes[0][0] / h))
        t = uneven_grid(h, min(steps, steps_needed), rng)
        if rates.real.max() * t[-1] < PETROV_GROWTH:
            return t, basis


def _start(full, basis, B, u, pick, rng):
    """Initial state of the full model: zero, in the span of V, anywhere, or its static equilibrium."""
    zero = np.zeros(full.N)
    if pick.initial == "rest":
        return zero, zero
    if pick.initial == "equilibrium":
        return la.solve(full.K, B @ u(0.0)), zero
    if pick.initial == "span":
        parts = (basis.V @ rng.standard_normal((basis.V.shape[1], 2))).T
    else:
        parts = la.solve(full.K, full.M @ rng.standard_normal((full.N, 2))).T
    return parts[0], full.modes[0][0] * parts[1]


def first_mode_case(damping, pulse=True, start=None, seed=0):
    """The basis lacks the first mode and only that is excited: bounds are nearly attained.

    pulse: a short force on the first mode; start: "q0" or "q0_t" gives the first mode as initial error.
    """
    full = model("pencil", damping, seed)
    omega, shapes = full.modes
    h = 2.0 ** np.floor(np.log2(SAMPLING / omega[3] / 4))  # the spectrum's kernel rises within its lag intervals
    t = h * np.arange(int(1.5 * np.pi / omega[0] / h))
    values = np.interp(t, t[[0, 2, 4]], [0, 1, 0])[:, None] * pulse
    state = [shapes[:, 0] * (start == "q0"), shapes[:, 0] * omega[0] * (start == "q0_t")]
    B, initial = full.M @ shapes[:, :1], "rest" if start is None else "state"
    return Case(full, Basis(shapes[:, 1:4]), B, t, Load(t, values), initial, *state, B.T)


def check_theorem(case, estimators=("fast", "convolution"), **options):
    """Assert |e|_M, |e'|_M and |C e| <= their bounds at every time, and convolution <= fast; return effectivities.

    Sampled bounds take R as linear between samples; what that leaves open is the change of "fast", which is C12 times
    the integral of |R|, when the step is halved (Richardson: the error left is a third of it): below 1 %.
    """
    asked = tuple(dict.fromkeys(("fast", *estimators)))
    fine, coarse = (case.report(stride, estimators=asked, **options) for stride in (1, 2))
    effectivity = {}
    for what, truth, rounding in truths(case):
        for e in estimators:
            name, bound = f"{what} by {e}", series(fine, what, e)
            integral = "fast" if e == "convolution" else e
            gap = sampling_gap(series(fine, what, integral), series(coarse, what, integral), rounding, name)
            check_bound(truth, bound, rounding + gap, name)
            if np.max(truth) > tol.MEANINGFUL * rounding:
                effectivity[what, e] = np.max(bound) / np.max(truth)
    if "fast" in estimators and "convolution" in estimators:
        check_order(fine)
    return effectivity


def sampling_gap(bound, coarse, rounding, name):
    """|coarse - bound| at every sample (in the middle of a coarse step: at its end); assert that it is below 1 %."""
    gap = np.abs(coarse - bound[::2])
    changed, size = np.max(gap), np.max(bound) + rounding
    assert changed <= tol.HALVED_STEP * size, (
        f"{name}: halving the step changes the bound {size:.3e} by {changed:.1e}"
    )
    return np.repeat(gap, 2, axis=0)[1:]


def check_bound(truth, bound, allowed, name):
    """Truth (T, ...) <= bound + allowed at every time."""
    excess = truth - bound - allowed
    worst = np.unravel_index(np.argmax(excess), excess.shape)
    if excess[worst] > 0:
        raise ViolationError(f"{name}: true {truth[worst]:.6e} > bound {bound[worst]:.6e} at sample {worst}")


def check_order(report):
    """(23): convolution <= fast at every time, positions and outputs."""
    for what in ("position", "y"):
        slow, fast = series(report, what, "convolution"), series(report, what, "fast")
        assert np.all(slow <= fast * (1 + tol.SUMS))


def truths(case):
    """(name, true error over the fine samples, rounding in it)."""
    e, e_t = case.errors
    rounding = truth_rounding(case)
    rows = np.sqrt(np.max(np.diag(case.C @ la.solve(case.model.M, case.C.T))))
    return (
        ("position", mass_norm(case.model.M, e), rounding / case.model.modes[0][0]),
        ("velocity", mass_norm(case.model.M, e_t), rounding),
        ("y", np.abs(e @ case.C.T), rounding / case.model.modes[0][0] * rows),
        ("v", np.abs(e_t @ case.C.T), rounding * rows),
    )


def truth_rounding(case):
    """Rounding of velocities in the M-norm: a share of the largest energy norm of both solutions."""
    M, K, V = case.model.M, case.model.K, case.basis.V
    pairs = (case.full[:2], case.reduced[:2] @ V.T)
    energy = max(np.max(np.hypot(mass_norm(K, q), mass_norm(M, q_t))) for q, q_t in pairs)
    omega = case.model.modes[0]
    return energy * (tol.PROPAGATED + tol.PENCIL * (omega[-1] / omega[0]) ** 2)


def series(report, what, e):
    """Bound of one of the truths over the samples of a report."""
    if what in ("y", "v"):
        return report.output(what).bound[e]
    return {"position": report.position_bound, "velocity": report.velocity_bound}[what][e]


def mass_norm(M, x):
    """|x_k|_M of every row."""
    return np.sqrt(np.einsum("ti,ij,tj->t", x, M, x))
