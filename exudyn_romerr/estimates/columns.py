"""Columns: right-hand sides that are marched together. Those that are equal are marched once, those that are 0 not.

What is added of a remainder is 0 as long as nothing is, and all of it later; a check that leaves out no vectors is
what it checks.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from typing import NamedTuple

import numpy as np


class Columns(NamedTuple):
    """Right-hand sides that are marched through steps together.

    moving : e, e', e'' and algorithmic a (4, k, columns) where the steps begin. force (S, k, columns), values g
    (S, c, columns) : 0 where None. kicks : two (S, k, columns), what moves e and e' on the way to a sample beside
    what the scheme does. held : numbers of the coordinates that each of the columns holds at zero; none, if empty.
    """

    moving: np.ndarray
    force: np.ndarray | None = None
    values: np.ndarray | None = None
    kicks: Sequence[np.ndarray] | None = None
    held: Sequence[np.ndarray] = ()


def side_by_side(parts: Sequence[Columns], S: int, n: int) -> tuple[list[np.ndarray], np.ndarray]:
    """Return what moves (columns, 4, k), right-hand sides (columns, S, n) and, if there are any, kicks, of all parts.

    Kicks are (columns, S, 2, k). Beside these: where the columns of each part end.
    """
    ends, k = np.cumsum([part.moving.shape[2] for part in parts]), parts[0].moving.shape[1]
    moving, right = np.zeros((ends[-1], 4, k)), np.zeros((ends[-1], S, n))
    kicks = [np.zeros((ends[-1], S, 2, k))] if any(part.kicks is not None for part in parts) else []
    for part, end in zip(parts, ends, strict=True):
        own = slice(end - part.moving.shape[2], end)
        moving[own] = part.moving.transpose(2, 0, 1)
        if part.force is not None:
            right[own, :, :k] = part.force.transpose(2, 0, 1)
        if part.values is not None:
            right[own, :, k:] = part.values.transpose(2, 0, 1)
        if part.kicks is not None:
            for i, kick in enumerate(part.kicks):
                kicks[0][own, :, i] = kick.transpose(2, 0, 1)
    return [moving, right, *kicks], ends


def distinct(given: Sequence[np.ndarray], held: Container[int]) -> tuple[list[int], list[int]]:
    """Return numbers of the columns (columns, ...) of what is given that differ, and which of these each column is.

    -1 : none, for it is 0. held : columns that are like no other.
    """
    kept: list[int] = []
    place: list[int] = []
    for j in range(len(given[0])):
        others = (i for i in kept if i not in held and j not in held)
        like = next((i for i in others if all(np.array_equal(x[i], x[j]) for x in given)), j)
        if like == j and not any(x[j].any() for x in given):
            place.append(-1)
            continue
        kept += [j] * (like == j)
        place.append(kept.index(like))
    return kept, place


def at_all(x: np.ndarray, place: Sequence[int]) -> np.ndarray:
    """Return columns (S, n, ...) at the places where they belong."""
    if x.shape[1] == len(place):
        return x
    return np.concatenate([x, np.zeros((len(x), 1, *x.shape[2:]))], axis=1)[:, place]
