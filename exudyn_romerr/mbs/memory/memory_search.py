"""MemorySearch: the variables that functions can change, wherever Python lets them keep something."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, MutableMapping
from functools import partial
from types import FunctionType, MethodType, ModuleType
from typing import Any

from .contents import Contents
from .kept_values import CACHED, WRAPPERS, Copies, Frozen, spaces_of
from .own_modules import content, module_of, names_in, reached
from .variables import Generator, Variable, generators, is_constant

SETS = re.compile(r"Set(\w+Parameter|(ODE1|ODE2|AE|Data)Coordinates(_t|_tt)?|SystemState|Time)$")  # of an mbs


class MemorySearch:
    """Finds variables: `spaces` (with the names in them), `variables`, and types of what is `lost` once it was read.

    What functions set in an mbs, or functions that they name, is lost, too: its items have too much to be copied.

    Looks into functions, classes and objects of the modules that the functions are of, of those that these were made
    with, and of those that they name and that are the user's own, and of no others: these are libraries.
    """

    def __init__(self, functions: Iterable[Callable], copies: Copies):
        self.spaces: list[tuple[MutableMapping, set]] = []
        self.variables: list[Variable | Generator] = [*generators()]
        self.lost: set[str] = set()
        self._copies = copies
        self._seen: dict[int, Any] = {}  # objects are kept, so that no other one gets their number
        codes = functions_behind(functions)
        inner = [f for code in codes for f in map(content, code.__closure__ or ()) if isinstance(f, FunctionType)]
        self._own = {module_of(f) for f in reached([*codes, *inner])}
        self.lost |= setters_in(codes)

    def add_space(self, space: MutableMapping) -> None:
        """Add all names of a dict or an object, and whether there are more."""
        self.spaces.append((space, set(space)))
        self._add_names(space, space)

    def add_variable(self, read: Callable[[], Any], write: Callable[[Any], None]) -> None:
        """Add a variable, and what is behind it."""
        value = read()
        if is_constant(value, self._own):
            self.variables.append(Variable(read, write, self._own, value))
            held: Iterable[Any] = (value,)
        else:
            found = Frozen.of(value, self._own)
            self.lost |= found.lost
            if found.kept is not None:
                kept = found.copied(self._copies), Contents(value, found.held)
                self.variables.append(Variable(read, write, self._own, value, *kept))
            held = found.held.values()
        for value in held:
            if self._is_own(value):
                self.add_behind(value)

    def add_behind(self, value: Any) -> None:
        """Add what a function, a method, a callable object, a partial, a class or another object keeps."""
        if id(value) in self._seen:
            return
        self._seen[id(value)] = value
        if isinstance(value, partial):
            self._add_values((value.func, *value.args, *value.keywords.values()))
        elif isinstance(value, MethodType):
            self._add_values((value.__func__, value.__self__))
        elif isinstance(value, FunctionType):
            self.add_space(vars(value))
            self._add_function(value)
        elif isinstance(value, staticmethod | classmethod):
            self._add_values((value.__func__,))
        elif isinstance(value, CACHED):  # what it keeps is what the function gave; that may keep something
            self._add_values((value.__wrapped__,))
        elif isinstance(value, property):
            self._add_values((value.fget, value.fset))
        elif isinstance(value, type):
            self._add_class(value)
        else:
            for space in spaces_of(value):
                self.add_space(space)
            if self._is_own(type(value)):
                self.add_behind(type(value))

    def _is_own(self, value: Any) -> bool:
        if isinstance(value, WRAPPERS):
            return True
        of = value if isinstance(value, FunctionType | type) else type(value)
        return getattr(of, "__module__", None) in self._own

    def _add_class(self, of: type) -> None:
        for name in [name for name in vars(of) if not name.startswith("__") or name == "__call__"]:
            self.add_variable(lambda name=name: vars(of).get(name), lambda x, name=name: setattr(of, name, x))

    def _add_values(self, values: Iterable[Any]) -> None:
        for value in values:
            self.add_variable(lambda value=value: value, _keep)

    def _add_names(self, space: MutableMapping, names: Iterable[str]) -> None:
        for name in [name for name in names if name in space]:
            self.add_variable(lambda name=name: space.get(name), lambda x, name=name: space.__setitem__(name, x))

    def _add_function(self, function: FunctionType) -> None:
        names = names_in(function.__code__)
        for cell in function.__closure__ or ():
            self.add_variable(partial(content, cell), partial(setattr, cell, "cell_contents"))
        self._add_values((*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()))
        self._add_names(function.__globals__, names)
        values = [function.__globals__.get(name) for name in names]
        for value in (*values, *map(content, function.__closure__ or ())):
            if isinstance(value, ModuleType):
                self._add_names(vars(value), names)


def setters_in(functions: Iterable[Callable]) -> set[str]:
    """Return the names of what these functions, and those that they name, set in an mbs."""
    return {
        name for code in reached(functions_behind(functions)) for name in names_in(code.__code__) if SETS.match(name)
    }


def functions_behind(functions: Iterable[Callable]) -> list[FunctionType]:
    """Return the Python functions behind functions, partials, methods and callable objects."""
    return [code for f in functions if (code := _code(f.func if isinstance(f, partial) else f))]


def _keep(_: Any) -> None:
    """What is put back in place needs no writing."""


def _code(f: Callable) -> FunctionType | None:
    """Return the Python function behind a function, a method or a callable object."""
    candidates = (f, getattr(f, "__func__", None), type(f).__call__)
    return next((of for of in candidates if isinstance(of, FunctionType)), None)
