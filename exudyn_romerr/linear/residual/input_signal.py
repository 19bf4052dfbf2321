"""InputSignal: the user's input function over time, called for many times at once where that is the same, checked.

Functions of one time that use Python's `math`, min, max or float run with others in their place: a copy of the
function runs, which sees copies of the names that it uses, so that what it was given stays as it is.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import partial, reduce
from types import CellType, CodeType, FunctionType, SimpleNamespace
from typing import Any

import numpy as np

from ...checks import check_array
from ...errors import InputError

COMPARED = 256  # of the values that one call gives for many times every so many-th, and the last, are called singly
FEW = 3  # times that are called one by one
LAST_DIGITS = 1e-15  # of the largest value
PARTS, SHARE = 64, 1 / 32  # of times that branch: with more calls than either they are called one by one
TAKE_ARRAYS = ("numpy", "scipy")  # libraries whose functions do without
OTHER_NAMES = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "pow": "float_power"}
SAME_NAMES = (
    *("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "expm1", "log10", "log1p", "log2", "sqrt"),
    *("fabs", "floor", "ceil", "copysign", "degrees", "radians"),
)


class _MixedError(Exception):
    """A condition holds at some times and does not at others."""


class _Times(np.ndarray):
    """Many times, for functions of one time: where a condition is the same at all of them, it may be asked for.

    asked : whether one was since this was set to False.
    """

    asked = False

    def __bool__(self) -> bool:
        _Times.asked = True
        holds = self.view(np.ndarray)
        if holds.any() and not holds.all():
            raise _MixedError
        return bool(holds.any())


def values_at_once(f: Callable, t: np.ndarray, p: int) -> np.ndarray | None:
    """Return f at times t (T,) from few calls, (T, p); None unless it takes arrays as NumPy functions do.

    Where it branches, times are halved until all of a part take the same branch. Values that are the same at all
    times may be single numbers. Some are compared with single calls. One that uses Python's math is called with
    NumPy's functions in its place: values are the same but for their last digit.
    """
    found = _values_at_once(f, t, p, f, 0.0)
    if found is not None:
        return found
    try:
        other = with_arrays(f)
    except Exception:  # whatever a user's function consists of
        return None
    return None if other is None else _values_at_once(other, t, p, f, LAST_DIGITS)


def _values_at_once(of_many: Callable, t: np.ndarray, p: int, f: Callable, rounding: float) -> np.ndarray | None:
    """The same of a function of many times, compared with f; rounding : relative, what both may differ by."""
    values, parts, calls = np.empty((len(t), p)), [slice(0, len(t))], max(PARTS, int(SHARE * len(t)))
    compared = set(range(0, len(t), COMPARED))
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # they would be of our call, not of the user's
            while parts:
                part, calls = parts.pop(), calls - 1
                try:
                    _put(of_many, t[part], values[part])
                    compared.add(part.stop - 1)
                except _MixedError:
                    middle = (part.start + part.stop) // 2
                    parts += [slice(middle, part.stop), slice(part.start, middle)]
                if calls < len(parts):
                    return None
            rows = sorted(compared)
            single = np.array([f(x) for x in t[rows].tolist()], dtype=float).reshape(len(rows), p)
    except Exception:  # whatever a user's function does with an array it was not written for
        return None
    if not rounding:
        return values if np.array_equal(values[rows], single) else None
    if not np.isfinite(values).all():  # where math raises an error, which the user is to see
        return None
    return values if np.all(np.abs(values[rows] - single) <= rounding * np.abs(single).max(axis=0)) else None


def _put(f: Callable, t: np.ndarray, out: np.ndarray) -> None:
    """Put f at times t (T,) into `out` (T, p): few are called one by one."""
    p = out.shape[1]
    if len(t) <= FEW:
        out[:] = np.array([f(x) for x in t.tolist()], dtype=float).reshape(len(t), p)
        return
    _Times.asked = False
    found = f(t.copy().view(_Times))
    parts = [found] if p == 1 and np.shape(found) in ((), t.shape) else found
    if not _Times.asked and not any(map(np.ndim, parts)):
        raise ValueError("single numbers may be those of the first of many times")
    for column, x in zip(out.T, parts, strict=True):
        column[:] = np.broadcast_to(np.asarray(x, dtype=float), t.shape)


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


class InputSignal:
    """u(t) of a function f(t) -> (p,), or a float if p = 1.

    A function that also takes arrays (NumPy functions do) is called once for many times, see values_at_once.
    """

    def __init__(self, f: Callable | None, p: int):
        if p and not callable(f):
            raise InputError(f"input_function={f!r}; needed: a function f(t) -> ({p},), or a float if p = 1")
        self._f, self.p = f, p
        self._takes_arrays = True

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Return u (T, p) at times t (T,)."""
        if not self.p:
            return np.zeros((len(t), 0))
        if self._takes_arrays and len(t) > FEW:
            with self.kept():
                u = values_at_once(self._f, t, self.p)
            self._takes_arrays = u is not None
            if u is not None:
                return check_array("input_function's values", u, (len(t), self.p))
        return self._one_by_one(t)

    def kept(self) -> AbstractContextManager:
        """What calls are made within: nothing here."""
        return nullcontext()

    def at(self, t: float) -> np.ndarray:
        """Return u (p,) at one time."""
        return self._one_by_one([t])[0]

    def _one_by_one(self, t: Any) -> np.ndarray:
        with self.kept():
            values = [self._value(time) for time in np.asarray(t, dtype=float).tolist()]
        return check_array("input_function's values", np.reshape(values, (len(t), -1)), (len(t), self.p))

    def _value(self, t: float) -> Any:
        try:
            return self._f(t)
        except Exception as error:
            raise InputError(f"input_function({t:g}) raised {type(error).__name__}: {error}") from error
