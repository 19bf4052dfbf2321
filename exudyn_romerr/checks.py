"""Checks that every input goes through: an InputError names the argument, what was found, what is allowed."""

from collections.abc import Iterable
from numbers import Integral

import numpy as np

from .errors import InputError


def check_choice(name: str, value: object, known: Iterable[str]) -> None:
    """Raise InputError unless `value` is one of the `known` names."""
    known = list(known)
    if not isinstance(value, str) or value not in known:
        allowed = ", ".join(map(repr, known)) or "nothing, there is none"
        raise InputError(f"{name}={value!r} is unknown; allowed: {allowed}")


def check_array(name: str, value: object, shape: tuple[int | None, ...]) -> np.ndarray:
    """Return `value` as a finite float array of the given shape (None: any length) or raise InputError."""
    array = real_array(name, value)
    fits = array.ndim == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if s is None else str(s) for s in shape)
        raise InputError(f"{name} has shape {array.shape}; needed: ({wanted})")
    check_finite(name, array)
    return array


def real_array(name: str, value: object) -> np.ndarray:
    """Return `value` as a float array or raise InputError; complex numbers are refused, not cut."""
    try:
        array = value.toarray() if hasattr(value, "toarray") else np.asarray(value)  # scipy.sparse too
        if array.dtype.kind not in "fiub":
            raise TypeError(f"{array.dtype.name} found")
        return array.astype(float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} is not an array of real numbers: {error}") from error


def check_numbers(name: str, value: object) -> np.ndarray:
    """Return `value` as a float array (n,) of node or coordinate numbers; InputError for a mask of bools."""
    if np.asarray(value).dtype == bool:
        raise InputError(f"{name} holds bools; pass numbers, such as np.flatnonzero(mask)")
    return check_array(name, value, (None,))


def check_nodes(nodes: Iterable[int], count: int) -> np.ndarray:
    """Return node numbers as an int array; InputError names the first outside 0..count-1."""
    numbers = check_numbers("node numbers", nodes)
    wrong = numbers[(numbers < 0) | (numbers >= count) | (numbers != np.round(numbers))]
    if numbers.size == 0 or wrong.size:
        raise InputError(
            f"node {f'{wrong[0]:g}' if wrong.size else 'list is empty'}; allowed: node numbers 0..{count - 1}"
        )
    return numbers.astype(int)


def check_count(name: str, value: object, most: int, of: str, least: int = 1) -> int:
    """Return `value` as an int in least..most or raise InputError; `of` says what is counted."""
    if isinstance(value, bool) or not isinstance(value, Integral) or not least <= value <= most:
        raise InputError(f"{name}={value!r}; allowed: a whole number {least}..{most} ({of})")
    return int(value)


def check_type(name: str, value: object, kind: type) -> None:
    """Raise InputError unless `value` is a `kind`."""
    if not isinstance(value, kind):
        raise InputError(f"{name} is a {type(value).__name__}; needed: {kind.__name__}")


def check_finite(name: str, array: np.ndarray) -> None:
    """Raise InputError naming the first entry that is nan or inf."""
    if not np.isfinite(array).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(f"{name} has a nan or inf at {where}; every entry must be finite")
