"""Outputs of strain and stress at nodes of a solid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import check_array, check_choice
from ..errors import InputError
from .outputs import Output
from .solid_elements import STRAINS, strain_rows

if TYPE_CHECKING:
    pass


def node_strain(name: str, *, node: int, fem: Any, component: str | None = None, unit: str = "") -> Output:
    """Strain of the deformed body at one node, in body axes: the mean of B_e(x_node) q over its elements e.

    Parameters
    ----------
    name : str
    node : int
        Node number of the fem.
    fem : FEMinterface
        Nodes and elements (Tet4, Tet10, Hex8, Hex20) are read; the quadratic meshes of ngsolve too.
    component : {"xx", "yy", "zz", "yz", "xz", "xy"}, optional
        One row; default: all six, in this order, which is Exudyn's. Shears are engineering shears, 2 eps_ij, as
        ComputePostProcessingModes has them (ComputePostProcessingModesNGsolve has eps_ij).
    unit : str

    Returns
    -------
    Output
        One row, or six.

    Raises
    ------
    InputError
        No elements or unknown ones, nodes in none of them, node out of range, an element that is flat or turned
        inside out, unknown component.

    Notes
    -----
    Equal to a sensor of StrainLocal where that is right: Exudyn's ComputePostProcessingModes takes quadratic
    tetrahedra for linear ones. Does not cover: beams, shells, strain inside elements (pass rows of your own).
    """
    return Output(name, _rows(np.eye(6), node, fem, component), unit, labels=_labels(component), quantity="strain")


def node_stress(
    name: str, *, node: int, fem: Any, material: Any, component: str | None = None, unit: str = ""
) -> Output:
    """Stress of the deformed body at one node, in body axes: y = E times the strain there, see node_strain.

    Parameters
    ----------
    name, node, fem, component, unit
        See node_strain; nothing is printed behind stresses unless unit= says what, such as "Pa" where the model is in
        SI units, "MPa" in t, mm, s.
    material : KirchhoffMaterial
        Exudyn's, as for ComputePostProcessingModes; only its elasticityTensor (6, 6) is read.

    Returns
    -------
    Output
        One row, or six: xx, yy, zz, yz, xz, xy, as sensors of StressLocal have them.

    Raises
    ------
    InputError
        See node_strain; a material without elasticityTensor, or with one that is not (6, 6).

    Notes
    -----
    Does not cover: nodes where two materials meet, thermal stress, plasticity, the error of the mesh.
    """
    tensor = getattr(material, "elasticityTensor", None)
    if tensor is None:
        raise InputError(
            f"material={material!r} has no elasticityTensor; pass KirchhoffMaterial(youngsModulus, poissonsRatio) of "
            "exudyn.FEM, of a mesh with several materials that at the node"
        )
    rows = _rows(check_array("material.elasticityTensor", tensor, (6, 6)), node, fem, component)
    return Output(name, rows, unit, labels=_labels(component), quantity="stress")


def _rows(tensor: np.ndarray, node: int, fem: Any, component: str | None) -> np.ndarray:
    if component is not None:
        check_choice("component", component, STRAINS)
    rows = tensor @ strain_rows(fem, node)
    return rows if component is None else rows[STRAINS.index(component)]


def _labels(component: str | None) -> tuple[str, ...]:
    return STRAINS if component is None else (component,)
