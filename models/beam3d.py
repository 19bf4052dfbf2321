"""Straight Euler-Bernoulli beams in space: consistent mass and stiffness matrices, assembled into frames.

Every node has six degrees of freedom in global axes, (ux, uy, uz, rx, ry, rz): displacements in m, small
rotations in rad. The section is solid and round: its bending stiffness is the same in every direction.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

DOFS_PER_NODE = 6

# Dofs of an element in local axes, x along the beam: node 1 has 0..5, node 2 has 6..11.
AXIAL = [0, 6]
TORSION = [3, 9]
BENDING_XY = [1, 5, 7, 11]
BENDING_XZ = [2, 4, 8, 10]
# The slope of the deflection w is ry = -w' in the xz plane, but rz = +v' in the xy plane.
FLIP_SLOPE = np.diag([1.0, -1.0, 1.0, -1.0])


@dataclass(frozen=True)
class RoundSection:
    """Solid round cross-section.

    Parameters
    ----------
    diameter : float
        Diameter in m.
    """

    diameter: float

    @property
    def area(self) -> float:
        """Area in m^2."""
        return np.pi * self.diameter**2 / 4

    @property
    def second_moment(self) -> float:
        """Second moment of area about every diameter, Iy = Iz, in m^4."""
        return np.pi * self.diameter**4 / 64

    @property
    def polar_moment(self) -> float:
        """Polar second moment of area in m^4; for a round section also the torsion constant."""
        return 2 * self.second_moment


@dataclass(frozen=True)
class Material:
    """Isotropic linear elastic material.

    Parameters
    ----------
    youngs_modulus : float
        Young's modulus in Pa.
    poisson_ratio : float
        Poisson's ratio.
    density : float
        Density in kg/m^3.
    """

    youngs_modulus: float
    poisson_ratio: float
    density: float

    @property
    def shear_modulus(self) -> float:
        """Shear modulus in Pa."""
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))


STEEL = Material(youngs_modulus=2.1e11, poisson_ratio=0.3, density=7850.0)


def element_stiffness(length: float, section: RoundSection, material: Material) -> np.ndarray:
    """Stiffness matrix of one element in its local axes.

    Parameters
    ----------
    length : float
        Length in m.
    section : RoundSection
        Cross-section, constant along the beam.
    material : Material
        Material of the whole beam.

    Returns
    -------
    ndarray, (12, 12)
        In N/m, N and N m.
    """
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]]) / length
    return _local_matrix(
        axial=material.youngs_modulus * section.area * spring,
        torsion=material.shear_modulus * section.polar_moment * spring,
        bending=material.youngs_modulus * section.second_moment * _bending_stiffness(length),
    )


def element_mass(length: float, section: RoundSection, material: Material) -> np.ndarray:
    """Consistent mass matrix of one element in its local axes.

    Parameters
    ----------
    length : float
        Length in m.
    section : RoundSection
        Cross-section, constant along the beam.
    material : Material
        Material of the whole beam.

    Returns
    -------
    ndarray, (12, 12)
        In kg, kg m and kg m^2.
    """
    bar = np.array([[2.0, 1.0], [1.0, 2.0]]) * length / 6
    # Euler-Bernoulli: the section's rotary inertia about its bending axes is left out. About the beam's own
    # axis it is the only inertia there is, and without it M would be singular.
    return _local_matrix(
        axial=material.density * section.area * bar,
        torsion=material.density * section.polar_moment * bar,
        bending=material.density * section.area * _bending_mass(length),
    )


def assemble(
    nodes: np.ndarray, elements: np.ndarray, section: RoundSection, material: Material
) -> tuple[sparse.csc_array, sparse.csc_array]:
    """Mass and stiffness matrices of a frame of beams that are rigidly joined at shared nodes.

    Parameters
    ----------
    nodes : ndarray, (n, 3)
        Node positions in m.
    elements : ndarray of int, (e, 2)
        The two nodes of every element.
    section : RoundSection
        Cross-section, constant along the beam.
    material : Material
        Material of the whole beam.

    Returns
    -------
    mass, stiffness : csc_array, (6 n, 6 n)
        Unconstrained; dof 6 i + j is component j of node i.
    """
    axes = nodes[elements[:, 1]] - nodes[elements[:, 0]]
    lengths = np.linalg.norm(axes, axis=1)
    turns = np.array([np.kron(np.eye(4), _local_axes(axis)) for axis in axes / lengths[:, None]])

    def gather(element_matrix: Callable[..., np.ndarray]) -> sparse.csc_array:
        local = np.array([element_matrix(length, section, material) for length in lengths])
        return _scatter(turns.transpose(0, 2, 1) @ local @ turns, elements, DOFS_PER_NODE * len(nodes))

    return gather(element_mass), gather(element_stiffness)


def _local_matrix(axial: np.ndarray, torsion: np.ndarray, bending: np.ndarray) -> np.ndarray:
    """Combine the uncoupled (2, 2), (2, 2) and (4, 4) matrices, bending in both planes, into (12, 12)."""
    matrix = np.zeros((2 * DOFS_PER_NODE, 2 * DOFS_PER_NODE))
    matrix[np.ix_(AXIAL, AXIAL)] = axial
    matrix[np.ix_(TORSION, TORSION)] = torsion
    matrix[np.ix_(BENDING_XY, BENDING_XY)] = bending
    matrix[np.ix_(BENDING_XZ, BENDING_XZ)] = FLIP_SLOPE @ bending @ FLIP_SLOPE
    return matrix


def _bending_stiffness(length: float) -> np.ndarray:
    """Integral of H''^T H'' over the length, H the cubic Hermite functions of (v1, v1', v2, v2'), (4, 4)."""
    unit = np.array(
        [
            [12.0, 6.0, -12.0, 6.0],
            [6.0, 4.0, -6.0, 2.0],
            [-12.0, -6.0, 12.0, -6.0],
            [6.0, 2.0, -6.0, 4.0],
        ]
    )
    scale = np.array([1.0, length, 1.0, length])
    return unit * np.outer(scale, scale) / length**3


def _bending_mass(length: float) -> np.ndarray:
    """Integral of H^T H over the length, H the cubic Hermite functions of (v1, v1', v2, v2'), (4, 4)."""
    unit = np.array(
        [
            [156.0, 22.0, 54.0, -13.0],
            [22.0, 4.0, 13.0, -3.0],
            [54.0, 13.0, 156.0, -22.0],
            [-13.0, -3.0, -22.0, 4.0],
        ]
    )
    scale = np.array([1.0, length, 1.0, length])
    return unit * np.outer(scale, scale) * length / 420


def _local_axes(direction: np.ndarray) -> np.ndarray:
    """Rotation from global into local axes, (3, 3); its rows are the local axes, x along the unit vector."""
    # A round section has no preferred transverse axis. Starting from the global axis farthest from the beam's
    # keeps the cross product away from zero.
    start = np.eye(3)[np.argmin(np.abs(direction))]
    second = np.cross(direction, start)
    second /= np.linalg.norm(second)
    return np.array([direction, second, np.cross(direction, second)])


def _scatter(blocks: np.ndarray, elements: np.ndarray, size: int) -> sparse.csc_array:
    """Sum the element matrices (e, 12, 12) into one (size, size) matrix."""
    dofs = (DOFS_PER_NODE * elements[:, :, None] + np.arange(DOFS_PER_NODE)).reshape(len(elements), -1)
    rows = np.broadcast_to(dofs[:, :, None], blocks.shape)
    columns = np.broadcast_to(dofs[:, None, :], blocks.shape)
    return sparse.coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsc()
