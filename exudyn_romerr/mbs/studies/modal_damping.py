"""set_modal_damping: gives a floating body in an mbs the damping that ratios of its full model's modes make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import exudyn as exu
import numpy as np

from ...checks import check_type
from ...errors import InputError
from ..access.reduced_damping import reduced_damping
from ..floating.floating_body import FloatingBody, read_object
from ..floating.loads_and_joints import read_interfaces
from ..floating.reference_search import find_reference, held_body

if TYPE_CHECKING:
    from ...model.body import ElasticBody

_MADE: WeakKeyDictionary[FloatingBody, ElasticBody] = WeakKeyDictionary()  # for attach, which finds it: shared_body


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
    _MADE[flex] = body = held_body(flex, model.rayleigh, reference)
    D = reduced_damping(body, reference.of(model).held)
    mbs.SetObjectParameter(flex.number, "dampingMatrixReduced", exu.MatrixContainer(D))
    return D
