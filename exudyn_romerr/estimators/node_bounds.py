"""Bounds of the displacement at every mesh node, at the worst instant of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..progress import progress

if TYPE_CHECKING:
    from typing import Any

    from ..residual.problem import Problem
    from ..trajectory.bounds import Worst

CHUNK = 600  # rows solved for at once: their solutions are of full size


def node_bounds(problem: Problem, make: Any, worst: dict[str, Worst]) -> dict[str, np.ndarray]:
    """Return the bound of |u - u_reduced| at every node (nodes,) by every estimator.

    Parameters
    ----------
    make : callable
        (name, problem) -> estimator.
    worst : dict
        Estimator -> its worst instant.
    """
    body = problem.body
    per_node = body.dofs_per_node
    rows = (per_node * np.arange(len(body.positions))[:, None] + np.arange(3)).ravel()
    bounds = {name: np.zeros(len(rows)) for name in worst}
    Z = body.space.Z.tocsr()
    for first in progress(range(0, len(rows), CHUNK), "bounds at nodes"):
        part = slice(first, first + CHUNK)
        seen = problem.with_displacements(Z[rows[part]].toarray())
        for name, at in worst.items():
            bounds[name][part] = make(name, seen).outputs_at(at.instant) + at.widened * seen.rows.C_M
    return {name: np.linalg.norm(x.reshape(-1, 3), axis=1) for name, x in bounds.items()}
