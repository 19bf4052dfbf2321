"""What a sweep returns, and the function that it calls: an exception is a value."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import RunError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np


class Failure(str):
    """What a variation left instead of a value: type and message of its exception."""


class Sweep(NamedTuple):
    """Result of a sweep.

    parameters : name -> (variations,), as ParameterVariation returns them. values : what the function returned, in
    that order, or a Failure.
    """

    parameters: dict[str, np.ndarray]
    values: list

    @property
    def failures(self) -> dict[int, Failure]:
        """Position in values -> what went wrong there."""
        return {i: value for i, value in enumerate(self.values) if isinstance(value, Failure)}

    def complete(self) -> list:
        """Return values if every variation has one; RunError lists the failures."""
        if self.failures:
            lines = [f"{self._point(i)}: {failure}" for i, failure in self.failures.items()]
            raise RunError(f"{len(lines)} of {len(self.values)} variations failed:\n" + "\n".join(lines))
        return self.values

    def _point(self, i: int) -> str:
        return ", ".join(f"{name}={x[i]:g}" for name, x in self.parameters.items())


def failed(error: BaseException) -> Failure:
    """Return what an exception leaves."""
    return Failure(f"{type(error).__name__}: {error}")


class Guarded:
    """The function, with an exception as its value; a class, for other processes to unpickle."""

    def __init__(self, function: Callable[[dict], Any]):
        self.function = function

    def __call__(self, parameters: dict) -> Any:
        try:
            return self.function(parameters)
        except Exception as error:  # whatever it is: the other variations go on
            return failed(error)
