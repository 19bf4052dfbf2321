"""UserMemory: what user functions keep between their calls, put back after they were tried."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np


class _Slot(NamedTuple):
    """A variable that a user function can change, and what it held, pickled."""

    read: Callable[[], Any]
    write: Callable[[Any], None]
    kept: bytes


class UserMemory:
    """The variables that some functions can change: mbs.variables, closures, globals, attributes, default values.

    Objects are put back in place, since other functions may hold them. Does not cover: what cannot be pickled,
    generators of random numbers, files.
    """

    def __init__(self, mbs: Any, functions: Sequence[Callable]):
        self._open = [(space, set(space)) for space in (mbs.variables, *map(_attributes, functions))]
        variables = [pair for space, _ in self._open for pair in _of_dict(space, space)]
        for function in map(_code, functions):
            variables += _of_function(function) if function else []
        kept = ((read, write, _pickled(read())) for read, write in variables)
        self._slots = [_Slot(*slot) for slot in kept if slot[2] is not None]

    @property
    def changed(self) -> bool:
        """Whether a variable is another than when this was made."""
        return any(set(space) != names for space, names in self._open) or any(map(_has_changed, self._slots))

    def restore(self) -> None:
        """Put all variables back."""
        for space, names in self._open:
            for name in set(space) - names:
                del space[name]
        for slot in filter(_has_changed, self._slots):
            slot.write(_put_back(slot.read(), pickle.loads(slot.kept)))


@contextmanager
def memory_kept(mbs: Any, functions: Sequence[Callable]) -> Iterator[UserMemory]:
    """Give the memory of user functions, and put it back."""
    memory = UserMemory(mbs, functions)
    try:
        yield memory
    finally:
        memory.restore()


def _has_changed(slot: _Slot) -> bool:
    return _pickled(slot.read()) != slot.kept


def _put_back(now: Any, before: Any) -> Any:
    """Return what is as `before`: the object that is there now, if its content can be changed."""
    if isinstance(before, np.ndarray) and isinstance(now, np.ndarray) and now.shape == before.shape:
        now[...] = before
    elif isinstance(before, dict | set) and isinstance(now, type(before)):
        now.clear()
        now.update(before)
    elif isinstance(before, list) and isinstance(now, list):
        now[:] = before
    elif hasattr(before, "__dict__") and type(now) is type(before):
        vars(now).clear()
        vars(now).update(vars(before))
    else:
        return before
    return now


def _attributes(f: Callable) -> dict[str, Any]:
    """Attributes of the object that a function is a method of, or of itself."""
    return getattr(getattr(f, "__self__", f), "__dict__", {})


def _code(f: Callable) -> FunctionType | None:
    """Return the Python function behind a function, a method or a callable object."""
    candidates = (f, getattr(f, "__func__", None), vars(type(f)).get("__call__"))
    return next((of for of in candidates if isinstance(of, FunctionType)), None)


def _of_function(function: FunctionType) -> list[tuple]:
    cells = [
        (lambda cell=cell: _content(cell), lambda x, cell=cell: setattr(cell, "cell_contents", x))
        for cell in function.__closure__ or ()
    ]
    defaults = [(lambda value=value: value, lambda _: None) for value in function.__defaults__ or ()]
    return [*cells, *defaults, *_of_dict(function.__globals__, function.__code__.co_names)]


def _of_dict(space: dict[str, Any], names: Sequence[str]) -> list[tuple]:
    """Ways to read and write some names of a dict."""
    return [
        (lambda name=name: space.get(name), lambda x, name=name: space.__setitem__(name, x))
        for name in names
        if name in space
    ]


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # empty: the variable is assigned later
        return None


def _pickled(value: Any) -> bytes | None:
    """Return its bytes; None of functions, classes, and what cannot be pickled (an mbs, a file, a module)."""
    try:
        return None if isinstance(value, FunctionType | type) else pickle.dumps(value)
    except Exception:  # whatever a script may hold
        return None
