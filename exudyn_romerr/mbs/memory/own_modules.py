"""Functions that functions know by name, in modules that are the user's own."""

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


def reached(functions: list[FunctionType]) -> list[FunctionType]:
    """Return functions, and those that they know by name and may call: of the same module or one of the user's."""
    found = []
    while functions:
        f, *functions = functions
        if f not in found:
            found.append(f)
            names = names_in(f.__code__)
            values = [*(f.__globals__.get(name) for name in names), *map(content, f.__closure__ or ())]
            spaces = [vars(value) for value in values if isinstance(value, ModuleType) and _is_users(value.__name__)]
            values += [space.get(name) for space in spaces for name in names]
            others = [value for value in values if isinstance(value, FunctionType)]
            functions += [g for g in others if module_of(g) == module_of(f) or _is_users(module_of(g))]
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


def module_of(f: FunctionType) -> str:
    """Return the name of the module that a function is of."""
    return f.__globals__.get("__name__", "")


@cache
def _is_users(name: str) -> bool:
    """Whether a module is in a file that nobody has installed; found once, for it takes a look at the disk."""
    file = getattr(sys.modules.get(name), "__file__", None)
    is_known = file is None or name.split(".")[0] == OURS
    return not is_known and not str(Path(file).resolve()).startswith(INSTALLED)
