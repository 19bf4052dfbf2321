"""Norms of the fundamental matrix: certified >= spectrum, envelopes, lag intervals, the matrix exponential."""

from functools import cache

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr import AssumptionError, ElasticBody
from exudyn_romerr.linalg import oscillator
from exudyn_romerr.linear.residual.kernels import (
    CertifiedKernel,
    EnvelopeKernel,
    LagTable,
    SpectrumKernel,
    make_kernel,
)
from tests.helpers import tolerances as tol

KINDS = ("undamped", "under", "critical", "overdamped", "mixed", "mass", "stiffness")
SPECTRA_PER_KIND = 300
ON_THE_EDGE = (1 - 1e-12, 1.0, 1 + 1e-12)


def spectrum_body(omega, alpha, beta):
    """Uncoupled modes of unit mass."""
    return ElasticBody(np.eye(len(omega)), np.diag(np.asarray(omega) ** 2), rayleigh=(alpha, beta))


def random_spectrum(kind, rng):
    """(omega, alpha, beta), frequencies over up to four decades."""
    omega = np.sort(10 ** rng.uniform(-2, 2) * 10 ** rng.uniform(0, rng.uniform(0.1, 4), 8))
    low, z = omega[0], 10 ** rng.uniform(-4, -0.1)
    edge = rng.choice(ON_THE_EDGE)
    alpha, beta = {
        "undamped": (0.0, 0.0),
        "under": (z * low, z / omega[-1]),
        "critical": ((2 * low * edge, 0.0), (0.0, 2 / low * edge))[rng.integers(0, 2)],
        "overdamped": (2 * low * rng.uniform(1, 9), rng.uniform(0, 5) / low),
        "mixed": (2 * z * low, 2 * rng.uniform(0.2, 2) / np.sqrt(omega[0] * omega[-1])),
        "mass": (2 * low * 10 ** rng.uniform(-3, 1), 0.0),
        "stiffness": (0.0, 2 / low * 10 ** rng.uniform(-4, 1)),
    }[kind]
    return omega, float(alpha), float(beta)


@cache
def spectra(kind):
    """Seeded random spectra of a kind, as bodies."""
    rng = np.random.default_rng([KINDS.index(kind), 1])
    return [spectrum_body(*random_spectrum(kind, rng)) for _ in range(SPECTRA_PER_KIND)]


def telling_times(body):
    """Log-spaced times, every mode's peak and its near side."""
    omega = body.all_modes().omega
    peaks = oscillator.peak_time(omega, body.damping_ratios(omega))
    return np.concatenate([[0.0], np.geomspace(1e-3 / omega[-1], 1e3 / omega[0], 150), peaks, peaks * (1 + 1e-6)])


@pytest.mark.parametrize("kind", KINDS)
def test_certified_is_above_every_mode_at_every_time(kind):
    """|Phi11(t)|_M and |Phi12(t)|_M of the certified kernel bound those of all modes; C12 by 1.5 at most."""
    for body in spectra(kind):
        t, kernel, omega = telling_times(body), CertifiedKernel(body), body.all_modes().omega[:, None]
        zeta, room = body.damping_ratios(omega), 1 + tol.CLOSED_FORM
        phi11 = np.max(np.abs(oscillator.step_release(omega, zeta, t)), axis=0)
        phi12 = np.max(np.abs(oscillator.impulse_response(omega, zeta, t)), axis=0)
        bound = kernel.phi12(t)
        assert np.all(phi11 <= kernel.phi11(t) * room + 1e-300)  # 1e-300: below it floats lose digits
        assert np.all(phi12 <= bound * room + 1e-300)
        assert np.all(bound <= kernel.C12 * room)
        assert 1 - tol.CLOSED_FORM <= kernel.C12 / SpectrumKernel(body).C12 < tol.CERTIFIED_FACTOR
        for amplitude, rate in kernel.envelopes:
            assert np.all(phi12 <= amplitude * np.exp(-rate * t) * room + 1e-300)


@pytest.mark.parametrize("zeta", [0.0, 1e-9, 0.3, *ON_THE_EDGE, 1 + 1e-6, 4.0, 1e3])
def test_oscillator_closed_forms(zeta):
    """S and p against the exponential of the scaled 2 x 2 matrix, and the peak against a dense search."""
    omega, t = 3.0, np.geomspace(1e-4, 8, 200) / 3.0
    Phi = la.expm(omega * t[:, None, None] * np.array([[0.0, 1.0], [-1.0, -2 * zeta]]))
    allowed = tol.EXPM * max(1.0, zeta)
    assert np.max(np.abs(oscillator.impulse_response(omega, zeta, t) * omega - Phi[:, 0, 1])) < allowed
    assert np.max(np.abs(oscillator.step_release(omega, zeta, t) - Phi[:, 0, 0])) < allowed
    peak = oscillator.peak_time(omega, zeta)
    near = oscillator.impulse_response(omega, zeta, peak * np.linspace(0.5, 1.5, 2001))
    largest = oscillator.largest_impulse_response(omega, zeta)
    assert near.max() == pytest.approx(largest, rel=tol.CLOSED_FORM)
    assert np.argmax(near) == 1000 or zeta > 100  # a plateau, when overdamped that much


