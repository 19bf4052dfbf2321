"""InputSignal: the user's input function over time, vectorised and checked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..checks import check_array
from ..errors import InputError


class InputSignal:
    """u(t) of a function f(t) -> (p,), or a float if p = 1.

    A function of one input that also takes arrays (NumPy functions do) is called once for many times; it is used so
    only where three of the values agree with single calls.
    """

    def __init__(self, f: Callable | None, p: int):
        if p and not callable(f):
            raise InputError(f"input_function={f!r}; needed: a function f(t) -> ({p},), or a float if p = 1")
        self._f, self.p = f, p
        self._takes_arrays = p == 1

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Return u (T, p) at times t (T,)."""
        if not self.p:
            return np.zeros((len(t), 0))
        u = self._at_once(t) if self._takes_arrays and len(t) > 3 else None
        return self._one_by_one(t) if u is None else u

    def at(self, t: float) -> np.ndarray:
        """Return u (p,) at one time."""
        return self._one_by_one([t])[0]

    def _one_by_one(self, t: Any) -> np.ndarray:
        values = [self._value(float(time)) for time in t]
        return check_array("input_function's values", np.reshape(values, (len(t), -1)), (len(t), self.p))

    def _value(self, t: float) -> Any:
        try:
            return self._f(t)
        except Exception as error:
            raise InputError(f"input_function({t:g}) raised {type(error).__name__}: {error}") from error

    def _at_once(self, t: np.ndarray) -> np.ndarray | None:
        try:
            values = np.asarray(self._f(t), dtype=float)
        except Exception:  # whatever a user's function does with an array it was not written for
            values = None
        probe = [0, len(t) // 2, len(t) - 1]
        if values is None or values.shape != t.shape or np.any(values[probe] != self._one_by_one(t[probe])[:, 0]):
            self._takes_arrays = False
            return None
        return check_array("input_function's values", values[:, None], (len(t), 1))


class SampledSignal(InputSignal):
    """u(t) of a function that takes many times (T,) and returns (T, p)."""

    def __init__(self, f: Callable, p: int):
        self._f, self.p = f, p

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Return u (T, p) at times t (T,)."""
        return check_array("loads over time", self._f(np.asarray(t)), (len(t), self.p))

    def at(self, t: float) -> np.ndarray:
        """Return u (p,) at one time."""
        return self(np.array([t]))[0]
