"""UserMemory: what user functions keep between their calls, put back after they were tried."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from .kept_values import Copies, spaces_of
from .memory_search import MemorySearch

RANDOM = ((random.getstate, random.setstate), (np.random.get_state, np.random.set_state))


class UserMemory:
    """The variables that some functions can change: mbs.variables, mbs.sys, closures, globals, attributes, defaults.

    Those of functions that they call too, if these are of the same modules; attributes that they name of modules; and
    the generators of random numbers of random and numpy. Objects are put back in place, since other functions may
    hold them. Those of Exudyn, and of ours, stay what they are. Does not cover: what functions of other modules keep,
    attributes that a call adds to a class or a module.

    Attributes
    ----------
    was_changed : whether a variable was another one when they were put back. lost : what cannot be put back, so that
    the functions must not be called: types of generators with yield, open files, sockets; empty if there is none.
    """

    was_changed = False

    def __init__(self, mbs: Any, functions: Sequence[Callable], copies: Copies):
        copies.begin()
        search = MemorySearch(functions, copies)
        for pair in RANDOM:
            search.add_variable(*pair)
        for space in () if mbs is None else (mbs.variables, mbs.sys):
            search.add_space(space)
        for function in functions:
            search.add_behind(function)
        self._open, self._variables = search.spaces, search.variables
        self.lost = ", ".join(sorted(search.lost)) if functions else ""

    @property
    def changed(self) -> bool:
        """Whether a variable is another than when this was made."""
        return any(set(space) != names for space, names in self._open) or any(
            v.has_changed() for v in self._variables
        )

    def restore(self) -> None:
        """Put all variables back."""
        self.was_changed = any(set(space) != names for space, names in self._open)
        for space, names in self._open:
            for name in set(space) - names:
                del space[name]
        for variable in self._variables:
            if variable.has_changed():
                self.was_changed = True
                before = variable.before()
                variable.write(before if variable.stays(before) else _put_back(variable.read(), before))


@contextmanager
def memory_kept(mbs: Any, functions: Sequence[Callable], copies: Copies | None = None) -> Iterator[UserMemory]:
    """Give the memory of user functions, and put it back; copies: made before, for the same functions.

    mbs : None if it is gone; what it held is, too.
    """
    memory = UserMemory(mbs, functions, Copies() if copies is None else copies)
    try:
        yield memory
    finally:
        memory.restore()


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
    elif type(now) is type(before) and spaces_of(before):
        for space, kept in zip(spaces_of(now), spaces_of(before), strict=True):
            space.clear()
            space.update(kept)
    else:
        return before
    return now
