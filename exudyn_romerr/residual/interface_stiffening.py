"""What rigid (RBE2) interfaces stiffen: static outputs with free interfaces less those with rigid ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..model.admissible_space import Space
    from .problem import Problem


def static_errors(problem: Problem, stiff: Space) -> np.ndarray:
    """Return rows (2, R, k) of the outputs' static error -C K^-1 L: what rigid interfaces make of it, and the rest.

    The rest is -C S (S^T K S)^-1 S^T L, the static error of the body with rigid interfaces.

    stiff : the body's coordinates with the interfaces of its modes rigid, S; a part of those of the problem.

    Source: docs/theory.md, floating frame. Does not cover: inertia of what the interfaces' deformation moves.
    """
    body, rows = problem.body, problem.rows
    S = stiff.Z.tocsr()[body.free]
    response = S @ body.stiffness_within(S).solve(S.T @ rows.C.T)
    rest = body.stiffness_factor.half_multiply(response)
    columns = problem.dual.Y_K[:, : problem.map.coordinates.k]
    return np.stack([-rows.of_displacements(part.T @ columns) for part in (rows.Y_C_K - rest, rest)])


def interface_share(errors: np.ndarray) -> np.ndarray:
    """Return the share (r,) of the interfaces in static errors (T, 2, r) of two parts, by their largest values."""
    interfaces, rest = np.max(np.abs(errors), axis=0, initial=0.0)
    total = interfaces + rest
    return np.divide(interfaces, total, out=np.zeros_like(total), where=total > 0)
