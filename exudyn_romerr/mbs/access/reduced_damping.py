"""Damping of a reduced body in an mbs: its Rayleigh factors, or what ratios of the full body's modes make of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import AssumptionError, InputError

if TYPE_CHECKING:
    from ...model.body import ElasticBody

SAME_MATRICES = 1e-9  # relative; Exudyn rounds reduced matrices at 1e-13 of their largest entry
SAME_DAMPING = 1e-6  # modes are known to about 1e-9, and two solves for them may give others


def rayleigh_factors(M: np.ndarray, K: np.ndarray, D: np.ndarray) -> tuple[float, float]:
    """Return alpha, beta of D = alpha M + beta K by least squares."""
    size = np.max(np.abs(D))
    if size == 0:
        return 0.0, 0.0
    scale = np.array([np.max(np.abs(M)), np.max(np.abs(K))])
    columns = np.stack([M.ravel(), K.ravel()], axis=1) / scale
    factors = np.linalg.lstsq(columns, D.ravel() / size, rcond=None)[0]
    off = np.max(np.abs(columns @ factors - D.ravel() / size))
    if off > SAME_MATRICES:
        raise AssumptionError(
            f"damping of the body is not alpha M + beta K (off by {off:.1e} of its largest entry); the full model's "
            "damping is then unknown (ratios of the basis' modes do not tell it: the full body has others): use "
            "massProportionalDamping and stiffnessProportionalDamping, or give ratios of the full body's modes, "
            "floating_body(..., modal_damping=[...]), and call romerr.set_modal_damping(mbs, flex)"
        )
    alpha, beta = factors * size / scale
    # rounding of a factor that is zero, and nothing else, may come out negative
    return tuple(0.0 if abs(x) * s <= 1e-12 * size else float(x) for x, s in zip((alpha, beta), scale, strict=True))


def reduced_damping(body: ElasticBody, V: np.ndarray) -> np.ndarray:
    """Return V^T D V (n, n) of modes V (N, n) and a body that has ratios by mode."""
    V = body.space.coordinates("V", V)
    D = V.T @ (body.modal @ V)
    return (D + D.T) / 2


def require_modal_damping(body: ElasticBody, V: np.ndarray, D: np.ndarray) -> None:
    """InputError unless the damping D (n, n) in the mbs is that of the full body, which has ratios by mode."""
    expected = reduced_damping(body, V)
    size = np.max(np.abs(expected))
    off = np.max(np.abs(D - expected))
    if off > SAME_DAMPING * size:
        raise InputError(
            f"dampingMatrixReduced of the body is not V^T D V of modal_damping= (off by {off:.1e}, its largest entry "
            f"is {size:.1e}): call romerr.set_modal_damping(mbs, flex) once its joints are there, before the solve"
        )


def damping_text(ratios: tuple[float, ...] | float | None, rayleigh: tuple[float, float]) -> str:
    """Say how the full body is damped, for the plan."""
    if ratios is None:
        return f"damping: alpha = {rayleigh[0]:.6g} 1/s, beta = {rayleigh[1]:.6g} s"
    if isinstance(ratios, float):
        return f"damping: ratio {ratios:.6g} of all modes of the full body"
    shown = f"{min(ratios):.6g}" if min(ratios) == max(ratios) else f"{min(ratios):.6g} to {max(ratios):.6g}"
    return f"damping: ratios {shown} of the {len(ratios)} lowest modes of the full body, none above"
