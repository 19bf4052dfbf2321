"""Bodies of a script with vectors beside their modes: vectors to take, and bodies widened where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...basis.shape_sums import ShapeSums
from ...errors import InputError
from ..access.copied_mbs import object_terms, widened_node
from ..access.mbs_items import dense
from ..floating.built_in import add_weight, built_in, has_functions
from ..floating.floating_body import floating_body, rayleigh_factors
from ..floating.reference_search import VECTORS, seen_body

if TYPE_CHECKING:
    from .found_bodies import FoundBody


class Vectors(NamedTuple):
    """Vectors P (N, m) beside a body's modes; keeps (m,): those that leave interfaces as rigid as the modes do."""

    P: np.ndarray
    keeps: np.ndarray


def vectors_of(mbs: Any, body: FoundBody) -> Vectors:
    """Return what the modes of a body miss most, as estimates take it; the mbs is assembled.

    Raises
    ------
    InputError, AssumptionError
        The body cannot be read.
    """
    if body.fem is None:
        raise InputError("its FE model is gone")
    known, _ = seen_body(mbs, floating_body(body.fem, body.items(mbs)))
    found, _ = known.enrichment(VECTORS)
    return Vectors(known.held.space.expand(found.P), found.keeps)


def widen(mbs: Any, body: FoundBody, P: np.ndarray) -> None:
    """Give a body of an mbs, before it is assembled, vectors beside its modes.

    What had user functions has the built-in equations then, and a load that is its weight.

    Raises
    ------
    InputError
        The vectors are of another mesh.
    AssumptionError
        The damping of the body is not Rayleigh's: that of the vectors is not known.
    """
    item, fem, gravity = mbs.GetObject(body.number), body.fem, np.zeros(3)
    if has_functions(item):
        item, gravity = built_in(mbs, floating_body(fem, body.items(mbs)))
    V = np.asarray(item["modeBasis"], dtype=float)
    if len(P) != len(V):
        raise InputError(
            f"vectors have {len(P)} coordinates, the body {len(V)}: the script makes another body each time"
        )
    n = V.shape[1]
    M, K, D = (dense(item[f"{name}MatrixReduced"], n) for name in ("mass", "stiffness", "damping"))
    alpha, beta = rayleigh_factors(M, K, D)
    U = np.hstack([V, P])
    sums = ShapeSums.of(
        fem.GetMassMatrix(sparse=True), fem.GetStiffnessMatrix(sparse=True), fem.GetNodePositionsAsArray(), U
    )
    damping = alpha * sums.M + beta * sums.K
    node, more = int(item["nodeNumbers"][1]), P.shape[1]
    mbs.ModifyNode(node, widened_node(mbs.GetNode(node), more))
    mbs.ModifyObject(body.number, {**item, **object_terms(U, sums, damping), **_stress_modes(item, n, more)})
    if gravity.any():
        add_weight(mbs, body.number, gravity)


def _stress_modes(item: dict[str, Any], n: int, more: int) -> dict[str, Any]:
    """The vectors have none, so that stresses of sensors are those of the script's modes alone."""
    names = ("outputVariableModeBasis", "outputVariableTypeModeBasis")
    basis, kind = (item[name] for name in names)
    basis = np.asarray(basis, dtype=float)
    wide = np.hstack([basis, np.zeros((len(basis), basis.shape[1] // n * more))]) if basis.size else basis
    return dict(zip(names, (wide, kind), strict=True))
