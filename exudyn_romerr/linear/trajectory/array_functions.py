"""Functions of one time that use Python's `math`, min, max or float as functions of many: with others in their place.

A copy of the function runs, which sees copies of the names that it uses: what it was given stays as it is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial, reduce
from types import CellType, CodeType, FunctionType, SimpleNamespace
from typing import Any

import numpy as np

TAKE_ARRAYS = ("numpy", "scipy")  # libraries whose functions do without
OTHER_NAMES = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "pow": "float_power"}
SAME_NAMES = (
    *("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "expm1", "log10", "log1p", "log2", "sqrt"),
    *("fabs", "floor", "ceil", "copysign", "degrees", "radians"),
)


def _log(x: Any) -> Any:
    """NumPy's without its second argument, which it writes to: in math that is a base."""
    return np.log(x)


# what is not here, as hypot, whose third argument NumPy's writes to, fails with arrays; float_power, for whole
# numbers overflow in NumPy's power
BY_NAME = {name: getattr(np, OTHER_NAMES.get(name, name)) for name in (*SAME_NAMES, *OTHER_NAMES)} | {"log": _log}
IN_NUMPY = {id(getattr(math, name)): f for name, f in BY_NAME.items()}
_NUMPYS = {id(value) for value in IN_NUMPY.values()}
OF_MATH = SimpleNamespace(
    **BY_NAME,
    **{name: getattr(math, name) for name in ("pi", "e", "tau", "inf", "nan")},
)


def _chosen(replaces: Callable, x: Any, y: Any) -> Any:
    """Return y where it replaces x, as min and max do."""
    found = np.where(replaces(y, x), y, x)
    return found.view(next(type(z) for z in (x, y) if np.ndim(z)))


def _of_arrays(given: Callable, replaces: Callable, *values: Any, **options: Any) -> Any:
    """Return Python's min or max, `given`, of several numbers or arrays, time by time."""
    if options or len(values) < 2 or not any(map(np.ndim, values)):
        return given(*values, **options)
    return reduce(partial(_chosen, replaces), values)


def _float(*values: Any) -> Any:
    """Return what float does, of arrays too: not the same one, as of a number."""
    if len(values) == 1 and np.ndim(values[0]):
        return np.array(values[0], dtype=float, subok=True)
    return float(*values)


OF_PYTHON = {min: partial(_of_arrays, min, np.less), max: partial(_of_arrays, max, np.greater), float: _float}
_OTHERS = _NUMPYS | {id(f) for f in OF_PYTHON.values()}


def with_arrays(f: Callable) -> Callable | None:
    """Return a copy of a Python function, and of those that it calls, for arrays; None if nothing in them differs."""
    made: dict[int, Any] = {}
    copied = _copied(f, made)
    return copied if any(value is OF_MATH or id(value) in _OTHERS for value in made.values()) else None


def _copied(value: Any, made: dict[int, Any]) -> Any:
    """What stands in place of a value that a function uses; made : of others, by number."""
    if value is math:
        made[id(value)] = OF_MATH
    elif id(value) in IN_NUMPY:
        made[id(value)] = IN_NUMPY[id(value)]
    elif type(value) is FunctionType and id(value) not in made and _library(value) not in TAKE_ARRAYS:
        _copy(value, made)
    return made.get(id(value), value)


def _library(f: FunctionType) -> str:
    return (f.__module__ or "").partition(".")[0]


def _copy(f: FunctionType, made: dict[int, Any]) -> None:
    names: dict[str, Any] = {}
    cells = tuple(CellType() for _ in f.__closure__ or ())
    copied = FunctionType(f.__code__, names, f.__name__, f.__defaults__, cells)
    copied.__kwdefaults__ = f.__kwdefaults__
    made[id(f)] = copied  # first: it may call itself
    used = {"__builtins__", *_names(f.__code__)}
    for name in used & f.__globals__.keys():
        names[name] = _copied(f.__globals__[name], made)
    for of_python, of_arrays in OF_PYTHON.items():
        if of_python.__name__ in used - f.__globals__.keys():
            names[of_python.__name__] = made[id(of_python)] = of_arrays
    for mine, its in zip(cells, f.__closure__ or (), strict=True):
        with suppress(ValueError):  # it is empty
            mine.cell_contents = _copied(its.cell_contents, made)


def _names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)
