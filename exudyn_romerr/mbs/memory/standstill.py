"""While a hook evaluates the steps before it, the run stands still: what is found out once need not be again."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

Found = TypeVar("Found")

_NOTED: ContextVar[dict | None] = ContextVar("found while no step is made", default=None)


@contextmanager
def no_step_is_made() -> Iterator[None]:
    """Keep until the end what is noted within."""
    token = _NOTED.set({})
    try:
        yield
    finally:
        _NOTED.reset(token)


def look_up(key: Hashable) -> Any:
    """Return what was noted under this key since no step is made, or None."""
    return (_NOTED.get() or {}).get(key)


def note(key: Hashable, found: Found) -> Found:
    """Note and return what was found; objects whose numbers are in the key have to be held by it."""
    noted = _NOTED.get()
    if noted is not None:
        noted[key] = found
    return found
