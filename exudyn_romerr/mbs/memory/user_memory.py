"""UserMemory: what user functions keep between their calls, put back after they were tried."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from .kept_values import Copies
from .memory_search import MemorySearch
from .plain_functions import keep_nothing
from .standstill import look_up, note


class _Snapshot:
    """The variables that some functions can change, and what they hold when this is made."""

    def __init__(self, mbs: Any, functions: Sequence[Callable], copies: Copies):
        copies.begin()
        search = MemorySearch(functions, copies)
        for space in () if mbs is None else (mbs.variables, mbs.sys):
            search.add_space(space)
        for function in functions:
            search.add_behind(function)
        self.of = mbs, *functions  # objects, whose numbers tell which functions these are
        self._open, self._variables = search.spaces, search.variables
        self.lost = ", ".join(sorted(search.lost)) if functions else ""

    def has_changed(self) -> bool:
        """Whether a variable is another one now."""
        return any(space.keys() != names for space, names in self._open) or any(
            v.has_changed() for v in self._variables
        )

    def restore(self) -> bool:
        """Put all variables back; return whether one was another."""
        changed = False
        for space, names in self._open:
            if space.keys() != names:
                changed = True
                for name in set(space) - names:
                    del space[name]
        for variable in self._variables:
            if variable.has_changed():
                changed = True
                variable.put_back()
        return changed


class UserMemory:
    """The variables that some functions can change: mbs.variables, mbs.sys, closures, globals, attributes, defaults.

    Those of functions that they call too, if these are of the same modules or others of the user's; attributes that
    they name of modules; and the generators of random numbers of random and numpy. Objects are put back in place,
    since other functions may hold them. Those of Exudyn, and of ours, stay what they are. Does not cover: what
    functions of libraries keep, attributes that a call adds to a class or a module.

    While no step is made, variables are searched once, and compared after that: where one is another, once more.
    Functions that only compute have none.

    Attributes
    ----------
    was_changed : whether a variable was another one when they were put back. lost : what cannot be put back, so that
    the functions must not be called: types of generators with yield, open files, sockets; empty if there is none.
    """

    was_changed = False

    def __init__(self, mbs: Any, functions: Sequence[Callable], copies: Copies):
        if functions and keep_nothing(functions):
            self._kept: _Snapshot | None = None
            self.lost = ""
            return
        key = UserMemory, id(mbs), *map(id, functions)
        self._kept = look_up(key)
        if self._kept is None or self._kept.has_changed():
            self._kept = note(key, _Snapshot(mbs, functions, copies))
        self.lost = self._kept.lost

    @property
    def changed(self) -> bool:
        """Whether a variable is another than when this was made."""
        return self._kept is not None and self._kept.has_changed()

    def restore(self) -> None:
        """Put all variables back."""
        self.was_changed = self._kept is not None and self._kept.restore()


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