@pytest.mark.parametrize(
    ("make", "kind"),
    [
        *((make, kind) for make in (SpectrumKernel, CertifiedKernel) for kind in ("undamped", "under", "mixed")),
        *((EnvelopeKernel, kind) for kind in ("undamped", "under")),
    ],
)
def test_maximum_over_a_lag_interval(make, kind):
    """phi12_on(lo, hi) >= phi12 everywhere in the interval; for the spectrum it is that maximum."""
    rng = np.random.default_rng(3)
    for body in spectra(kind)[:40]:
        kernel = make(body)
        lo, length = rng.uniform(0, 6, 40) / kernel.omega_1, 10 ** rng.uniform(-3, 0.5, 40) / kernel.omega_1
        found = kernel.phi12_on(lo, lo + length)
        dense = kernel.phi12(lo + length * np.linspace(0, 1, 401)[:, None]).max(axis=0)
        assert np.all(dense <= found * (1 + tol.CLOSED_FORM))
        if make is SpectrumKernel:
            missed = (length / 400 * body.modes(8).omega[-1]) ** 2 / 8  # of a peak between two dense points
            assert np.all(found <= dense * (1 + tol.CLOSED_FORM) + np.minimum(missed, 1.0) * kernel.C12)


@pytest.mark.parametrize("kind", KINDS)
def test_lag_table_is_never_below_the_kernel(kind):
    """Rounded outwards to whole cells: >= the maximum over the interval, and < the one over two cells more."""
    rng = np.random.default_rng(4)
    for body in spectra(kind)[:20]:
        kernel = SpectrumKernel(body)
        table = LagTable(kernel)
        lo = rng.uniform(0, 8, (5, 20)) / kernel.omega_1
        hi = lo + np.where(rng.random((5, 20)) < 0.2, 0.0, 10 ** rng.uniform(-3, 0.5, (5, 20))) / kernel.omega_1
        exact, wide = kernel.phi12_on(lo, hi), kernel.phi12_on(np.maximum(lo - table.cell, 0), hi + table.cell)
        found = table(lo, hi)
        assert np.all(exact <= found * (1 + tol.CLOSED_FORM))
        assert np.all(found <= wide * (1 + tol.CLOSED_FORM))


def test_the_papers_envelope_fails_where_the_first_mode_decays_fastest():
    """a_1 = 0.9 > 1/beta = 0.556: an overdamped mode outlives the envelope by a factor above 1e6; refused."""
    body = spectrum_body(np.geomspace(1, 1e3, 12), 0.0, 1.8)
    envelope, t = EnvelopeKernel(body), np.linspace(0, 60, 400)
    assert not envelope.certified
    assert np.max(SpectrumKernel(body).phi12(t) / envelope.phi12(t)) > 1e6
    assert np.all(SpectrumKernel(body).phi12(t) <= CertifiedKernel(body).phi12(t) * (1 + tol.CLOSED_FORM))
    with pytest.raises(AssumptionError, match=r"1/beta.*kernels='certified'"):
        make_kernel(body, "envelope")


@pytest.mark.parametrize("kind", ["undamped", "under", "mass"])
def test_the_papers_envelope_is_a_bound_otherwise(kind):
    """a_1 <= 1/beta and zeta_1 < 1: above the spectrum at every time, for Phi11 and Phi12."""
    checked = 0
    for body in spectra(kind):
        if body.damping_ratios(body.modes(1).omega)[0] >= 1:
            with pytest.raises(AssumptionError, match="underdamped"):
                EnvelopeKernel(body)
            continue
        envelope, spectrum, t = EnvelopeKernel(body), SpectrumKernel(body), telling_times(body)
        assert envelope.certified
        assert np.all(spectrum.phi12(t) <= envelope.phi12(t) * (1 + tol.CLOSED_FORM) + 1e-300)
        assert np.all(spectrum.phi11(t) <= envelope.phi11(t) * (1 + tol.CLOSED_FORM) + 1e-300)
        checked += 1
    assert checked > 50
