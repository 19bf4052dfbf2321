"""Variables that user functions can change: what they hold, and how that is put back."""

from __future__ import annotations

import pickle
import random
from collections.abc import Callable
from types import BuiltinFunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from .contents import Contents
from .kept_values import NUMBERS, PROTOCOL, Frozen, stays


class Variable(NamedTuple):
    """A variable, and what it held: `value`, whose content can change if it is frozen, too.

    own : names of the modules of the functions. contents : of the value, if that can change.
    """

    read: Callable[[], Any]
    write: Callable[[Any], None]
    own: set[str]
    value: Any
    frozen: Frozen | None = None
    contents: Contents | None = None

    def has_changed(self) -> bool:
        """Whether it holds something else now."""
        now = self.read()
        if self.frozen is not None:
            return not self.frozen.is_as(Frozen.of(now, self.own))
        return now is not self.value and not Frozen.of(self.value, self.own).is_as(Frozen.of(now, self.own))

    def put_back(self) -> None:
        """Let it hold what it held, with the same content."""
        self.write(self.value if self.frozen is None else self.contents.put_back(self.frozen.thawed()))


class Generator(NamedTuple):
    """A generator of random numbers that all modules share, and its state, which can be compared."""

    read: Callable[[], Any]
    write: Callable[[Any], None]
    state: Any

    def has_changed(self) -> bool:
        """Whether numbers were drawn since."""
        return self.read() != self.state

    def put_back(self) -> None:
        """Set the state."""
        self.write(self.state)


def generators() -> list[Generator]:
    """Return those of random and of numpy as they are now."""
    return [Generator(read, write, read()) for read, write in RANDOM]


def is_constant(value: Any, own: set[str]) -> bool:
    """Whether an object has, or counts as having, the same content as long as it is the same object."""
    kind = type(value)
    if kind is tuple:
        return all(map(_is_number, value))
    if kind is BuiltinFunctionType:  # of a module; that of a list is its method
        return isinstance(value.__self__, ModuleType)
    return _is_number(value) or kind is np.ufunc or stays(value, own)


def _is_number(value: Any) -> bool:
    kind = type(value)
    return kind in NUMBERS or (issubclass(kind, np.number | np.bool_) and kind.__module__ == "numpy")


def _state_of_numpy() -> bytes:
    return pickle.dumps(np.random.get_state(legacy=False), PROTOCOL)  # it holds an array


def _set_state_of_numpy(state: bytes) -> None:
    np.random.set_state(pickle.loads(state))


RANDOM = ((random.getstate, random.setstate), (_state_of_numpy, _set_state_of_numpy))
