"""InputSignal: the user's input function over time, vectorised and checked."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from ...checks import check_array
from ...errors import InputError
from .array_functions import with_arrays

COMPARED = 256  # of the values that one call gives for many times every so many-th, and the last, are called singly
FEW = 3  # times that are called one by one
LAST_DIGITS = 1e-15  # of the largest value
PARTS, SHARE = 64, 1 / 32  # of times that branch: with more calls than either they are called one by one


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
