"""What Exudyn's ObjectFFRFreducedOrder has of its modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import exudyn as exu
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...basis.shape_sums import ShapeSums

CROSS = np.zeros((3, 3, 3))  # (a x b)_c = CROSS_cij a_i b_j
CROSS[[0, 1, 2], [1, 2, 0], [2, 0, 1]], CROSS[[0, 1, 2], [2, 0, 1], [1, 2, 0]] = 1.0, -1.0


class WithShapes(Protocol):
    """A body's modes and vectors (N, k), sums of these over its nodes, and X^T D Y of (X, Y, X^T M Y, X^T K Y)."""

    shapes: np.ndarray
    sums: ShapeSums
    damping: Callable[..., np.ndarray]


def object_terms(body: WithShapes) -> dict[str, Any]:
    """Return what an ObjectFFRFreducedOrder has of a body's modes and vectors.

    As ObjectFFRFreducedOrderInterface makes it, with M = m (x) I, so that all follows from the sums of u_i (m u)_j
    over the nodes.
    """
    U, (of_U, of_x, pull, M, K) = body.shapes, body.sums
    k = U.shape[1]
    twice = np.einsum("cd,iikl->kcld", np.eye(3), of_U) - of_U.transpose(2, 1, 3, 0)
    once = np.einsum("cd,iil->cld", np.eye(3), of_x) - of_x.transpose(1, 2, 0)
    matrices = {"mass": M, "stiffness": K, "damping": body.damping(U, U, M, K)}
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
