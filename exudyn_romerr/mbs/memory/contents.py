"""Contents: the objects that a value consists of; these very objects get back what was in them.

Other variables, and other parts of the same value, may hold them, too.
"""

from __future__ import annotations

import ctypes
import random
from array import array
from collections import OrderedDict, defaultdict, deque
from collections.abc import Iterable, Mapping
from itertools import chain
from types import SimpleNamespace
from typing import Any

import numpy as np

from .kept_values import NUMBERS, spaces_of

SIMPLE = frozenset(NUMBERS)
IN_A_ROW, BY_NAME = (list, tuple, deque), (dict, defaultdict, OrderedDict)  # and no class made of one of these
OF_C = ctypes.Structure.__base__  # of all that ctypes gives


class Contents:
    """What is in a list, a dict, a set, a tuple, or in the attributes of an object: objects, and what is in these.

    held : objects, by number, that stay what they are.
    """

    def __init__(self, value: Any, held: Mapping[int, Any], known: dict[int, Contents] | None = None):
        known = {} if known is None else known
        known[id(value)] = self  # first: it may be in itself
        self._value, self._items = value, None
        self._kind = tuple if isinstance(value, tuple) else type(value)
        self._spaces: list = [value] if self._kind in BY_NAME else []
        # of others, as exceptions, to ask for attributes alters how they are pickled
        by_attributes = self._kind.__new__ is object.__new__ or self._kind is SimpleNamespace
        if by_attributes and id(value) not in held:
            self._spaces = spaces_of(value)
        rows = [value] if self._kind in IN_A_ROW else [space.values() for space in self._spaces]
        self._names = [[*space] for space in self._spaces]
        if self._kind is set or (rows and all(map(_are_simple, rows))):
            self._items = [[*row] for row in rows or [value]]
            rows = []
        self._inner = [[known.get(id(x)) or Contents(x, held, known) for x in row] for row in rows]

    def put_back(self, before: Any, done: set[int] | None = None) -> Any:
        """Return the value with what was in it when this was made; before : a copy of it from then."""
        done, value = set() if done is None else done, self._value
        if before is value or self._kind in SIMPLE or id(self) in done:
            return value
        done.add(id(self))
        if self._kind is set:
            value.clear()
            value.update(self._items[0])
        elif self._kind in IN_A_ROW:
            [items] = self._items or self._put_back_in([before], done)
            if self._kind is not tuple:
                value.clear()
                value.extend(items)
        else:
            return self._filled(before, done)
        return value

    def _put_back_in(self, rows: Iterable[Iterable], done: set[int]) -> list[list]:
        """What is in it, with what was in that."""
        pairs = zip(self._inner, rows, strict=True)
        return [[x.put_back(y, done) for x, y in zip(*pair, strict=True)] for pair in pairs]

    def _filled(self, before: Any, done: set[int]) -> Any:
        """The same of what has names, and of all others."""
        others = [before] if self._kind in BY_NAME else spaces_of(before) if self._spaces else []
        if not others or [[*space] for space in others] != self._names:  # it is pickled by a way of its own
            return _put_back(self._value, before)
        items = self._items or self._put_back_in([space.values() for space in others], done)
        for space, names, values in zip(self._spaces, self._names, items, strict=True):
            space.clear()
            space.update(zip(names, values, strict=True))
        return self._value


def _are_simple(values: Iterable) -> bool:
    """Whether all are numbers or text, or all are tuples of such."""
    kinds = set(map(type, values))  # of many values at once
    return kinds <= SIMPLE or (kinds == {tuple} and SIMPLE.issuperset(map(type, chain.from_iterable(values))))


def _put_back(now: Any, before: Any) -> Any:
    """Return what is as `before`: the object that is there now, if its content can be changed."""
    has_content = _fill(now, before)
    spaces = spaces_of(before) if type(now) is type(before) else []
    for space, kept in zip(spaces_of(now) if spaces else [], spaces, strict=True):
        space.clear()
        space.update(kept)
    return now if has_content or spaces else before


def _fill(now: Any, before: Any) -> bool:
    """Put back what is in an object beside its attributes; return whether there is such a thing."""
    if isinstance(before, np.ndarray) and isinstance(now, np.ndarray) and now.shape == before.shape:
        if now.flags.writeable:
            now[...] = before
    elif isinstance(before, dict | set) and isinstance(now, type(before)):
        now.clear()
        now.update(before)
    elif isinstance(before, list | bytearray | array) and isinstance(now, type(before)):
        now[:] = before
    elif isinstance(before, deque) and isinstance(now, deque):
        now.clear()
        now.extend(before)
    elif isinstance(before, OF_C) and isinstance(now, type(before)):
        ctypes.memmove(ctypes.addressof(now), ctypes.addressof(before), ctypes.sizeof(before))
    elif isinstance(now, random.Random):
        now.setstate(before.getstate())
    elif isinstance(now, np.random.RandomState):
        now.set_state(before.get_state())
    elif isinstance(now, np.random.Generator):
        now.bit_generator.state = before.bit_generator.state
    else:
        return False
    return True
