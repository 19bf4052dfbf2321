"""Whether mass, stiffness and damping of a body are definite, and in words why they are not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import AssumptionError, InputError
from ..linalg.eigenmodes import count_below
from ..linalg.symmetric_factor import SINGULAR_PIVOT, idle_motion
from .matrix_input import DOUBLE, is_dissipative

if TYPE_CHECKING:
    import scipy.sparse as sp

    from ..linalg.symmetric_factor import SymmetricFactor

FREE = 1e-6  # of the largest sum of terms of a row: matrices printed with 7 digits
NAMED = 8  # coordinates at most
STILL = 1e-6  # of the largest entry of a motion: smaller ones are what rounding leaves of zero
# relative to the stiffest coordinate: above rounding (1e-16), below the elastic modes of meshed bodies
RIGID = 1e-13
# rotations of a lumped beam that are fixed make its lowest frequency 15 times as high (tests/model/test_massless.py)
CONDENSE = (
    "condense {} statically, which is exact without mass: with i their numbers and c all others, "
    "K[c, c] - K[c, i] @ solve(K[i, i], K[i, c]) and M[c, c], and of loads B[c] - K[c, i] @ solve(K[i, i], B[i]). "
    "Fixing would make the model stiffer"
)


def check_not_swapped(mass: sp.spmatrix, stiffness: sp.spmatrix) -> None:
    """Raise InputError if the mass lets all nodes translate for nothing, and the stiffness does not.

    Of 3 or 6 coordinates a node; bodies of other coordinates, and those that are held already, are not told apart.
    """
    for per_node in (3, 6):
        if mass.shape[0] % per_node == 0 and _is_free(mass, per_node) and not _is_free(stiffness, per_node):
            raise InputError(
                "mass and stiffness are swapped: against translations of all nodes the matrix given as mass has no "
                "inertia, as the stiffness of a free body has none, and the one given as stiffness has; pass each as "
                "the other"
            )


def _is_free(matrix: sp.spmatrix, per_node: int) -> bool:
    """Whether a matrix that is not zero takes all three translations to zero, but for rounding of its terms."""
    translations = np.zeros((matrix.shape[0], 3))
    for axis in range(3):
        translations[axis::per_node, axis] = 1.0
    terms = np.max(abs(matrix) @ translations)
    return bool(terms > 0 and np.max(np.abs(matrix @ translations)) <= FREE * terms)


def check_masses(M: sp.csc_matrix, free: np.ndarray) -> None:
    """Raise InputError unless the diagonal of M > 0; free: numbers of its coordinates."""
    massless = free[M.diagonal() <= 0]
    if massless.size:
        raise InputError(
            f"mass has no positive diagonal entry at coordinates {massless[:NAMED].tolist()}"
            f"{' ...' if massless.size > NAMED else ''} ({massless.size} in all): {CONDENSE.format('them')}"
        )


def check_mass(M: sp.csc_matrix, factor: SymmetricFactor, free: np.ndarray) -> None:
    """Raise InputError unless M > 0; free: numbers of its coordinates."""
    if factor.smallest_pivot <= SINGULAR_PIVOT:
        raise InputError(_singular_mass(M, free))


def check_stiffness(
    K: sp.csc_matrix, M: sp.csc_matrix, factor: SymmetricFactor, fixed: int, precision: float
) -> None:
    """Raise AssumptionError unless K > 0; fixed: how many coordinates are; precision: spacing of K's numbers."""
    if factor.smallest_pivot <= SINGULAR_PIVOT:
        raise AssumptionError(_singular_stiffness(K, M, fixed, precision))


def check_damping(D: sp.csc_matrix) -> None:
    """Raise AssumptionError unless x^T D x >= 0."""
    if not is_dissipative(D):
        raise AssumptionError(
            "damping feeds energy in: x^T D x < 0 for some x; bounds need x^T D x >= 0: its symmetric part has "
            "negative eigenvalues, check the signs of its entries"
        )


def _singular_mass(M: sp.csc_matrix, free: np.ndarray) -> str:
    motion = idle_motion(M)
    if motion is None:
        return "mass is not positive definite: some motions have negative mass; check its off-diagonal entries"
    moved = np.flatnonzero(np.abs(motion) > STILL)
    pairs = zip(free[moved[:NAMED]], motion[moved[:NAMED]], strict=True)
    named = ", ".join(f"{dof} by {x:.3g}" for dof, x in pairs)
    return (
        f"mass is singular: a motion of {moved.size} coordinates has no inertia, coordinates {named}"
        f"{', ...' if moved.size > NAMED else ''}; give them mass, or take this motion as a coordinate and "
        f"{CONDENSE.format('it')}"
    )


def _singular_stiffness(K: sp.csc_matrix, M: sp.csc_matrix, fixed: int, precision: float) -> str:
    tiny = RIGID * np.max(np.abs(K.diagonal()) / M.diagonal()) or 1.0  # no stiffness at all: any shift
    rigid = count_below(M, K, np.sqrt(tiny))
    if precision > DOUBLE:
        return (
            f"stiffness came in single precision and is not positive definite ({rigid} modes are not held or "
            "unstable): rounding to 7 digits alone may do that; pass it in double precision"
        )
    return (
        f"stiffness is not positive definite with {fixed} fixed coordinates: {rigid} rigid-body "
        "(or unstable) modes are left; hold the body by fixed=... (coordinate numbers: 3 node + 0, 1, 2 for "
        "solids, not node numbers) or reference=mean_motion(nodes); a body that joints let move: "
        "floating_body(fem, items). A link so stiff that 16 digits hold nothing beside it looks the same: join what "
        "it links to one coordinate"
    )
