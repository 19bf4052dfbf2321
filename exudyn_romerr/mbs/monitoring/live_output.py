"""Bounds while a solve runs: as sensors of the mbs, and as lines in the solver's output."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorUserFunction

from ...report.scope import cures_of
from ...report.wording import for_run_alone, not_certified, rounded_up, under, with_unit

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...model.outputs import Output
    from .body_monitor import MonitoredBody


def bounds_at(watch: MonitoredBody, t: float) -> dict[str, np.ndarray]:
    """Return the smallest bound (r,) of each output at t; empty if t was not bounded."""
    best = watch.run.best_of_last(1) if watch.run is not None and watch.succession.last[0] == t else {}
    return {name: rows[0] for name, rows in best.items()}


def live_line(watches: Sequence[MonitoredBody], t: float) -> str:
    """Return in words what the bounds are at t, the largest of the rows of each output."""
    found = [
        f"{out.name} {with_unit(rounded_up(np.max(bounds[out.name])), out.unit)}"
        f"{under(_scope_of(watch), doubts=watch.run.doubts())}"
        for watch in watches
        for bounds in [bounds_at(watch, t)]
        for out in watch.subject.outputs
        if out.name in bounds
    ]
    return f"error bounds at t = {t:g}: {', '.join(found) or 'none'}\n"


def _scope_of(watch: MonitoredBody) -> dict[str, str]:
    return dict.fromkeys(watch.run.assumptions(), watch.run.offline.scene.scope)


def _what_numbers_cannot_say(watch: MonitoredBody) -> str:
    """Return in words why the bounds of a run so far are not certified, what they leave out; empty: nothing."""
    doubts, alone = watch.run.doubts(), for_run_alone(_scope_of(watch))
    said = [alone and f"it holds {alone}", doubts and f"{not_certified(doubts)}: {cures_of(doubts)}"]
    return "; ".join(filter(None, said))


def sensor_of(
    evaluate: Callable[[], None], watch: MonitoredBody, out: Output, options: dict[str, Any]
) -> SensorUserFunction:
    """Return a sensor that shows the bound of an output of a watch; evaluate() evaluates the rows stored so far.

    Exudyn writes sensors after PostStep, so that this step's row is among those stored. What holds for its numbers,
    which they cannot say, is printed once a run, and when more is known.
    """
    name, rows, heard = out.name, rows_of(out), (0, 0)

    def bound(mbs: Any, t: float, sensorNumbers: Any, factors: Any, configuration: Any) -> list[float]:
        nonlocal rows, heard
        evaluate()
        found = bounds_at(watch, t).get(name)
        if found is None:  # before the first step, which is how Exudyn asks for the size, or bounds have ended
            return [np.inf] * rows
        rows, now = len(found), (len(watch.runs), len(watch.run.doubts()))
        if now != heard and (said := _what_numbers_cannot_say(watch)):
            exu.Print(f"exudyn_romerr at t = {t:g}: {given['name']!r}: {said}")
        heard = now
        return found.tolist()

    given = {"name": f"bound of {name}", "storeInternal": True, **options}
    return SensorUserFunction(sensorUserFunction=bound, **given)


def rows_of(out: Output) -> int:
    """Return how many rows an output has, as far as that is known without its body."""
    return len(out.labels) or (1 if callable(out.rows) else len(np.atleast_2d(out.rows)))
