"""User functions that read an mbs by a name from outside, in place of the one that they are given.

Copies of the mbs, in which a mechanism is asked, then show the motion of the run.
"""

from __future__ import annotations

import dis
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from types import CodeType, FunctionType
from typing import Any, NamedTuple

import exudyn as exu

from ..access.load_functions import load_functions, loads_with_functions
from ..memory.memory_search import functions_behind
from ..memory.own_modules import content, reached

GLOBALS = ("LOAD_GLOBAL", "LOAD_NAME")


class Outside(NamedTuple):
    """A function, the variable by which it reads an mbs, and the user function that calls it."""

    function: str
    variable: str
    user_function: FunctionType

    def __str__(self) -> str:
        """What it does, and what to type."""
        own = self.user_function.__name__
        code, by = self.user_function.__code__, "" if own == self.function else f" calls {self.function}, which"
        names = list(code.co_varnames[: code.co_argcount])
        is_method = bool(names) and names[0] == "self"
        names[is_method : is_method + 1] = ["mbs"]
        head = f"lambda {', '.join(names)}: ..." if own == "<lambda>" else f"def {own}({', '.join(names)})"
        return (
            f"the user function {own}{by} reads {self.variable!r} from outside: let it read the mbs that it is given "
            f"as its first argument, {head}, in place of that variable"
        )


def read_outside(functions: Iterable[Callable]) -> list[Outside]:
    """Return by what variables functions, and those that they know by name, read an mbs from outside."""
    found = []
    for f in functions:
        held = [name for name, value in _held(f) if isinstance(value, exu.MainSystem)]
        for behind in functions_behind([f]):
            found += [Outside(behind.__name__, name, behind) for name in held]
            found += [Outside(g.__name__, name, behind) for g in reached([behind]) for name in _outer(g)]
    return list(dict.fromkeys(found))


def hint_of(functions: Iterable[Callable]) -> str:
    """Return in words which of the functions do so, and what to type; empty: none."""
    return ", and ".join(dict.fromkeys(map(str, read_outside(functions))))


def hints(mbs: Any) -> list[str]:
    """Return the same of all loads and objects of an mbs, with the names of these."""
    return [f"{name}: {hint}" for name, functions in _named(mbs) if (hint := hint_of(functions))]


def _named(mbs: Any) -> Iterator[tuple[str, list[Callable]]]:
    """Loads and objects, and their user functions."""
    for i in loads_with_functions(mbs):
        load = mbs.GetLoad(i)
        yield f"load {i} ({load['name']})", load_functions(load)
    for i in range(mbs.systemData.NumberOfObjects()):
        item = mbs.GetObject(i)
        values = [value for key, value in item.items() if key.endswith("UserFunction") and value]
        functions = [v.get("function") if isinstance(v, dict) else v for v in values]
        if any(map(callable, functions)):
            yield f"object {i} ({item['name']}, {item['objectType']})", list(filter(callable, functions))


def _held(f: Callable) -> Iterator[tuple[str, Any]]:
    """What a partial or a callable object holds, and names of it."""
    if isinstance(f, partial):
        yield from (("an argument of partial", value) for value in f.args)
        yield from f.keywords.items()
    of = getattr(f, "__self__", f)
    if not isinstance(of, FunctionType):
        yield from ((f"self.{name}", value) for name, value in getattr(of, "__dict__", {}).items())


def _outer(f: FunctionType) -> list[str]:
    """Variables outside a function by which it reads an mbs."""
    values = {name: f.__globals__.get(name) for name in _globals(f.__code__)}
    values |= dict(zip(f.__code__.co_freevars, map(content, f.__closure__ or ()), strict=True))
    values |= _defaults(f)
    return [name for name, value in values.items() if isinstance(value, exu.MainSystem)]


def _defaults(f: FunctionType) -> dict[str, Any]:
    """Arguments that have a value if none is passed."""
    given, code = f.__defaults__ or (), f.__code__
    names = code.co_varnames[code.co_argcount - len(given) : code.co_argcount]
    return {**dict(zip(names, given, strict=True)), **(f.__kwdefaults__ or {})}


def _globals(code: CodeType) -> Iterator[str]:
    """Global names that are read in a function, and in those defined in it; attributes are none."""
    for one in dis.get_instructions(code):
        if one.opname in GLOBALS:
            yield one.argval
    for inner in (x for x in code.co_consts if isinstance(x, CodeType)):
        yield from _globals(inner)
