"""Floating bodies: what is read of an ObjectFFRFreducedOrder, and checked against its FE model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import exudyn as exu
import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ...checks import check_array, check_choice
from ...errors import AssumptionError, InputError
from ...model.admissible_space import MassOrthogonal, MeanMotion
from ...model.floating_frame import require_isotropic_mass
from ...model.matrix_checks import checked_ratios
from ..access.mbs_items import FFRF, dense
from .frame_node import FrameNode, RigidPart

ITEMS = ("nRigidBody", "nGenericODE2", "oFFRFreducedOrder")
INTERFACES = ("free", "rigid")
OLDEST = (1, 13)  # Exudyn whose markers tell their axes, localHT
SAME_MATRICES = 1e-9  # relative; Exudyn rounds reduced matrices at 1e-13 of their largest entry


@dataclass(frozen=True, eq=False)
class FloatingBody:
    """A flexible body in a floating frame, as made by floating_body; to be passed to attach.

    mass, stiffness (N, N) and positions (nodes, 3) are those that the fem had then. modal_damping: ratios of the
    lowest modes, a float: of all, None: damping is Rayleigh's. known : what was found of it in an mbs, by what was
    looked for: a solve finds what its plan has read.
    """

    fem: Any = field(repr=False)
    items: dict[str, Any]
    reference: MeanMotion | MassOrthogonal | None
    interfaces: str
    mass: sp.csc_matrix = field(repr=False)
    stiffness: sp.csc_matrix = field(repr=False)
    positions: np.ndarray = field(repr=False)
    modal_damping: tuple[float, ...] | float | None = None
    known: dict[str, Any] = field(default_factory=dict, repr=False)

    @property
    def number(self) -> int:
        """Exudyn's number of the object."""
        return int(self.items["oFFRFreducedOrder"])


def floating_body(
    fem: Any,
    items: dict[str, Any],
    reference: MeanMotion | MassOrthogonal | None = None,
    interfaces: str = "free",
    modal_damping: ArrayLike | None = None,
) -> FloatingBody:
    """Name the FE model behind a body made with ObjectFFRFreducedOrder, so that attach can bound its error.

    Modes, reduced matrices, damping, joints and loads are read from the mbs when a solve begins.

    Parameters
    ----------
    fem : exudyn.FEM.FEMinterface
        The FE model whose modes the body has: full mass and stiffness matrices, node positions. They are copied:
        what is changed in the fem afterwards does not count.
    items : dict
        What cms.AddObjectFFRFreducedOrder(mbs, ...) or mbs.CreateFFRFReducedOrderObject(...) returned.
    reference : mean_motion(nodes, weights) or mass_orthogonal(), optional
        Conditions that every mode meets and that hold the body in its frame. Default: found by trying the modes
        against the interfaces of the mbs, the node sets of the fem, zero rows and rigid motions.
    interfaces : {"free", "rigid"}
        Which full model is the truth. "free": joints and loads act on the weighted mean of an interface's nodes,
        which may deform; with RBE2 modes the bound then covers what rigid interfaces stiffen. "rigid", RBE2 modes
        only: the nodes of every interface move as a rigid body, those of the first not at all.
    modal_damping : float or sequence of float, optional
        Ratios of the lowest modes (a float: of all) of the full body as it is held in its frame; its other modes are
        undamped. The body in the mbs has to be damped so: call set_modal_damping(mbs, flex). Default: Rayleigh's
        factors, read from the mbs.

    Returns
    -------
    FloatingBody

    Raises
    ------
    InputError
        A fem without matrices; items that are not those of a reduced flexible body; ratios that are no numbers;
        Exudyn older than 1.13.
    AssumptionError
        A mass matrix that is not the same in all directions (beams, shells); a negative ratio.

    Notes
    -----
    Source: docs/theory.md, floating frame. Does not cover: geometric stiffening.
    """
    if tuple(int(part) for part in exu.__version__.split(".")[:2]) < OLDEST:
        raise InputError(
            f"Exudyn {exu.__version__} is installed; floating bodies need 1.13 or newer: pip install --upgrade exudyn"
        )
    if not hasattr(fem, "GetMassMatrix"):
        raise InputError(f"fem is a {type(fem).__name__}; needed: the FEMinterface that the modes were computed with")
    for name in ("massMatrix", "stiffnessMatrix"):
        matrix = getattr(fem, name)
        if matrix is None or not np.size(matrix):
            raise InputError(f"fem.{name} is empty; import or compute it before floating_body")
    if isinstance(items, dict):
        items = items.get("FFRFReducedOrderObjectDict", items)
    if isinstance(items, dict) and "oFFRF" in items:
        raise InputError(
            "items are those of an ObjectFFRF, which has all coordinates of the fem: nothing is reduced, there is no "
            "reduction error to bound"
        )
    missing = [key for key in ITEMS if not isinstance(items, dict) or key not in items]
    if missing:
        raise InputError(
            f"items ({type(items).__name__}) lacks {', '.join(map(repr, missing))}; needed: the dict that "
            "AddObjectFFRFreducedOrder or CreateFFRFReducedOrderObject returned"
        )
    if reference is not None and not isinstance(reference, MeanMotion | MassOrthogonal):
        raise InputError(f"reference={reference!r}; needed: mean_motion(nodes, weights), mass_orthogonal() or None")
    check_choice("interfaces", interfaces, INTERFACES)
    matrices = (sp.csc_matrix(of(sparse=True), copy=True) for of in (fem.GetMassMatrix, fem.GetStiffnessMatrix))
    positions = np.array(fem.GetNodePositionsAsArray(), dtype=float)
    if modal_damping is not None:
        ratios = checked_ratios(modal_damping, positions.size, warns=False)
        modal_damping = tuple(ratios.tolist()) if ratios.ndim else float(ratios)
    flex = FloatingBody(fem, items, reference, interfaces, *matrices, positions, modal_damping)
    if flex.mass.shape[0] != 3 * len(flex.positions):
        raise AssumptionError(
            f"fem has {flex.mass.shape[0]} coordinates at {len(flex.positions)} nodes; a moving frame needs 3 a node"
        )
    require_isotropic_mass(flex.mass)
    return flex


