"""The three kinds of failure, kept apart, and the checks that every input goes through."""

from collections.abc import Iterable

import numpy as np


class RomErrError(Exception):
    """Base of everything that exudyn_romerr raises on purpose."""


class InputError(RomErrError, ValueError):
    """What was passed is wrong: shape, name, value, nan."""


class AssumptionError(RomErrError, ValueError):
    """The input is well formed, but an assumption of the theorem asked for does not hold."""


class RunError(RomErrError, RuntimeError):
    """What was asked for needs a run (or an assembled mbs) that is not there or not complete."""


def check_choice(name: str, value: object, known: Iterable[str]) -> None:
    """Raise InputError unless `value` is one of the `known` names."""
    known = list(known)
    if value not in known:
        raise InputError(f"{name}={value!r} is unknown; allowed: {', '.join(map(repr, known))}")


def check_array(name: str, value: object, shape: tuple[int | None, ...]) -> np.ndarray:
    """Return `value` as a finite float array of the given shape (None: any length) or raise InputError."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is not an array of real numbers: {error}") from error
    fits = array.ndim == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if s is None else str(s) for s in shape)
        raise InputError(f"{name} has shape {array.shape}; needed: ({wanted})")
    check_finite(name, array)
    return array


def check_finite(name: str, array: np.ndarray) -> None:
    """Raise InputError naming the first entry that is nan or inf."""
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name} has a nan or inf at {where}; every entry must be finite")
