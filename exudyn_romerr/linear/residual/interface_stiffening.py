"""What rigid (RBE2) interfaces stiffen: static outputs with free interfaces less those with rigid ones."""

from __future__ import annotations

import numpy as np

from ...linalg.symmetric_factor import SubspaceFactor
from ...model.admissible_space import Space
from ...model.body import ElasticBody
from ...model.shared_body import made_once
from .problem import Problem


def static_errors(problem: Problem, stiff: Space) -> np.ndarray:
    """Return rows (2, R, k) of the outputs' static error -C K^-1 L: what rigid interfaces make of it, and the rest.

    The rest is -C S (S^T K S)^-1 S^T L, the static error of the body with rigid interfaces.

    stiff : the body's coordinates with the interfaces of its modes rigid, S; a part of those of the problem.

    Source: docs/theory.md, floating frame. Does not cover: inertia of what the interfaces' deformation moves.
    """
    body, rows = problem.body, problem.rows
    response = body.stiffness_factor.solve(rows.C.T)  # few rows are solved for, not the many columns
    of = stiff.Z, rows.C
    rigid = made_once(
        body, "rigid interfaces", of, lambda: with_rigid_interfaces(body, stiff).solve(rows.C.T), few=True
    )
    whole, rest = _seen(problem, response), _seen(problem, rigid)
    return np.stack([-rows.of_displacements(part) for part in (whole - rest, rest)])


def _seen(problem: Problem, response: np.ndarray) -> np.ndarray:
    """Rows x^T L (R, k) of responses x (n_free, R); x^T K V where |.|_K is the 2-norm: nothing cancels."""
    terms, factor = problem.map, problem.body.stiffness_factor
    found = terms.seen_by(response.T)
    found[:, terms.coordinates.stiffness_slot] = factor.half_multiply(response).T @ factor.half_multiply(terms.V)
    return found


def with_rigid_interfaces(body: ElasticBody, stiff: Space) -> SubspaceFactor:
    """Return what solves S (S^T K S)^-1 S^T; of a large body it takes much memory, and time."""
    return SubspaceFactor(body.K, stiff.Z.tocsr()[body.free])


def interface_share(errors: np.ndarray) -> np.ndarray:
    """Return the share (r,) of the interfaces in static errors (T, 2, r) of two parts, by their largest values."""
    interfaces, rest = np.max(np.abs(errors), axis=0, initial=0.0)
    total = interfaces + rest
    return np.divide(interfaces, total, out=np.zeros_like(total), where=total > 0)
