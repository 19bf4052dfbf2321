"""A body that was read from files as an exudyn FEMinterface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from exudyn.FEM import FEMinterface

from ...errors import InputError

if TYPE_CHECKING:
    from ...fe_files.fe_model import FEModel

SURFACES = ("Tet4", "Tet10", "Hex8", "Hex20")  # of which Exudyn makes one


def fem_of(model: FEModel) -> FEMinterface:
    """Return nodes, matrices, elements with their surface and node sets; see FEModel.to_fem."""
    if model.positions is None:
        raise InputError("no file had node positions, which Exudyn needs; pass mesh=, a file that has them")
    if model.mass.shape[0] != 3 * len(model.positions):
        raise InputError("the nodes have rotations (6 coordinates a node); Exudyn's floating bodies are solids")
    if len(model.held):
        raise InputError(
            f"the file holds {len(model.held)} coordinates, {model.held[:8].tolist()} ...; Exudyn's bodies are free: "
            "write the matrices without supports, and hold the body in the mechanism"
        )
    fem = FEMinterface()
    fem.nodes = {"Position": np.array(model.positions)}
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
