"""A body that was read from files as an exudyn FEMinterface."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from exudyn.FEM import FEMinterface

from ...errors import InputError

SURFACES = ("Tet4", "Tet10", "Hex8", "Hex20")  # of which Exudyn makes one


def fem_of(
    mass: sp.csr_matrix,
    stiffness: sp.csr_matrix,
    positions: np.ndarray | None,
    elements: dict[str, np.ndarray],
    node_sets: dict[str, np.ndarray],
    held: np.ndarray,
) -> FEMinterface:
    """Return nodes, matrices, elements with surface and node sets, of the fields of an FEModel; see its to_fem."""
    if positions is None:
        raise InputError("no file had node positions, which Exudyn needs; pass mesh=, a file that has them")
    if mass.shape[0] != 3 * len(positions):
        raise InputError("the nodes have rotations (6 coordinates a node); Exudyn's floating bodies are solids")
    if len(held):
        raise InputError(
            f"the file holds {len(held)} coordinates, {held[:8].tolist()} ...; Exudyn's bodies are free: "
            "write the matrices without supports, and hold the body in the mechanism"
        )
    fem = FEMinterface()
    fem.nodes = {"Position": np.array(positions)}
    fem.massMatrix, fem.stiffnessMatrix = mass.copy(), stiffness.copy()
    fem.elements = [{"Name": kind, kind: np.array(x)} for kind, x in elements.items()]
    fem.nodeSets = [
        {"Name": name, "NodeNumbers": np.array(x), "NodeWeights": np.full(len(x), 1 / len(x))}
        for name, x in node_sets.items()
        if len(x)
    ]
    if elements and set(elements) <= set(SURFACES):
        fem.VolumeToSurfaceElements()
        fem.ConvertSurfaceLists2Numpy()
    fem.metaData["source"] = "exudyn_romerr.read_body"
    return fem
