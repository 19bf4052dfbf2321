"""Copies of an mbs, of what GetNode, GetObject, GetMarker and GetLoad give: its equations, in states of our own.

Exudyn's GetDictionary refuses objects with user functions. The mbs that is copied is read, and nothing else.

Meshes have three nodes a marker then, on which markers move as they do on all the nodes of their interfaces:
MarkerSuperElementRigid goes through all its nodes, and all modes of each, whenever it is asked, and a spring at an
interface of 54 nodes costs 9 times what it does at three. It moves with the weighted mean of displacements and of
x_i x u_i, and nothing else of the mesh is in the equations of ObjectFFRFreducedOrder.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np

from .mbs_items import FFRF, Items

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ...basis.shape_sums import ShapeSums
    from .detached import Detached

RIGID, POSITION = "SuperElementRigid", "SuperElementPosition"
COORDINATES = ("referenceCoordinates", "initialCoordinates", "initialCoordinates_t")  # of nodes
WITHOUT_NODES = ("BodyMass", "ObjectODE2Coordinates")  # markers that no node moves
# around their middle, of mean square distance 1
TRIANGLE = np.array([[1.0, 0.0, 0.0], [-0.5, 0.75**0.5, 0.0], [-0.5, -(0.75**0.5), 0.0]])
# types that GetObject calls otherwise than AddObject
ADDED_AS = {"HydraulicActuatorSimple": "ConnectorHydraulicActuatorSimple"}
WHOLE = 1e-12  # sums of weights are 1 but for rounding
CROSS = np.zeros((3, 3, 3))  # (a x b)_c = CROSS_cij a_i b_j
CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]], CROSS[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0, -1.0


def copy_items(
    mbs: Any,
    to: Any,
    detached: Detached,
    wider: Mapping[int, dict[str, Any]],
    with_sensors: bool = False,
) -> None:
    """Add all items of an mbs to another one; sensors, and whole meshes, only with_sensors.

    detached : copies of the user functions, which it has then. wider : what bodies with more modes have, by number,
    that have neither mass nor stiffness there; further coordinates of their nodes are zero.
    """
    to.variables, to.sys = detached.spaces
    of = Items(mbs)
    objects = [bare(item, detached) | wider.get(i, {}) for i, item in enumerate(of.objects)]
    markers = [bare(item, detached) for item in of.markers]
    for i, item in enumerate(objects):
        if item["objectType"] == FFRF:
            on_it = [one for one in markers if int(one.get("bodyNumber", -1)) == i]
            light = {} if with_sensors else _lightened(item, on_it)
            objects[i] = item | light | ({"computeFFRFterms": False} if i in wider else {})
    counts = {int(objects[i]["nodeNumbers"][1]): np.shape(objects[i]["modeBasis"])[1] for i in wider}
    for i, item in enumerate(of.nodes):
        node = bare(item, detached)
        if i in counts:
            node = widened_node(node, counts[i] - node["numberOfODE2Coordinates"])
        to.AddNode(node)
    for item in objects:
        to.AddObject(item)
    for item in markers:
        to.AddMarker(item)
    for item in of.loads:
        to.AddLoad(bare(item, detached))
    for item in of.sensors if with_sensors else ():
        to.AddSensor(bare(item, detached) | {"storeInternal": False, "writeToFile": False})


def bare(item: dict[str, Any], detached: Detached) -> dict[str, Any]:
    """Return an item without its name and what is drawn, with copies of user functions."""
    kept = {key: value for key, value in item.items() if not (key.startswith("V") or key == "name")}
    kept = {key: ADDED_AS.get(value, value) if key == "objectType" else value for key, value in kept.items()}
    return {key: _copy(value, detached) if key.endswith("UserFunction") else value for key, value in kept.items()}


def _copy(value: Any, detached: Detached) -> Any:
    """Exudyn gives user functions as they are, or with their type in a dict."""
    if isinstance(value, dict) and "function" in value:
        return value | {"function": detached.of(value["function"])}
    return detached.of(value) if callable(value) else value


def _lightened(body: dict[str, Any], markers: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return what an ObjectFFRFreducedOrder has of such a mesh; its markers, all that it has, are changed to it.

    Empty, and markers as they are, where one of them moves in another way.
    """
    if not all(map(_is_known, markers)):
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


def widened_node(node: dict[str, Any], more: int) -> dict[str, Any]:
    """Return a node of modal coordinates with so many more, which are zero."""
    longer = {name: np.append(node[name], np.zeros(more)) for name in COORDINATES}
    return {**node, **longer, "numberOfODE2Coordinates": node["numberOfODE2Coordinates"] + more}


def object_terms(U: np.ndarray, sums: ShapeSums, damping: np.ndarray | None = None) -> dict[str, Any]:
    """Return what an ObjectFFRFreducedOrder has of a body's modes and vectors U (N, k), damping (k, k), None: zero.

    As ObjectFFRFreducedOrderInterface makes it, with M = m (x) I, so that all follows from the sums of u_i (m u)_j
    over the nodes.
    """
    of_U, of_x, pull, M, K = sums
    k = U.shape[1]
    twice = np.einsum("cd,iikl->kcld", np.eye(3), of_U) - of_U.transpose(2, 1, 3, 0)
    once = np.einsum("cd,iil->cld", np.eye(3), of_x) - of_x.transpose(1, 2, 0)
    matrices = {"mass": M, "stiffness": K, "damping": 0 * M if damping is None else damping}
    return {
        **{f"{name}MatrixReduced": exu.MatrixContainer(matrix) for name, matrix in matrices.items()},
        "modeBasis": U,
        "outputVariableModeBasis": np.zeros((0, 0)),
        "outputVariableTypeModeBasis": exu.OutputVariableType._None,
        "mPsiTildePsi": np.einsum("cij,jikl->kcl", CROSS, of_U).reshape(3 * k, k),
        "mPsiTildePsiTilde": twice.reshape(3 * k, 3 * k),
        "mPhitTPsi": pull,
        "mPhitTPsiTilde": np.einsum("cid,il->cld", CROSS, pull).reshape(3, 3 * k),
        "mXRefTildePsi": np.einsum("cij,jil->cl", CROSS, of_x),
        "mXRefTildePsiTilde": once.reshape(3, 3 * k),
    }
