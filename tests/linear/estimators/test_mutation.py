"""Mutations of the package that would make bounds too small: the check of test_theorem_paper must notice each."""

from dataclasses import replace

import numpy as np
import pytest

from exudyn_romerr import Basis
from exudyn_romerr.linear.estimators.paper import Convolution, Fast, MassNormEstimator
from exudyn_romerr.linear.residual.kernels import CertifiedKernel, LagTable
from exudyn_romerr.linear.residual.residual import OutputNorms
from tests.helpers.bodies import Model, model
from tests.helpers.cases import Case
from tests.helpers.loads import Load
from tests.helpers.theorem import ViolationError, check_theorem, first_mode_case, random_case

PAPER = ("fast", "convolution")
RANDOM = [random_case(seed, steps=120) for seed in range(40)]
PULSE, DISPLACED, PUSHED = (
    first_mode_case("under"),
    first_mode_case("under", pulse=False, start="q0"),
    first_mode_case("under", pulse=False, start="q0_t"),
)


BRIEF_PULSE = replace(PULSE, t=PULSE.t[:60])


def violated(cases, estimators=PAPER, **options):
    """Number of cases whose true error exceeds a bound."""
    return sum(_is_violated(case, estimators, options) for case in cases)


def _is_violated(case, estimators, options):
    try:
        check_theorem(case, estimators, **options)
    except ViolationError:
        return True
    except AssertionError:  # a mutation may also break what the check asserts of its own samples: does not count
        return False
    return False


def free_motion(full, basis, q0, t):
    """Case without load from rest at q0, the first two coordinates as outputs."""
    load = Load(t, np.zeros((len(t), 1)))
    return Case(full, basis, np.ones((full.N, 1)), t, load, "state", q0, 0 * q0, np.eye(full.N)[:2])


def too_fast_case():
    """Petrov-Galerkin: V is nearly the first mode, but W makes it move with the last one's frequency."""
    full = model("pencil", "none", 3)
    shapes = full.modes[1]
    V, W = shapes[:, :1] + 0.05 * shapes[:, -1:], full.M @ shapes[:, -1:]
    return free_motion(full, Basis(V, W), V[:, 0], 2.0**-11 * np.arange(100))


def amplified_case():
    """A strong damper across two modes turns the stiff one's displacement into a larger one: |Phi11|_M > 10."""
    K, damper = np.diag([1.0, 1e4, 25.0]), np.array([0.01, 1.0, 0.0])
    full = Model("amplifier", np.eye(3), 1e6 * np.outer(damper, damper), K, None)
    return free_motion(full, Basis(np.eye(3)[:, 2:]), np.eye(3)[1], 2.0**-9 * np.arange(3000))


def test_nothing_is_violated_without_mutation():
    """Otherwise the tests below would prove nothing."""
    for case in (*RANDOM, PULSE, DISPLACED, PUSHED, too_fast_case(), amplified_case()):
        check_theorem(case, PAPER)
    check_theorem(BRIEF_PULSE, PAPER, kernels="spectrum")


@pytest.mark.parametrize("dropped", ["M V", "K V", "B", "D V"])
def test_dropping_a_column_block_of_the_residual(dropped, monkeypatch):
    """One term of R = M V qr'' + D V qr' + K V qr - B u missing; D V has its own columns for general damping."""
    original = MassNormEstimator.__init__

    def mutated(self, problem):
        original(self, problem)
        norm, slot = self.norm, slot_of(dropped, problem.map.coordinates)
        self.norm = lambda z: norm(without(z, slot))

    monkeypatch.setattr(MassNormEstimator, "__init__", mutated)
    assert violated([*RANDOM, PULSE, too_fast_case()]) >= 1


def slot_of(dropped, layout):
    """Entries of z that multiply a block."""
    damping = slice(layout.n, layout.n * (1 + layout.has_damping))
    return {"M V": layout.mass_slot, "K V": layout.stiffness_slot, "B": layout.input_slot, "D V": damping}[dropped]


def without(z, slot):
    """A copy of z with these entries zero."""
    z = np.array(z)
    z[..., slot] = 0.0
    return z


