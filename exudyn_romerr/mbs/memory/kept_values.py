"""Values of variables, pickled, but for objects that stay what they are."""

from __future__ import annotations

import copyreg
import io
import pickle
import sys
from collections.abc import Iterator, MutableMapping, Sequence
from functools import lru_cache, partial
from types import FunctionType, MemberDescriptorType, MethodType, ModuleType
from typing import Any, NamedTuple

import numpy as np

OURS = __name__.split(".")[0]
EXUDYN = "exudynCPP"  # in the name of its compiled module, of which there are several
MESHES = "exudyn.FEM"  # of which an mbs has what it needs: megabytes of arrays that no run looks at
CACHED = type(lru_cache(abs))
WRAPPERS = CACHED | partial | MethodType | staticmethod | classmethod | property
NUMBERS = (type(None), bool, int, float, complex, str, bytes)
PROTOCOL = 5  # contents of arrays may stay where they are
ITERATORS = ("builtins", "itertools")
STREAMS = ("__next__", "fileno")  # of iterators and open files, of files and sockets


class Copies:
    """Copies of contents of arrays, made once while these stay the same: to compare costs less than fresh memory."""

    def __init__(self) -> None:
        self._kept: list[bytes] = []
        self._next = 0

    def begin(self) -> None:
        """What is asked for from now on comes in the same order as before, most often."""
        del self._kept[self._next :]
        self._next = 0

    def of(self, content: memoryview) -> bytes:
        """Return a copy."""
        i, self._next = self._next, self._next + 1
        if i < len(self._kept) and _same_bytes(self._kept[i], content):
            return self._kept[i]
        self._kept[i:] = [bytes(content)]
        return self._kept[i]


class Frozen(NamedTuple):
    """A value, pickled, but for contents of arrays and objects that stay what they are; None: that failed.

    arrays : those contents. held : those objects, by number. lost : types of what is lost once it was read.
    """

    kept: bytes | None
    arrays: Sequence[bytes | memoryview]
    held: dict[int, Any]
    lost: set[str]

    @classmethod
    def of(cls, value: Any, own: set[str]) -> Frozen:
        """Pickle a value, whatever a script may hold; arrays are where they were."""
        if type(value) in NUMBERS:
            return cls(pickle.dumps(value, PROTOCOL), (), {}, set())
        if stays(value, own):
            return cls(b"%d" % id(value), (), {id(value): value}, set())
        file = io.BytesIO()
        pickler = _Pickler(file, own)
        try:
            pickler.dump(value)
        except Exception:
            return cls(None, (), pickler.held, pickler.lost)
        return cls(file.getvalue(), [array.raw() for array in pickler.arrays], pickler.held, pickler.lost)

    def copied(self, copies: Copies) -> Frozen:
        """Return the same with arrays of its own."""
        return self._replace(arrays=[copies.of(array) for array in self.arrays])

    def is_as(self, other: Frozen) -> bool:
        """Whether it is the same value."""
        same = self.kept == other.kept and len(self.arrays) == len(other.arrays)
        return same and all(map(_same_bytes, self.arrays, other.arrays))

    def thawed(self) -> Any:
        """Return a copy of the value."""
        for number, value in self.held.items():
            if self.kept == b"%d" % number:
                return value
        return _Unpickler(self.kept, self.held, [bytearray(array) for array in self.arrays]).load()


class _Pickler(pickle.Pickler):
    """Leaves functions, classes, objects of some modules, and what cannot be pickled, what they are.

    Those of Exudyn are the run's; some warn, too, when they are pickled (SystemContainer, of GetRenderState).
    """

    def __init__(self, file: io.BytesIO, own: set[str]):
        self.arrays: list[pickle.PickleBuffer] = []
        super().__init__(file, PROTOCOL, buffer_callback=self.arrays.append)
        self.held: dict[int, Any] = {}
        self.lost: set[str] = set()
        self._own = own

    def reducer_override(self, value: Any) -> Any:
        """Return how a value is pickled that is no number, text, or container of Python's own."""
        if value is _same or isinstance(value, np.generic | np.ndarray):  # of which there may be many
            return NotImplemented
        found = None if stays(value, self._own) else self._reduced(value)
        if found is None:
            self.held[id(value)] = value
            found = _same, (id(value),)
        return found

    def _reduced(self, value: Any) -> Any:
        if isinstance(value, Iterator) and type(value).__module__ in ITERATORS:  # some can be copied, none set back
            self.lost.add(type(value).__name__)
        if type(value) in copyreg.dispatch_table:
            return NotImplemented
        try:
            return value.__reduce_ex__(PROTOCOL)
        except Exception:
            printed = value is sys.stdout or value is sys.stderr  # nothing is read from there
            if isinstance(value, memoryview) or (not printed and any(hasattr(type(value), name) for name in STREAMS)):
                self.lost.add(type(value).__name__)
            return None


class _Unpickler(pickle.Unpickler):
    """Gives objects that stay what they are."""

    def __init__(self, kept: bytes, held: dict[int, Any], arrays: Sequence[bytearray]):
        super().__init__(io.BytesIO(kept), buffers=arrays)
        self._held = held

    def find_class(self, module: str, name: str) -> Any:
        """Return what a name stands for."""
        if (module, name) == (_same.__module__, _same.__name__):
            return self._held.__getitem__
        return super().find_class(module, name)


def _same(number: int) -> Any:
    """Stands in pickled values for the object of a number."""


def stays(value: Any, own: set[str]) -> bool:
    """Whether an object stays what it is: it is not pickled; what is behind it is other variables'."""
    kind = type(value)
    if isinstance(value, FunctionType | type | ModuleType | WRAPPERS):
        return True
    if kind.__module__ in own and kind.__new__ is object.__new__:  # it is all in its attributes
        return True
    return EXUDYN in kind.__module__ or kind.__module__ == MESHES or kind.__module__.split(".")[0] == OURS


def _same_bytes(one: bytes | memoryview, other: bytes | memoryview) -> bool:
    """Whether both have the same content: 8 bytes at once, where they can be."""
    if len(one) != len(other) or not len(one):
        return len(one) == len(other)
    kind = np.uint64 if len(one) % 8 == 0 else np.uint8
    return bool((np.frombuffer(one, kind) == np.frombuffer(other, kind)).all())


class _Slots(MutableMapping):
    """Attributes of an object that has __slots__, as a dict of those that are set."""

    def __init__(self, value: Any):
        classes = [of for of in type(value).__mro__ if "__slots__" in vars(of)]  # members of others may be read-only
        found = [d for of in classes for d in vars(of).values() if isinstance(d, MemberDescriptorType)]
        self._value, self.names = value, {(d.__objclass__, d.__name__): d for d in found}

    def __getitem__(self, name: tuple) -> Any:
        try:
            return self.names[name].__get__(self._value)
        except AttributeError:
            raise KeyError(name) from None

    def __setitem__(self, name: tuple, x: Any) -> None:
        self.names[name].__set__(self._value, x)

    def __delitem__(self, name: tuple) -> None:
        self.names[name].__delete__(self._value)

    def __iter__(self) -> Iterator[tuple]:
        return (name for name in self.names if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)


def spaces_of(value: Any) -> list[MutableMapping]:
    """Return where the attributes of an object of a Python class are."""
    slots = _Slots(value)
    spaces = [vars(value)] if hasattr(value, "__dict__") else []
    return [*spaces, slots] if slots.names else spaces
