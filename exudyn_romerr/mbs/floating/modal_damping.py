"""Damping of floating bodies by ratios of the modes of their full models: set in an mbs, checked, said."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from ...checks import check_type
from ...errors import InputError
from .floating_body import FloatingBody, read_object
from .loads_and_joints import read_interfaces
from .reference_search import find_reference, held_body

if TYPE_CHECKING:
    from ...model.body import ElasticBody

SAME_DAMPING = 1e-6  # modes are known to about 1e-9, and two solves for them may give others


def set_modal_damping(mbs: Any, flex: FloatingBody) -> np.ndarray:
    """Damp a body by ratios of the modes of its full model: put V^T D V in place of its reduced damping matrix.

        D = M Phi diag(2 zeta_i omega_i) Phi^T M ,   Phi: the lowest modes of the full body as it is held in its frame

    Ratios of the modes that a basis spans would be another damping for every basis; this one is the full model's.

    Parameters
    ----------
    mbs : exudyn MainSystem
        With the body and the markers of its interfaces, which tell what holds it in its frame; before the solve,
        before or after Assemble.
    flex : FloatingBody
        From floating_body(fem, items, modal_damping=...).

    Returns
    -------
    ndarray, (n, n)
        The matrix that the body has now.

    Raises
    ------
    InputError
        flex has no modal_damping; more ratios than modes.
    AssumptionError
        What holds the body in its frame is not found; a ratio for all modes of more than 2000 coordinates.

    Notes
    -----
    Source: docs/theory.md, floating frame. Does not cover: bodies of add_reduced_body, which get the damping of their
    ElasticBody by themselves.
    """
    check_type("flex", flex, FloatingBody)
    if flex.modal_damping is None:
        raise InputError("flex has no ratios; pass modal_damping=[...] to floating_body")
    model = read_object(mbs, flex)
    reference = find_reference(flex, model.V, read_interfaces(mbs, flex))
    flex.known["damped"] = body = held_body(flex, model.rayleigh, reference)  # kept for attach: shared_body
    D = _reduced_damping(body, reference.of(model).held)
    mbs.SetObjectParameter(flex.number, "dampingMatrixReduced", exu.MatrixContainer(D))
    return D


def _reduced_damping(body: ElasticBody, V: np.ndarray) -> np.ndarray:
    """V^T D V (n, n) of modes V (N, n) and a body that has ratios by mode."""
    V = body.space.coordinates("V", V)
    D = V.T @ (body.modal @ V)
    return (D + D.T) / 2


def require_modal_damping(body: ElasticBody, V: np.ndarray, D: np.ndarray) -> None:
    """InputError unless the damping D (n, n) in the mbs is that of the full body, which has ratios by mode."""
    expected = _reduced_damping(body, V)
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
