"""Meshes of three nodes a marker, on which markers move as they do on all the nodes of their interfaces.

MarkerSuperElementRigid goes through all its nodes, and all modes of each, whenever it is asked: a spring at an
interface of 54 nodes costs 9 times what it does at three. It moves with the weighted mean of displacements and of
x_i x u_i, and nothing else of the mesh is in the equations of ObjectFFRFreducedOrder.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..access.mbs_items import FFRF

RIGID, POSITION = "SuperElementRigid", "SuperElementPosition"
WITHOUT_NODES = ("BodyMass", "ObjectODE2Coordinates")  # markers that no node moves
# around their middle, of mean square distance 1
TRIANGLE = np.array([[1.0, 0.0, 0.0], [-0.5, 0.75**0.5, 0.0], [-0.5, -(0.75**0.5), 0.0]])
WHOLE = 1e-12  # sums of weights are 1 but for rounding


def lightened(body: dict[str, Any], markers: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return what an ObjectFFRFreducedOrder has of such a mesh; its markers, all that it has, are changed to it.

    Empty, and markers as they are, where one of them moves in another way.
    """
    if body["objectType"] != FFRF or not all(map(_is_known, markers)):
        return {}
    x, V = np.reshape(body["referencePositions"], (-1, 3)), np.asarray(body["modeBasis"])
    V = V.reshape(len(x), 3, -1)
    places, shapes = [], []
    for marker in (one for one in markers if one["markerType"] not in WITHOUT_NODES):
        nodes, weights = (np.array(marker[key]) for key in ("meshNodeNumbers", "weightingFactors"))
        x_own, V_own, weights = _light(marker["markerType"] == RIGID, x[nodes], V[nodes], weights)
        marker["meshNodeNumbers"] = [*range(len(places), len(places) + len(x_own))]
        marker["weightingFactors"] = weights
        places += [*x_own]
        shapes += [*V_own]
    if not places:
        return {}
    return {"referencePositions": np.ravel(places), "modeBasis": np.concatenate(shapes)}


def _is_known(marker: dict[str, Any]) -> bool:
    if marker["markerType"] in WITHOUT_NODES:
        return True
    if marker["markerType"] not in (RIGID, POSITION) or abs(np.sum(marker["weightingFactors"]) - 1) > WHOLE:
        return False
    return marker["markerType"] == POSITION or marker["useAlternativeApproach"]


def _light(turns: bool, x: np.ndarray, V: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, ...]:
    """Nodes x (k, 3), their modes (k, 3, n) and weights (k,) that move a marker as all of its nodes do."""
    if len(x) <= (len(TRIANGLE) if turns else 1):
        return x, V, weights
    middle, move = weights @ x, np.tensordot(weights, V, axes=1)
    if not turns:
        return middle[None], move[None], np.ones(1)
    arms = x - middle
    squares = arms.T @ (weights[:, None] * arms)
    inertia = np.trace(squares) * np.eye(3) - squares
    turn = np.linalg.solve(inertia, np.einsum("i,ijn->jn", weights, np.cross(arms[:, :, None], V, axis=1)))
    corners = np.sqrt(np.trace(squares)) * TRIANGLE
    return middle + corners, move + np.cross(turn[None], corners[:, :, None], axis=1), np.full(3, 1 / 3)
