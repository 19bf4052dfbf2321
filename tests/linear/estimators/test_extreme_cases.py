"""Extreme cases (models/extreme.py): every bound is one, is as sharp as stated, or there is a refusal that helps."""

import re

import mpmath
import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.linalg.modal_oscillators import SEPARATE, phi_functions
from models import extreme
from models import extreme_bodies as bodies
from models.precise import DIGITS, PreciseModes

CASES = extreme.cases()
BOUNDS = [case for case in CASES if isinstance(case, extreme.Case)]
REFUSALS = [case for case in CASES if isinstance(case, extreme.Refusal)]
# The truth itself has 50 digits: at t = 0 what is zero differs from zero by 1e-50 of other displacements, and the
# output may be 1e-3 of them.
OF_FIFTY_DIGITS = 1e-40
# Frequencies and shapes: some sums of 6 to 18 products, each rounded at 1e-16 of the entries it adds up. K of these
# bodies loses nothing in its factorisation: cond(K) scaled to a unit diagonal is below 1e3.
TO_THE_DIGITS = 1e-14


LONG = "1e6 steps, 1e5 periods"  # as much as all others


def named(cases):
    return [case.name for case in cases]


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=pytest.mark.slow if case.name == LONG else ()) for case in BOUNDS],
    ids=named(BOUNDS),
)
def test_bounds_hold_and_are_as_sharp_as_stated(case):
    """Displacement and velocity, every estimator and the corrected output: |error| <= bound + round-off."""
    row = extreme.measured(case)
    wrong = {what: excess for what, excess in row.excess.items() if not excess <= OF_FIFTY_DIGITS}
    assert not wrong
    assert row.effectivity <= case.limit
    assert re.search(case.says, row.text)
    assert len(row.excess) >= 6  # y and v by at least one estimator, the best and the corrected one


@pytest.mark.parametrize("case", REFUSALS, ids=named(REFUSALS))
def test_what_has_no_bound_is_refused_with_a_reason(case):
    """The text names what was found."""
    assert re.search(case.says, extreme.measured(case).text)


SPECTRA = {
    "light mass 1e9": bodies.light_mass(1e9),
    "graded 1e3": bodies.graded(1e3),
    "graded 1e6": bodies.graded(1e6),
    "graded 1e9": bodies.graded(1e9),
    "graded 1e9, 12 coordinates": bodies.graded(1e9, 12),
    "straight beam 1e7": bodies.slender_beam(1e7, turned=False),
    "multiple": bodies.multiple(),
}


@pytest.mark.parametrize("name", SPECTRA)
def test_all_modes_have_all_digits(name):
    """Every frequency, and M-orthonormal shapes, in bodies of frequency ratios up to 1e9; 50 digits are the truth.

    LAPACK alone left nan, or the rounding of the lowest mode times the squared ratio: 1e-11 at a ratio of 500.
    """
    M, K = SPECTRA[name]
    modes = romerr.ElasticBody(M, K).all_modes()
    squares = PreciseModes(M, K, (0.0, 0.0), np.zeros(len(M)), 1.0).squares
    with mpmath.workdps(DIGITS):
        off = [
            abs(float(mpmath.mpf(w) / mpmath.sqrt(x) - 1)) for w, x in zip(modes.omega.tolist(), squares, strict=True)
        ]
    assert max(off) < TO_THE_DIGITS
    assert np.abs(modes.shapes.T @ M @ modes.shapes - np.eye(len(M))).max() < TO_THE_DIGITS


@pytest.mark.parametrize("zeta", [1.05, 1.2, 100.0, 1e4])
@pytest.mark.parametrize("fast", [0.3, 3.0, 3000.0])
def test_a_slow_root_keeps_its_digits_beside_a_fast_one(zeta, fast):
    """The slow motion of one step, whatever its fast root: doublings multiplied its rounding by that root."""
    with mpmath.workdps(2 * DIGITS):  # the recursion loses nine digits in each of its six steps
        w = mpmath.mpf(fast / (zeta + np.sqrt((zeta - 1) * (zeta + 1))))
        slow = -w / (zeta + mpmath.sqrt(mpmath.mpf(zeta) ** 2 - 1))
        expected = [mpmath.exp(slow)]  # phi_k = (phi_k-1 - 1/(k - 1)!)/r at the root
        for k in range(1, 7):
            expected.append((expected[-1] - 1 / mpmath.factorial(k - 1)) / slow)
    phis = phi_functions(np.array([float(w)]), np.array([zeta]), 6)
    found = [a[0] + b[0] * float(slow) for a, b in phis]
    # some roundings; where both roots are near one another doublings multiply them by the fast one
    allowed = 1e-15 if zeta > SEPARATE else 1e-15 * max(fast, 1)
    np.testing.assert_allclose(found, np.array(expected, dtype=float), rtol=allowed, atol=1e-300)
