"""Values of variables, pickled, but for objects that stay what they are."""

from __future__ import annotations

import copyreg
import io
import pickle
import sys
from collections.abc import Callable, Iterator, MutableMapping
from functools import partial
from types import FunctionType, MemberDescriptorType, MethodType, ModuleType
from typing import Any, NamedTuple

import numpy as np

OURS = __name__.split(".")[0]
EXUDYN = "exudynCPP"  # in the name of its compiled module, of which there are several
WRAPPERS = partial | MethodType | staticmethod | classmethod | property
STREAMS = ("__next__", "fileno")  # of generators and open files, of files and sockets


class Variable(NamedTuple):
    """A variable that a user function can change, and what it held: pickled, but for objects that stay what they are.

    own : names of modules. held : those objects, by number.
    """

    read: Callable[[], Any]
    write: Callable[[Any], None]
    own: set[str]
    kept: bytes | None
    held: dict[int, Any]

    def has_changed(self) -> bool:
        """Whether it holds something else now."""
        return Frozen.of(self.read(), self.own).kept != self.kept

    def before(self) -> Any:
        """Return a copy of what it held."""
        return _Unpickler(self.kept, self.held).load()

    def stays(self, value: Any) -> bool:
        """Whether an object is itself, no copy."""
        return self.held.get(id(value)) is value


class Frozen(NamedTuple):
    """A value, pickled; objects that stay what they are, by number; types of what is lost once it was read."""

    kept: bytes | None
    held: dict[int, Any]
    lost: set[str]

    @classmethod
    def of(cls, value: Any, own: set[str]) -> Frozen:
        """Pickle a value; None if that fails, whatever a script may hold."""
        file = io.BytesIO()
        pickler = _Pickler(file, own)
        try:
            pickler.dump(value)
        except Exception:
            return cls(None, pickler.held, pickler.lost)
        return cls(file.getvalue(), pickler.held, pickler.lost)


class _Pickler(pickle.Pickler):
    """Leaves functions, classes, objects of some modules, and what cannot be pickled, what they are.

    Those of Exudyn are the run's; some warn, too, when they are pickled (SystemContainer, of GetRenderState).
    """

    def __init__(self, file: io.BytesIO, own: set[str]):
        super().__init__(file)
        self.held: dict[int, Any] = {}
        self.lost: set[str] = set()
        self._own = own

    def reducer_override(self, value: Any) -> Any:
        """Return how a value is pickled that is no number, text, or container of Python's own."""
        if value is _same or isinstance(value, np.generic | np.ndarray):  # of which there may be many
            return NotImplemented
        found = None if self._stays(value) else self._reduced(value)
        if found is None:
            self.held[id(value)] = value
            found = _same, (id(value),)
        return found

    def _stays(self, value: Any) -> bool:
        kind = type(value)
        if isinstance(value, FunctionType | type | ModuleType | WRAPPERS):
            return True
        if kind.__module__ in self._own and kind.__new__ is object.__new__:  # it is all in its attributes
            return True
        return EXUDYN in kind.__module__ or kind.__module__.split(".")[0] == OURS

    def _reduced(self, value: Any) -> Any:
        if type(value) in copyreg.dispatch_table:
            return NotImplemented
        try:
            return value.__reduce_ex__(pickle.DEFAULT_PROTOCOL)
        except Exception:
            printed = value is sys.stdout or value is sys.stderr  # nothing is read from there
            if not printed and any(hasattr(type(value), name) for name in STREAMS):
                self.lost.add(type(value).__name__)
            return None


class _Unpickler(pickle.Unpickler):
    """Gives objects that stay what they are."""

    def __init__(self, kept: bytes, held: dict[int, Any]):
        super().__init__(io.BytesIO(kept))
        self._held = held

    def find_class(self, module: str, name: str) -> Any:
        """Return what a name stands for."""
        if (module, name) == (_same.__module__, _same.__name__):
            return self._held.__getitem__
        return super().find_class(module, name)


def _same(number: int) -> Any:
    """Stands in pickled values for the object of a number."""


class _Slots(MutableMapping):
    """Attributes of an object that has __slots__, as a dict of those that are set."""

    def __init__(self, value: Any):
        found = [d for of in type(value).__mro__ for d in vars(of).values() if isinstance(d, MemberDescriptorType)]
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
