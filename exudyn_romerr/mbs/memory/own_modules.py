"""Modules that functions are of, and those that they name, where these are the user's own."""

from __future__ import annotations

import sys
import sysconfig
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from .kept_values import OURS

PLACES = ("stdlib", "platstdlib", "purelib", "platlib")
INSTALLED = tuple({str(Path(sysconfig.get_path(place)).resolve()) for place in PLACES})


def modules_of(functions: list[FunctionType]) -> set[str]:
    """Return names of modules of functions, and of what these name, and so on, if neither installed nor ours."""
    found, waiting, seen = {_module(f) for f in functions}, [*functions], set()
    while waiting:
        f = waiting.pop()
        if f.__code__ in seen:
            continue
        seen.add(f.__code__)
        names = names_in(f.__code__)
        values = [*(f.__globals__.get(name) for name in names), *map(content, f.__closure__ or ())]
        spaces = [vars(value) for value in values if isinstance(value, ModuleType) and _is_users(value.__name__)]
        values += [space.get(name) for space in spaces for name in names]
        others = [value for value in values if isinstance(value, FunctionType) and _is_users(_module(value))]
        found |= {_module(other) for other in others}
        waiting += others
    return found


def names_in(code: CodeType) -> list[str]:
    """Return names of globals and attributes in a function, and in those defined in it."""
    inner = [name for own in code.co_consts if isinstance(own, CodeType) for name in names_in(own)]
    return list(dict.fromkeys([*code.co_names, *inner]))


def content(cell: Any) -> Any:
    """Return what a variable of a closure stands for; None: nothing yet."""
    try:
        return cell.cell_contents
    except ValueError:
        return None


def _module(f: FunctionType) -> str:
    return f.__globals__.get("__name__", "")


@cache
def _is_users(name: str) -> bool:
    """Whether a module is in a file that nobody has installed; found once, for it takes a look at the disk."""
    file = getattr(sys.modules.get(name), "__file__", None)
    is_known = file is None or name.split(".")[0] == OURS
    return not is_known and not str(Path(file).resolve()).startswith(INSTALLED)
