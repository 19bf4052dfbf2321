"""shared_body: bodies that are the same are one, with its factors and modes; and what is made of it is made once.

A second attach, a second body of the same fem, and scenes of a study find what the first one made. It stays as long
as the fem is there. What counts is the numbers, not where they come from: a fem that was changed finds nothing.
"""

from __future__ import annotations

from hashlib import blake2b
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from ..linalg.symmetric_factor import MANY
from .admissible_space import MassOrthogonal, MeanMotion
from .body import ElasticBody

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable

    Made = TypeVar("Made")

# what bodies that something still holds were made of: two bodies of one fem, or scenes of a study one after the other
_MADE: WeakKeyDictionary[ElasticBody, tuple] = WeakKeyDictionary()
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
    arrays = [array for A in (mass, stiffness) for array in (A.indptr, A.indices, A.data)]
    kind, arrays = (fixed, rigid, type(reference), modal_damping), [*arrays, positions, *held]
    for body, (its_kind, its_rayleigh, its_arrays) in _MADE.items():
        if kind == its_kind and _agree(rayleigh, its_rayleigh) and all(map(np.array_equal, arrays, its_arrays)):
            return body
    body = ElasticBody(mass, stiffness, rayleigh, None, fixed, positions, reference, rigid, modal_damping)
    _MADE[body] = kind, rayleigh, arrays
    return body


def _agree(rayleigh: tuple[float, float], other: tuple[float, float]) -> bool:
    """Whether two pairs of factors are the same but for rounding, as those of bodies with other modes are."""
    return all(abs(a - b) <= SAME * abs(b) for a, b in zip(rayleigh, other, strict=True))


class _Work:
    """What was made of a body, the last results of every kind, by what they were made of.

    Of a body with more than MANY coordinates nothing is kept beside it: there memory is what is short.
    """

    def __init__(self, body: ElasticBody):
        self.body = body
        self._made: dict[tuple[str, Hashable], Any] = {}

    def get(self, kind: str, of: Iterable[Any], make: Callable[[], Made]) -> Made:
        """Return what was made of the same numbers, or make it."""
        if self.body.N > MANY:
            return make()
        key = kind, fingerprint(of)
        self._made[key] = made = self._made.pop(key) if key in self._made else make()
        for old in [old for old in self._made if old[0] == kind][:-RESULTS]:
            del self._made[old]
        return made


# it must hold no fem, which would live for ever then
_WORK: WeakKeyDictionary[Any, list[_Work]] = WeakKeyDictionary()


def keep_with(fem: Any, body: ElasticBody) -> None:
    """Keep a body, with what is made of it, as long as its fem is there; BODIES of a fem."""
    try:
        kept = [work for work in _WORK.get(fem, ()) if work.body is not body]
    except TypeError:  # a fem of another kind, which cannot tell when it goes
        return
    _WORK[fem] = [*kept[1 - BODIES :], next(_works_of(body), None) or _Work(body)]


def made_once(body: ElasticBody, kind: str, of: Iterable[Any], make: Callable[[], Made]) -> Made:
    """Return make(), or what that returned before, of the same body and the same numbers.

    kind : of result. of : arrays, matrices, and what repr tells apart, of which alone it is made beside the body. The
    result is shared: whoever gets it leaves it as it is.
    """
    work = next(_works_of(body), None)
    return make() if work is None else work.get(kind, of, make)


def _works_of(body: ElasticBody) -> Iterable[_Work]:
    return (work for works in _WORK.values() for work in works if work.body is body)


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
