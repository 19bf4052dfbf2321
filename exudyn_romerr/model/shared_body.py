"""shared_body: bodies that are the same are one, with its factors and modes; and what is made of it is made once.

A second attach, a second body of the same fem, and scenes of a study find what the first one made. It stays as long
as the fem is there. What counts is the numbers, not where they come from: a fem that was changed finds nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from hashlib import blake2b
from typing import Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from ..linalg.symmetric_factor import MANY
from .admissible_space import MassOrthogonal, MeanMotion
from .body import ElasticBody

Made = TypeVar("Made")

# what bodies that something still holds were made of: two bodies of one fem, or scenes of a study one after the other
_MADE: WeakKeyDictionary[ElasticBody, tuple[bytes, tuple[float, float]]] = WeakKeyDictionary()
# what bodies and their results hold must hold no fem, which would live for ever then
_KEPT: WeakKeyDictionary[Any, list[ElasticBody]] = WeakKeyDictionary()
SAME = 1e-11  # of factors that are read from reduced matrices, which Exudyn rounds at 1e-13
BODIES, RESULTS = 2, 4  # of a fem; of every kind of a body: two, with modes alone and with auxiliary vectors


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
    made_of = fingerprint([mass, stiffness, positions, *held, (fixed, rigid, type(reference), modal_damping)])
    for body, (its, its_rayleigh) in _MADE.items():
        # but for rounding, as factors of bodies with other modes are
        if its == made_of and np.allclose(rayleigh, its_rayleigh, rtol=SAME, atol=0.0):
            return body
    body = ElasticBody(mass, stiffness, rayleigh, None, fixed, positions, reference, rigid, modal_damping)
    _MADE[body] = made_of, rayleigh
    return body


def keep_with(fem: Any, body: ElasticBody) -> None:
    """Keep a body, with what is made of it, as long as its fem is there; BODIES of a fem."""
    with suppress(TypeError):  # a fem of another kind, which cannot tell when it goes
        _KEPT[fem] = [*(other for other in _KEPT.get(fem, ()) if other is not body), body][-BODIES:]


def made_once(body: ElasticBody, kind: str, of: Iterable[Any], make: Callable[[], Made], few: bool = False) -> Made:
    """Return make(), or what that returned before, of the same body and the same numbers.

    kind : of result. of : arrays, matrices, and what repr tells apart, of which alone it is made beside the body. The
    result is shared: whoever gets it leaves it as it is. Of a body with more than MANY
    coordinates nothing is kept, but where it is a `few` columns: there memory is what is short.
    """
    if body.N > MANY and not few:
        return make()
    made, key = body.results, (kind, fingerprint(of))
    made[key] = found = made.pop(key) if key in made else make()
    for old in [old for old in made if old[0] == kind][:-RESULTS]:
        del made[old]
    return found


def fingerprint(of: Iterable[Any]) -> bytes:
    """Return 16 bytes that tell numbers apart: arrays, sparse matrices, and others by their repr."""
    found = blake2b(digest_size=16)
    for x in of:
        if sp.issparse(x):
            x = sp.csc_array(x)
            parts = [x.indptr, x.indices, x.data]
        else:
            parts = [x] if isinstance(x, np.ndarray) else []
        found.update(repr([(part.shape, part.dtype.str) for part in parts] or x).encode())
        for part in parts:
            found.update(np.ascontiguousarray(part))
    return found.digest()
