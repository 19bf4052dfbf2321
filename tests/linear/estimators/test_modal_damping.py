"""Damping ratios by mode: the matrix that they are, bounds above the exact error, estimates that are right."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr import AssumptionError, ElasticBody, InputError
from tests.helpers.bodies import Model, model
from tests.helpers.theorem import check_theorem, random_case

MATRIX = 1e-10  # M Phi diag(d) Phi^T M of the computed modes: their residual
RATIOS = {
    "one": [0.3],
    "few": [0.02, 0.0, 0.5],
    "less than above": [0.001, 0.002],
    "overdamped": [1.5, 0.01, 3.0],
}
pytestmark = pytest.mark.filterwarnings("ignore:modal_damping has a ratio 3")


def given_body(base, ratios):
    return ElasticBody(base.M, base.K, rayleigh=base.rayleigh, modal_damping=ratios)


@dataclass(frozen=True)
class ByModes(Model):
    """D is the whole matrix, for the truth."""

    given: ElasticBody | None = None

    @property
    def body(self):
        return self.given


def damped(case, ratios):
    """The case with ratios by mode."""
    full, body = case.model, given_body(case.model, ratios)
    return replace(case, model=ByModes(full.name, full.M, body.D @ np.eye(full.N), full.K, None, body))


@pytest.mark.parametrize("ratios", [*RATIOS.values(), 0.05], ids=[*RATIOS, "all"])
@pytest.mark.parametrize("damping", ["none", "under"])
def test_ratios_are_those_of_the_modes(damping, ratios):
    """Phi^T D Phi is diagonal: 2 zeta omega, of the modes that have a ratio, and Rayleigh's of all others."""
    full = model("pencil", damping, 0)
    omega, shapes = full.modes
    body = given_body(full, ratios)
    alpha, beta = full.rayleigh
    zeta = (alpha / omega + beta * omega) / 2
    zeta[: np.size(ratios) if np.ndim(ratios) else None] = ratios
    D = shapes.T @ (body.D @ shapes)
    np.testing.assert_allclose(D, np.diag(2 * zeta * omega), rtol=0, atol=MATRIX * omega[-1])
    np.testing.assert_allclose(body.damping_ratios(omega), zeta, rtol=1e-12)
    assert body.rayleigh is None
    assert body.proportional == full.rayleigh


@pytest.mark.parametrize("name", RATIOS)
@pytest.mark.parametrize("seed", [3, 8, 20, 33])
def test_bounds_hold(seed, name):
    """The truth is a matrix exponential of the full D."""
    case = random_case(seed)
    if case.model.rayleigh is None:
        case = replace(case, model=replace(case.model, rayleigh=(0.0, 0.0)))
    estimators = ("fast", "convolution", "energy", "auxiliary")
    found = check_theorem(damped(case, RATIOS[name]), estimators, auxiliary_modes=4)
    assert {e for _, e in found} == set(estimators)  # all were compared


@pytest.mark.parametrize("seed", [8, 20])
def test_ratios_that_rayleigh_damping_has_give_its_bounds(seed):
    """The same body said in another way."""
    case = random_case(seed)
    zeta = case.model.body.damping_ratios(case.model.modes[0])
    options = {"estimators": ("energy", "auxiliary"), "auxiliary_modes": 4}
    plain, other = (x.report(**options) for x in (case, damped(case, zeta[:3])))
    for name in ("y", "v"):
        one, same = (x.output(name).bound["auxiliary"] for x in (plain, other))
        np.testing.assert_allclose(same, one, rtol=1e-6, atol=1e-9 * np.max(one))
    # one rate must suit all modes, Rayleigh's closed form is for those above a frequency: not the same, near
    ratio = other.position_bound["energy"][1:] / plain.position_bound["energy"][1:]
    assert np.all((0.3 < ratio) & (ratio < 3.0))


def test_modes_of_equal_frequency_are_those_of_the_damping():
    """Two bending planes: D names one vector of the pair, and later solves for more modes keep it."""
    K, M = np.diag([4.0, 4.0, 9.0, 9.0, 25.0, 36.0]), np.eye(6)
    Q = np.linalg.qr(np.random.default_rng(0).standard_normal((6, 6)))[0]
    body = ElasticBody(Q @ M @ Q.T, Q @ K @ Q.T, modal_damping=[0.1])
    first = body.modes(1).shapes
    modes = body.modes(4)
    np.testing.assert_array_equal(modes.shapes[:, :1], first)
    D = modes.shapes.T @ (body.D @ modes.shapes)
    np.testing.assert_allclose(D, np.diag([2 * 0.1 * 2.0, 0, 0, 0]), atol=1e-12)
    np.testing.assert_allclose(modes.shapes.T @ body.M @ modes.shapes, np.eye(4), atol=1e-12)
    assert body.modes(4).omega == pytest.approx([2, 2, 3, 3])


@pytest.mark.parametrize(
    ("ratios", "more", "kind", "message"),
    [
        ([], {}, InputError, r"modal_damping has 0 ratios; allowed: 1\.\.12"),
        ([0.1] * 13, {}, InputError, "modal_damping has 13 ratios"),
        ([0.1, -0.1], {}, AssumptionError, r"modal_damping has a ratio -0\.1: it feeds energy in"),
        ([[0.1]], {}, InputError, "modal_damping has shape"),
        ("much", {}, InputError, "modal_damping is not an array of real numbers"),
        ([0.1], {"damping": np.eye(12)}, InputError, "modal_damping and damping were both given"),
    ],
)
def test_what_is_no_ratio_is_refused(ratios, more, kind, message):
    full = model("pencil", "none", 0)
    with pytest.raises(kind, match=message):
        ElasticBody(full.M, full.K, modal_damping=ratios, **more)


def test_what_takes_rayleigh_damping_alone_says_so():
    case = damped(random_case(8), [0.1, 0.2])
    assert set(case.report().position_bound) == {"energy", "auxiliary"}  # "auto"
    for options, message in (
        ({"estimators": "state-space"}, "estimator 'state-space' need Rayleigh damping, found ratios by mode"),
        ({"estimators": "fast", "kernels": "spectrum"}, "kernels='spectrum' need Rayleigh damping, found ratios"),
    ):
        with pytest.raises(AssumptionError, match=message):
            case.report(**options)
    with pytest.raises(InputError, match=r"auxiliary_modes=1; allowed: .* 2\.\.\d+ .*; 2 have damping ratios of"):
        case.report(estimators="auxiliary", auxiliary_modes=1)
    with pytest.raises(AssumptionError, match="gramian_basis takes no ratios by mode"):
        romerr.gramian_basis(case.model.body, case.B, 2, band=(0.1, 100.0))
    assert romerr.krylov_basis(case.model.body, case.B, 2).V.shape[1] == 2


def test_ratios_above_one_are_told():
    """They may be percentages; the body is made all the same."""
    with pytest.warns(UserWarning, match=r"modal_damping has a ratio 2: above 1 .*2 % is 0\.02"):
        body = ElasticBody(np.eye(2), np.diag([1.0, 4.0]), modal_damping=[2.0, 0.5])
    np.testing.assert_array_equal(body.damping_ratios(body.modes(2).omega), [2.0, 0.5])
