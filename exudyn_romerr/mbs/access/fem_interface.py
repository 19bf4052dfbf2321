"""FEMinterfaces: made of what was read from files; some of their modes, and without what moves the frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from exudyn.FEM import FEMinterface
from numpy.typing import ArrayLike

from ...checks import check_numbers
from ...errors import InputError
from ...model.admissible_space import mean_motion, rigid_modes

SURFACES = ("Tet4", "Tet10", "Hex8", "Hex20")  # elements of which Exudyn makes one


def keep_modes(fem: Any, modes: Iterable[int]) -> None:
    """Drop all eigenmodes of fem.modeBasis but some; static modes stay. To keep others, compute all modes again.

    Parameters
    ----------
    fem : exudyn.FEM.FEMinterface
        With modes of ComputeHurtyCraigBamptonModes or ComputeEigenmodes: static modes first, if any, then the
        eigenmodes that fem.eigenValues belong to.
    modes : sequence of int
        Numbers of the eigenmodes to keep, from 0, as choose_modes(..., pick=True) passes them to build.

    Raises
    ------
    InputError
        No modes yet, numbers that are not there, or stress modes that would no longer fit.
    """
    V, values = _modes(fem, "keep_modes"), np.asarray(fem.eigenValues, dtype=float)
    if len(values) > V.shape[1]:
        raise InputError(
            f"fem.eigenValues has {len(values)} entries, the basis {V.shape[1]} modes; cut it to those of the modes"
        )
    kept = np.unique(check_numbers("modes", list(modes)))
    wrong = kept[~np.isin(kept, np.arange(len(values)))]
    if wrong.size:
        raise InputError(f"modes lists {wrong[0]:g}; allowed: 0..{len(values) - 1}, the eigenmodes that fem has now")
    kept, always = kept.astype(int), V.shape[1] - len(values)
    fem.modeBasis = {**fem.modeBasis, "matrix": V[:, [*range(always), *(always + kept)]]}
    fem.eigenValues = values[kept]


def hold_modes(fem: Any, nodes: ArrayLike, weights: ArrayLike | None = None) -> None:
    """Take from every mode of fem.modeBasis the rigid motion that leaves the mean motion of some nodes zero.

        V <- V - Rg (C_0 Rg)^-1 C_0 V ,   C_0: weighted mean displacement and rotation, Rg: rigid motions

    Exudyn solves for RBE3 modes with stiffness and weights in one matrix; in N/m these differ so much that the modes
    move the first interface, which they are to hold, by up to 1e-4 of their size. Strain and stress do not change.

    Parameters
    ----------
    fem : exudyn.FEM.FEMinterface
        With modes, before ObjectFFRFreducedOrderInterface(fem).
    nodes, weights
        The interface that holds the frame: the first of ComputeHurtyCraigBamptonModes, and its weights.

    Raises
    ------
    InputError
        No modes yet; nodes or weights as in mean_motion; stress modes, which would no longer fit.

    Notes
    -----
    Source: docs/theory.md, section 7.
    """
    V, positions = _modes(fem, "hold_modes"), np.asarray(fem.GetNodePositionsAsArray(), dtype=float)
    C = mean_motion(nodes, weights).rows(positions)
    Rg = rigid_modes(positions - positions.mean(axis=0))
    for _ in range(2):  # twice: what rounding leaves of the first pass
        V = V - Rg @ np.linalg.solve(C @ Rg, C @ V)
    fem.modeBasis = {**fem.modeBasis, "matrix": V}


def _modes(fem: Any, caller: str) -> np.ndarray:
    """Return fem.modeBasis["matrix"]; InputError if it is missing, or other modes depend on it."""
    if not isinstance(getattr(fem, "modeBasis", None), dict) or "matrix" not in fem.modeBasis:
        raise InputError(f"fem has no modes; compute them before {caller}")
    if np.size(getattr(fem, "postProcessingModes", {}).get("matrix", ())):
        raise InputError(f"fem has post-processing modes of the modes as they are; compute them after {caller}")
    return fem.modeBasis["matrix"]


def fem_of(model: Any) -> FEMinterface:
    """Return nodes, matrices, elements with surface and node sets of an FEModel; see its to_fem."""
    positions, held = model.positions, model.held
    if positions is None:
        raise InputError("no file had node positions, which Exudyn needs; pass mesh=, a file that has them")
    if model.mass.shape[0] != 3 * len(positions):
        raise InputError("the nodes have rotations (6 coordinates a node); Exudyn's floating bodies are solids")
    if len(held):
        raise InputError(
            f"the file holds {len(held)} coordinates, {held[:8].tolist()} ...; Exudyn's bodies are free: "
            "write the matrices without supports, and hold the body in the mechanism"
        )
    fem = FEMinterface()
    fem.nodes = {"Position": np.array(positions)}
    fem.massMatrix, fem.stiffnessMatrix = model.mass.copy(), model.stiffness.copy()
    fem.elements = [{"Name": kind, kind: np.array(x)} for kind, x in model.elements.items()]
    fem.nodeSets = [
        {"Name": name, "NodeNumbers": np.array(x), "NodeWeights": np.full(len(x), 1 / len(x))}
        for name, x in model.node_sets.items()
        if len(x)
    ]
    if model.elements and set(model.elements) <= set(SURFACES):
        fem.VolumeToSurfaceElements()
        fem.ConvertSurfaceLists2Numpy()
    fem.metaData["source"] = "exudyn_romerr.read_body"
    return fem
