"""InputSignal: the user's input function over time, called for many times at once where that is the same."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np

from ...checks import check_array
from ...errors import InputError

COMPARED = 256  # of the values that one call gives for many times every so many-th, and the last, are called singly
FEW = 3  # times that are called one by one


def values_at_once(f: Callable, t: np.ndarray, p: int) -> np.ndarray | None:
    """Return f at times t (T,) from one call, (T, p); None unless it takes arrays as NumPy functions do.

    Some of its values, not all, may be single numbers, the same at all times. Some are compared with single calls.
    """
    rows = sorted({*range(0, len(t), COMPARED), len(t) - 1})
    values = np.empty((len(t), p))
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")  # they would be of our call, not of the user's
            found = f(t.copy())
            parts = [found] if p == 1 and np.shape(found) in ((), t.shape) else found
            if not any(map(np.ndim, parts)):
                raise ValueError("single numbers may be those of the first of many times")
            for column, x in zip(values.T, parts, strict=True):
                column[:] = np.broadcast_to(np.asarray(x, dtype=float), t.shape)
            single = np.array([f(x) for x in t[rows].tolist()], dtype=float).reshape(len(rows), p)
    except Exception:  # whatever a user's function does with an array it was not written for
        return None
    return values if np.array_equal(values[rows], single) else None


class InputSignal:
    """u(t) of a function f(t) -> (p,), or a float if p = 1; one that takes arrays is called once for many times."""

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