@pytest.mark.parametrize("e", PAPER)
@pytest.mark.parametrize("case", [PULSE, PUSHED], ids=["pulse", "pushed"])
def test_halving_C12(case, e, monkeypatch):
    """C12 = max|Phi12|, and the amplitudes of its envelopes, are attained."""
    original = CertifiedKernel._set_rates

    def halved(self, *rates):
        original(self, *rates)
        self.C12, self.cap = self.C12 / 2, self.cap / 2
        self.envelopes = [(amplitude / 2, rate) for amplitude, rate in self.envelopes]

    monkeypatch.setattr(CertifiedKernel, "_set_rates", halved)
    assert violated([case], estimators=(e,)) == 1


@pytest.mark.parametrize("e", PAPER)
def test_halving_C11(e, monkeypatch):
    """C11 = 1 is attained by an initial displacement."""
    monkeypatch.setattr(CertifiedKernel, "phi11", lambda self, t: 0.5 + 0 * np.asarray(t))
    original = Fast.__init__

    def halved(self, problem):
        original(self, problem)
        self.kernel.C11 = 0.5

    monkeypatch.setattr(Fast, "__init__", halved)
    assert violated([DISPLACED], estimators=(e,)) == 1


def test_halving_C2(monkeypatch):
    """C2 is attained by the first mode's own coordinate as output."""
    C2 = OutputNorms.C_M.func
    monkeypatch.setattr(OutputNorms, "C_M", property(lambda self: C2(self) / 2))
    assert violated([PULSE]) == 1


@pytest.mark.parametrize("e", PAPER)
def test_forgetting_a_load(e):
    """One column of B missing in the inputs, though the body feels it."""
    two = [case for case in RANDOM if case.B.shape[1] == 2]
    forgotten = sum(violated([case], estimators=(e,), inputs=case.B * [1.0, 0.0]) for case in two)
    assert forgotten >= 1
    assert violated([PULSE], estimators=(e,), inputs=0 * PULSE.B) == 1


def test_a_plain_trapezoid_of_the_kernel(monkeypatch):
    """Ct12(0) = 0 and R(0) = 0 give zero at the first sample: end values are no bound."""

    def trapezoid(self, block):
        ends, lengths, added = self.history
        self.history = ends, lengths, added = tuple(
            map(np.concatenate, zip(self.history, (block.t, block.h, self.norm(block.c)), strict=True))
        )
        lag = np.maximum(block.t[:, None] - ends, 0.0)
        past = ends <= block.t[:, None]
        kernel = self.kernel.phi12(np.stack([lag + lengths, lag], axis=-1))
        return np.einsum("ts,tsj,sj->t", past, kernel, added * lengths[:, None] / 2)

    def reset(self):
        self.sums, self.history = [], (np.zeros(0), np.zeros(0), np.zeros((0, 2)))

    monkeypatch.setattr(Convolution, "_by_history", trapezoid)
    monkeypatch.setattr(Convolution, "_reset", reset)
    assert violated([BRIEF_PULSE], kernels="spectrum", estimators=("convolution",)) == 1


def test_an_end_value_of_the_kernel(monkeypatch):
    """Ct12 at the near end of the lag interval instead of its maximum there."""
    monkeypatch.setattr(LagTable, "__call__", lambda self, lo, hi: self.kernel.phi12(lo))
    assert violated([BRIEF_PULSE], kernels="spectrum", estimators=("convolution",)) == 1


@pytest.mark.parametrize("e", PAPER)
@pytest.mark.parametrize("case", [DISPLACED, PUSHED], ids=["displaced", "pushed"])
def test_dropping_the_initial_error(case, e):
    """The full body starts off the span of V, but the bound does not know."""
    assert violated([case], estimators=(e,), initial=None) == 1


def test_taking_C11_as_1_without_modal_damping(monkeypatch):
    """|Phi11|_M <= 1 holds for modal damping only: refused by the kernel, and wrong if it were not."""
    original = CertifiedKernel.__init__

    def careless(self, body):
        original(self, body)
        self.C11 = 1.0

    monkeypatch.setattr(CertifiedKernel, "__init__", careless)
    assert violated([amplified_case()]) == 1
