"""Strain and stress at nodes of a solid as outputs, and the von Mises stress of a report with its bound."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, check_array, check_choice
from .outputs import Output
from .solid_elements import STRAINS, strain_rows

if TYPE_CHECKING:
    from ..report.report import BoundReport


def node_strain(name: str, *, node: int, fem: Any, component: str | None = None, unit: str = "m/m") -> Output:
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
    return Output(name, _rows(np.eye(6), node, fem, component), unit, labels=_labels(component))


def node_stress(
    name: str, *, node: int, fem: Any, material: Any, component: str | None = None, unit: str = "Pa"
) -> Output:
    """Stress of the deformed body at one node, in body axes: y = E times the strain there, see node_strain.

    Parameters
    ----------
    name, node, fem, component, unit
        See node_strain; "Pa" in SI units, "MPa" with t, mm, s.
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
    return Output(name, rows, unit, labels=_labels(component))


@dataclass(frozen=True)
class VonMises:
    """Von Mises stress along a run: |vM of the full model - value| <= bound, and <= corrected_bound of corrected.

    All (T,); corrected and corrected_bound are None where the report has no corrected output.
    """

    value: np.ndarray
    bound: np.ndarray
    corrected: np.ndarray | None
    corrected_bound: np.ndarray | None


def von_mises(report: BoundReport, name: str) -> VonMises:
    """Return the von Mises stress of a node_stress with all six components, and its bound.

    vM(s) is a seminorm: |vM(s + e) - vM(s)| <= vM(e), and where |e_i| <= b_i no vM(e) is larger than with the normal
    components b, one of them negative, and all shears b. A corrected output gives a second bound, |vM(corrected) -
    vM(value)| + corrected_bound; the smaller one counts.

    Parameters
    ----------
    report : BoundReport
        From monitor.report, evaluate or load_report.
    name : str
        Of the output.

    Returns
    -------
    VonMises

    Raises
    ------
    InputError
        Unknown output, or one that has not six rows.

    Notes
    -----
    The scope is that of the report. Does not cover: strains (node_strain), whose shears are twice eps_ij.
    """
    out = report.output(name)
    if out.value.shape[1] != len(STRAINS):
        raise InputError(
            f"output {name!r} has {out.value.shape[1]} rows; needed: the six of node_stress without component="
        )
    value, bound = _size(out.value), _largest_size(out.bound["best"])
    if out.corrected is None:
        return VonMises(value, bound, None, None)
    corrected, left = _size(out.corrected), _largest_size(out.corrected_bound)
    if len(set(report.scope.values())) == 1:  # else the correction may say less than the best bound
        bound = np.minimum(bound, np.abs(corrected - value) + left)
    return VonMises(value, bound, corrected, left)


def _rows(tensor: np.ndarray, node: int, fem: Any, component: str | None) -> np.ndarray:
    if component is not None:
        check_choice("component", component, STRAINS)
    rows = tensor @ strain_rows(fem, node)
    return rows if component is None else rows[STRAINS.index(component)]


def _labels(component: str | None) -> tuple[str, ...]:
    return STRAINS if component is None else (component,)


def _size(stress: np.ndarray) -> np.ndarray:
    """Von Mises stress (T,) of components (T, 6)."""
    normal, shear = stress[:, :3], stress[:, 3:]
    return np.sqrt(((normal - np.roll(normal, 1, axis=1)) ** 2).sum(axis=1) / 2 + 3 * (shear**2).sum(axis=1))


def _largest_size(box: np.ndarray) -> np.ndarray:
    """Largest von Mises stress (T,) where the components are at most (T, 6) in absolute value; inf where one is."""
    finite = np.isfinite(box).all(axis=1)
    box = np.where(finite[:, None], box, 0.0)
    # convex, so largest at a vertex; of those the three where one normal component has the other sign are left
    signs = np.ones((3, 6)) - 2 * np.eye(3, 6)
    return np.where(finite, np.max([_size(box * sign) for sign in signs], axis=0), np.inf)
