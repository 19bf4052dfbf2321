"""Save and restore the state of an mbs, so that what is tried on it leaves the simulation as it is, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import numpy as np

IN_PLACE = exu.ConfigurationType.Current, False  # not copied: memory of the mbs, to be read or written at once


def current_state(system: Any) -> tuple[np.ndarray, ...]:
    """Return q, q_t, q_tt and multipliers."""
    rates = system.GetODE2Coordinates_t(), system.GetODE2Coordinates_tt()
    return system.GetODE2Coordinates(), *rates, system.GetAECoordinates()


def set_state(system: Any, t: float, state: Sequence[np.ndarray]) -> None:
    """Set time, q, q_t, q_tt and multipliers.

    In place: Exudyn's functions that set them make a list of numbers first, which takes five times as long.
    """
    system.SetTime(t)
    for place, x in zip(state_in_place(system), state, strict=True):
        place[:] = x


def state_in_place(system: Any) -> tuple[np.ndarray, ...]:
    """Return q, q_t, q_tt and multipliers where they are in the memory of the mbs."""
    rates = system.GetODE2Coordinates_t(*IN_PLACE), system.GetODE2Coordinates_tt(*IN_PLACE)
    return system.GetODE2Coordinates(*IN_PLACE), *rates, system.GetAECoordinates(*IN_PLACE)


@contextmanager
def state_kept(system: Any) -> Iterator[tuple[np.ndarray, ...]]:
    """Give the current state, and set it back: time, q, q_t, q_tt and multipliers."""
    t, state = system.GetTime(), current_state(system)
    try:
        yield state
    finally:
        set_state(system, t, state)


@contextmanager
def state_set(system: Any, t: float, state: Sequence[np.ndarray]) -> Iterator[None]:
    """Set the current state for a while."""
    with state_kept(system):
        set_state(system, t, state)
        yield
