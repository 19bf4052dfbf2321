"""Admissible decay rates r of the energy bound (theory.md 3): D - 2 r M >= 0 and K - r D + r^2 M > 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...linalg.eigenmodes import GAP, ModalDamping
from ...linalg.oscillator import largest_decay_rate
from ...model.body import ElasticBody

SHARES = (0.0, 0.5, 0.9)  # of the largest admissible rate: 0 is best for short runs, 0.9 for long ones


class DecayRate(NamedTuple):
    """One admissible rate r (1/s) and what follows from |d|_{K_r} <= g.

    |d|_K <= c g, |d|_M <= per_mass g (s), |e'|_M <= velocity g.
    """

    r: float
    c: float
    per_mass: float
    velocity: float


def rayleigh_rates(*parts: tuple[float, float, float]) -> list[DecayRate]:
    """Return rates for modes of some parts, in each all with angular frequency >= omega under D = alpha M + beta K.

    parts : (omega, alpha, beta) of each; what is admissible for all of them.
    """
    omega, alpha, beta = np.array(parts, dtype=float).T
    limit, found = min(largest_decay_rate(*part) for part in parts), []
    for r in (limit * np.array(SHARES if limit > 0 else SHARES[:1])).tolist():
        kappa = omega**2 - (alpha + beta * omega**2) * r + r**2  # the lowest with K_r - kappa M >= 0
        c = np.sqrt(np.maximum(omega**2 / kappa, 1 / (1 - beta * r)))
        found.append(DecayRate(r, *(float(x.max()) for x in (c, 1 / np.sqrt(kappa), np.sqrt(1 + r**2 / kappa)))))
    return found


def modal_rates(damping: ModalDamping) -> list[DecayRate]:
    """Return rates for all modes where the lowest have ratios of their own: what is admissible for each of them."""
    omega, cut = damping.modes.omega * (1 - GAP), damping.modes.cut
    parts = [(w, 2 * zeta * w, 0.0) for w, zeta in zip(omega.tolist(), damping.ratios.tolist(), strict=True)]
    return rayleigh_rates(*parts, *([(cut, *damping.rayleigh)] if np.isfinite(cut) else []))


def body_rates(body: ElasticBody) -> list[DecayRate]:
    """Return rates for the whole body; of a damping matrix r = 0 alone, as of none."""
    omega = float(body.modes(1).omega[0]) * (1 - GAP)
    if body.modal is not None:
        return modal_rates(body.modal)
    return rayleigh_rates((omega, *(body.rayleigh or (0.0, 0.0))))
