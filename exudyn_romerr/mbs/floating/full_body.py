"""full_body: the full model of a floating body; bodies that are the same share one, with its factors and modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from ...model.admissible_space import MeanMotion
from ...model.body import ElasticBody

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix

    from .floating_body import FloatingBody
    from .reference_search import Reference

# what bodies that something still holds were made of: two bodies of one fem, or scenes of a study one after the other
_MADE: WeakKeyDictionary[ElasticBody, tuple] = WeakKeyDictionary()


def full_body(flex: FloatingBody, rayleigh: tuple[float, float], reference: Reference) -> ElasticBody:
    """Return the full model held by reference conditions; one that is there already if all numbers are the same."""
    conditions = reference.conditions
    held = (conditions.nodes.tobytes(), conditions.weights.tobytes()) if isinstance(conditions, MeanMotion) else ()
    kind = (rayleigh, type(conditions), *held, reference.fixed, reference.rigid)
    made_of = (kind, *_arrays(flex.mass), *_arrays(flex.stiffness), flex.positions)
    for body, other in _MADE.items():
        if kind == other[0] and all(map(np.array_equal, made_of[1:], other[1:])):
            return body
    body = ElasticBody(
        flex.mass,
        flex.stiffness,
        rayleigh=rayleigh,
        fixed=reference.fixed,
        positions=flex.positions,
        reference=conditions,
        rigid=reference.rigid,
    )
    _MADE[body] = made_of
    return body


def _arrays(matrix: csc_matrix) -> tuple[Any, ...]:
    return matrix.indptr, matrix.indices, matrix.data
