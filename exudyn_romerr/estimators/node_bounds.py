"""Bounds at every mesh node, at the worst instant of a run: for a picture of the body."""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING

import numpy as np

from ..progress import progress

if TYPE_CHECKING:
    from typing import Any

    from ..online.bound_stream import Worst
    from ..residual.problem import Problem

CHUNK = 600  # rows solved for at once: their solutions are of full size
CACHED = ("Y_C_M", "Y_C_K", "C2", "C_K", "static_rows", "split")  # what a problem has made of its rows


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
        seen = _with_rows(problem, Z[rows[part]].toarray())
        for name, at in worst.items():
            bounds[name][part] = make(name, seen).outputs_at(at.instant) + at.widened * seen.C2
    return {name: np.linalg.norm(x.reshape(-1, 3), axis=1) for name, x in bounds.items()}


def _with_rows(problem: Problem, C: np.ndarray) -> Problem:
    """The same problem with other outputs: displacements C (R, n_free)."""
    other = copy.copy(problem)
    for name in CACHED:
        other.__dict__.pop(name, None)
    if "split" in problem.__dict__:
        other.__dict__["split"] = problem.split.with_problem(other, C)
    other.C, other.velocity_rows = C, np.zeros(len(C), dtype=bool)
    return other
