"""shared_body: bodies that are the same are one, with its factors and modes."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from .admissible_space import MassOrthogonal, MeanMotion
from .body import ElasticBody

if TYPE_CHECKING:
    import scipy.sparse as sp

# what bodies that something still holds were made of: two bodies of one fem, or scenes of a study one after the other
_MADE: WeakKeyDictionary[ElasticBody, tuple] = WeakKeyDictionary()


def shared_body(
    mass: sp.csc_matrix,
    stiffness: sp.csc_matrix,
    positions: np.ndarray,
    rayleigh: tuple[float, float],
    fixed: tuple[int, ...],
    rigid: tuple[tuple[int, ...], ...],
    reference: MeanMotion | MassOrthogonal | None,
    modal_damping: tuple[float, ...] | float | None = None,
) -> ElasticBody:
    """Return ElasticBody(mass, stiffness, ...), or one that is still there and was made of the same numbers."""
    held = (reference.nodes, reference.weights) if isinstance(reference, MeanMotion) else ()
    arrays = [array for A in (mass, stiffness) for array in (A.indptr, A.indices, A.data)]
    kind, arrays = (rayleigh, fixed, rigid, type(reference), modal_damping), [*arrays, positions, *held]
    for body, (its_kind, its_arrays) in _MADE.items():
        if kind == its_kind and all(map(np.array_equal, arrays, its_arrays)):
            return body
    body = ElasticBody(mass, stiffness, rayleigh, None, fixed, positions, reference, rigid, modal_damping)
    _MADE[body] = kind, arrays
    return body
