"""Bodies of a script with vectors beside their modes: vectors to take, and bodies widened where they are."""

from __future__ import annotations

from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...basis.enrichment import Enrichment
from ...basis.shape_sums import ShapeSums
from ...errors import AssumptionError, InputError
from ...linear.residual.interface_stiffening import with_rigid_interfaces
from ...model.floating_frame import unit_inertia
from ..access.copied_mbs import object_terms
from ..access.mbs_items import dense
from ..floating.built_in import add_weight, built_in, has_functions
from ..floating.floating_body import floating_body, rayleigh_factors
from ..floating.reference_search import seen_body, stiff_space

if TYPE_CHECKING:
    from .found_bodies import FoundBody

COUNT = 26  # vectors beside the modes, as a mechanism's estimate begins with: more cost a run more than they tell
COORDINATES = ("referenceCoordinates", "initialCoordinates", "initialCoordinates_t")


class Vectors(NamedTuple):
    """Vectors P (N, m) beside a body's modes; keeps (m,): those that leave interfaces as rigid as the modes do."""

    P: np.ndarray
    keeps: np.ndarray


class _Wide(NamedTuple):
    shapes: np.ndarray
    sums: ShapeSums
    damping: Any


def vectors_of(mbs: Any, body: FoundBody) -> Vectors:
    """Return what the modes of a body miss most, as estimates take it; the mbs is assembled.

    Raises
    ------
    InputError, AssumptionError
        The body cannot be read.
    """
    if body.fem is None:
        raise InputError("its FE model is gone")
    flex = floating_body(body.fem, body.items(mbs))
    _, model, actions, _, full = seen_body(mbs, flex)
    Z, stiff = full.space, stiff_space(flex, model.V, actions.interfaces())
    full.modes(1)
    V = Z.coordinates("V", model.V)
    inertia = Z.loads(unit_inertia(flex.mass, flex.positions))
    none = np.zeros((full.N, 0))
    loads = Z.loads(np.hstack([none, *(load.columns for load in actions.loads)]))
    wrenches = Z.loads(np.hstack([none, *(place.columns for place in actions.wrenches)]))
    rigid = cache(lambda: None if stiff is None else with_rigid_interfaces(full, stiff))
    count = min(COUNT, V.shape[0] - V.shape[1])
    try:
        found = Enrichment(full, V, inertia, loads, wrenches, count, rigid())
    except AssumptionError:  # modes without static ones: here vectors may move interfaces, for they are real modes
        found = Enrichment(full, V, inertia, np.hstack([loads, wrenches]), wrenches[:, :0], count, rigid())
    return Vectors(Z.expand(found.P), found.keeps)


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
    wide = _Wide(U, sums, partial(_damping, alpha, beta))
    shown = {name: item[name] for name in ("outputVariableModeBasis", "outputVariableTypeModeBasis")}
    node = mbs.GetNode(int(item["nodeNumbers"][1]))
    node["numberOfODE2Coordinates"] = U.shape[1]
    for name in COORDINATES:
        node[name] = np.append(node[name], np.zeros(P.shape[1]))
    mbs.ModifyNode(int(item["nodeNumbers"][1]), node)
    mbs.ModifyObject(body.number, {**item, **object_terms(wide), **_widened(shown, n, P.shape[1])})
    if gravity.any():
        add_weight(mbs, body.number, gravity)


def _damping(alpha: float, beta: float, X: Any, Y: Any, M: np.ndarray, K: np.ndarray) -> np.ndarray:
    return alpha * M + beta * K


def _widened(shown: dict[str, Any], n: int, more: int) -> dict[str, Any]:
    """Modes of stress: the vectors have none, so that stresses of sensors are those of the script's modes alone."""
    basis = np.asarray(shown["outputVariableModeBasis"], dtype=float)
    if not basis.size:
        return shown
    per_mode = basis.shape[1] // n
    return {**shown, "outputVariableModeBasis": np.hstack([basis, np.zeros((len(basis), per_mode * more))])}
