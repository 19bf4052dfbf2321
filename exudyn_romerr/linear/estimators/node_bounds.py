"""Displacements at every mesh node, bounds and estimates of their errors, at the worst instant of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...progress import progress

if TYPE_CHECKING:
    from typing import Any

    from ..residual.problem import Problem
    from .bounds import Worst

CHUNK = 600  # rows solved for at once: their solutions are of full size


class AtNodes(NamedTuple):
    """Of the error u - u_reduced at nodes: bound (nodes,) of its length; estimate (nodes, 3), None if not known."""

    bound: np.ndarray
    estimate: np.ndarray | None


def node_bounds(problem: Problem, make: Any, worst: dict[str, Worst]) -> dict[str, AtNodes]:
    """Return what every estimator knows of the error at every node.

    Parameters
    ----------
    make : callable
        (name, problem) -> estimator.
    worst : dict
        Estimator -> its worst instant.
    """
    shown = _shown(problem)
    parts: dict[str, list] = {name: [] for name in worst}
    for first in progress(range(0, shown.size, CHUNK), "bounds at nodes"):
        coordinates = shown[first : first + CHUNK]
        rows = np.zeros((len(coordinates), problem.body.N))
        rows[np.arange(len(coordinates)), coordinates] = 1.0
        seen = problem.with_displacements(problem.body.space.rows(rows))
        for name, at in worst.items():
            found = make(name, seen).bounds_at(at.instant)
            parts[name].append((found.outputs[0] + at.widened * seen.rows.C_M, found.correction))
    return {name: _joined(chunks) for name, chunks in parts.items()}


def node_displacements(problem: Problem, q: np.ndarray) -> np.ndarray:
    """Return the displacements (nodes, 3) of the reduced body at q (n,)."""
    return problem.body.expand(problem.V @ q)[_shown(problem)].reshape(-1, 3)


def _shown(problem: Problem) -> np.ndarray:
    """Numbers (3 nodes,) of the coordinates that are displacements of nodes."""
    body = problem.body
    return (body.dofs_per_node * np.arange(len(body.positions))[:, None] + np.arange(3)).ravel()


def _joined(chunks: list) -> AtNodes:
    bounds, known = zip(*chunks, strict=True)
    estimate = None if known[0] is None else np.hstack(known).reshape(-1, 3)
    return AtNodes(np.linalg.norm(np.concatenate(bounds).reshape(-1, 3), axis=1), estimate)
