"""UserMemory: what user functions keep between their calls, put back after they were tried."""

from __future__ import annotations

import pickle
import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from types import FunctionType, MethodType
from typing import Any, NamedTuple

import numpy as np


class _Slot(NamedTuple):
    """A variable that a user function can change, and what it held, pickled."""

    read: Callable[[], Any]
    write: Callable[[Any], None]
    kept: bytes


RANDOM = ((random.getstate, random.setstate), (np.random.get_state, np.random.set_state))


class UserMemory:
    """The variables that some functions can change: mbs.variables, closures, globals, attributes, default values.

    Those of functions that they call too, if these are of the same module; and the generators of random numbers of
    random and numpy. Objects are put back in place, since other functions may hold them. Does not cover: what cannot
    be pickled (generators with yield, open files), and what functions of other modules keep.

    Attributes
    ----------
    was_changed : whether a variable was another one when they were put back.
    """

    was_changed = False

    def __init__(self, mbs: Any, functions: Sequence[Callable]):
        self._open = [(space, set(space)) for space in (mbs.variables, *map(_attributes, functions))]
        here, seen = {}, {}  # objects are kept, so that no other one gets their number
        variables = [pair for space, _ in self._open for pair in _of_dict(space, space)]
        self._slots = [slot for pair in (*RANDOM, *variables) for slot in _of_variable(*pair, here, seen)]
        for function in functions:
            self._slots += _of_callable(function, seen)

    @property
    def changed(self) -> bool:
        """Whether a variable is another than when this was made."""
        return any(set(space) != names for space, names in self._open) or any(map(_has_changed, self._slots))

    def restore(self) -> None:
        """Put all variables back."""
        self.was_changed = any(set(space) != names for space, names in self._open)
        for space, names in self._open:
            for name in set(space) - names:
                del space[name]
        for slot in filter(_has_changed, self._slots):
            self.was_changed = True
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
    elif isinstance(now, random.Random):
        now.setstate(before.getstate())
    elif isinstance(now, np.random.RandomState):
        now.set_state(before.get_state())
    elif isinstance(now, np.random.Generator):
        now.bit_generator.state = before.bit_generator.state
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


def _of_callable(f: Callable, seen: dict[int, Any]) -> Iterator[_Slot]:
    """What a function, a method, a callable object or a partial keeps."""
    if id(f) in seen:
        return
    seen[id(f)] = f
    if isinstance(f, partial):
        yield from _of_callable(f.func, seen)
        space = getattr(_code(f.func), "__globals__", {})
        for value in (*f.args, *f.keywords.values()):
            yield from _of_variable(lambda value=value: value, _keep, space, seen)
    elif function := _code(f):
        for read, write in _of_function(function):
            yield from _of_variable(read, write, function.__globals__, seen)


def _of_variable(read: Callable, write: Callable, space: dict[str, Any], seen: dict[int, Any]) -> Iterator[_Slot]:
    """A variable, or what is behind it; space: globals of the module whose functions and classes are looked into."""
    value = read()
    if isinstance(value, FunctionType | MethodType | partial):
        if getattr(_code(value), "__globals__", space) is space:
            yield from _of_callable(value, seen)
            yield from _of_space(_attributes(value), space, seen)
    elif isinstance(value, type):
        if value.__module__ == space.get("__name__") and id(value) not in seen:
            seen[id(value)] = value
            for name in [name for name in vars(value) if not name.startswith("__")]:
                yield from _of_variable(
                    lambda name=name: vars(value).get(name), lambda x, name=name: setattr(value, name, x), space, seen
                )
    elif (kept := _pickled(value)) is not None:
        yield _Slot(read, write, kept)
    elif type(value).__module__ == space.get("__name__"):
        yield from _of_space(getattr(value, "__dict__", {}), space, seen)


def _of_space(names: dict[str, Any], space: dict[str, Any], seen: dict[int, Any]) -> Iterator[_Slot]:
    """Attributes of an object."""
    if id(names) not in seen:
        seen[id(names)] = names
        for pair in _of_dict(names, list(names)):
            yield from _of_variable(*pair, space, seen)


def _keep(_: Any) -> None:
    """What is put back in place needs no writing."""


def _of_function(function: FunctionType) -> list[tuple]:
    cells = [
        (lambda cell=cell: _content(cell), lambda x, cell=cell: setattr(cell, "cell_contents", x))
        for cell in function.__closure__ or ()
    ]
    values = (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values())
    defaults = [(lambda value=value: value, _keep) for value in values]
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