@dataclass(frozen=True)
class ReducedMatrices:
    """What the object of the mbs holds: modes V (N, n), damping D (n, n), its frame's node.

    rayleigh: factors of D; zero where the body has ratios by mode. rigid : the part of V that is motion of the frame;
    held : V without it, which the reference conditions hold. Both are set once these are known.
    """

    V: np.ndarray
    D: np.ndarray
    rayleigh: tuple[float, float]
    frame: FrameNode
    nodes: tuple[int, int]
    held: np.ndarray | None = None
    rigid: RigidPart | None = None


def read_object(mbs: Any, flex: FloatingBody) -> ReducedMatrices:
    """Read the body from the mbs and check that it is the reduction of the fem.

    Raises
    ------
    InputError
        The object is gone, or its modes or matrices are not those of the fem.
    AssumptionError
        Damping is not Rayleigh, and no ratios were given.
    """
    item = object_of(mbs, flex)
    V = check_array("modeBasis of the body", item["modeBasis"], (flex.mass.shape[0], None))
    positions = np.asarray(item["referencePositions"]).reshape(-1, 3)
    M, K, D = (dense(item[f"{name}MatrixReduced"], V.shape[1]) for name in ("mass", "stiffness", "damping"))
    if item["massMatrixUserFunction"] or item["forceUserFunction"]:
        raise AssumptionError(
            "the body has a user function for its mass or forces (AddObjectFFRFreducedOrderWithUserFunctions), which "
            "knows nothing of what is set in its object: use AddObjectFFRFreducedOrder"
        )
    nodes = tuple(int(n) for n in item["nodeNumbers"])
    numbers, (seen, rayleigh) = (V, positions, M, K, D), flex.known.get("reduction", ((), None))
    if seen and all(map(np.array_equal, numbers, seen)):
        V = seen[0]
    else:
        rayleigh = _checked(flex, *numbers)
        flex.known["reduction"] = numbers, rayleigh
    return ReducedMatrices(V, D, rayleigh, FrameNode(mbs.GetNode(nodes[0])), nodes)


def _checked(flex: FloatingBody, V: np.ndarray, positions: np.ndarray, *reduced: np.ndarray) -> tuple[float, float]:
    """Check that modes, positions and M, K, D of the object are those of the fem; return Rayleigh's factors."""
    if np.max(np.abs(positions - flex.positions)) > SAME_MATRICES * np.max(np.abs(flex.positions)):
        raise InputError("fem has other node positions than the body: items belong to another fem")
    for name, full, matrix in zip(("mass", "stiffness"), (flex.mass, flex.stiffness), reduced, strict=False):
        expected = V.T @ (full @ V)
        off = np.max(np.abs(matrix - expected)) / np.max(np.abs(expected))
        if off > SAME_MATRICES:
            raise InputError(
                f"{name}MatrixReduced of the body differs from V^T {name} V of the fem by {off:.1e} of its largest "
                "entry: another fem, a fem changed since, or reduced matrices that were edited"
            )
    return rayleigh_factors(*reduced) if flex.modal_damping is None else (0.0, 0.0)


def object_of(mbs: Any, flex: FloatingBody) -> dict[str, Any]:
    """Return the object of a body; InputError: it is gone, or of another fem."""
    if flex.number >= mbs.systemData.NumberOfObjects():
        raise InputError(f"object {flex.number} of items is not in the mbs; was it deleted, or made in another mbs?")
    item = mbs.GetObject(flex.number)
    found = [int(number) for number in item.get("nodeNumbers", ())]
    wanted = [int(flex.items[key]) for key in ITEMS[:2]]
    if item["objectType"] != FFRF or found != wanted:
        raise InputError(
            f"object {flex.number} of items is a {item['objectType']} on nodes {found}; needed: an FFRFreducedOrder "
            f"on nodes {wanted}. Was the body deleted, or made in another mbs?"
        )
    if len(item["referencePositions"]) != flex.mass.shape[0]:
        raise InputError(
            f"fem has {flex.mass.shape[0]} coordinates, the body {len(item['referencePositions'])}: items belong to "
            "another fem"
        )
    return item


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
