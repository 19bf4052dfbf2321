"""Bounds while a solve runs: as sensors of the mbs, and as lines in the solver's output."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from exudyn.itemInterface import SensorUserFunction

from ...report.wording import rounded_up, under

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...model.outputs import Output
    from .body_monitor import Watch


def bounds_at(watch: Watch, t: float) -> dict[str, np.ndarray]:
    """Return the smallest bound (r,) of each output at t; empty if t was not bounded."""
    is_open = watch.run is not None and watch.run in watch.runs[-1:]  # it is not where its first sample failed
    best = watch.run.best_of_last(1) if is_open and watch.bounded_until() == t else {}
    return {name: rows[0] for name, rows in best.items()}


def live_line(watches: Sequence[Watch], t: float) -> str:
    """Return in words what the bounds are at t, the largest of the rows of each output."""
    found = [
        f"{out.name} {rounded_up(np.max(bounds[out.name]))} {out.unit}{condition_of(watch)}"
        for watch in watches
        for bounds in [bounds_at(watch, t)]
        for out in watch.subject.outputs
        if out.name in bounds
    ]
    return f"error bounds at t = {t:g}: {', '.join(found) or 'none'}\n"


def condition_of(watch: Watch) -> str:
    """Return what must be said with the bounds of a watch: nothing where their scope is complete, and certified."""
    run = watch.run
    scope = {name: run.offline.scene.scope_of(name) for name in run.assumptions()}
    return under(scope, doubts=run.doubts())


def sensor_of(look: Callable[[], None], watch: Watch, out: Output, options: dict[str, Any]) -> SensorUserFunction:
    """Return a sensor that shows the bound of an output of a watch; look() evaluates the rows stored so far.

    Exudyn writes sensors after PostStep, so that this step's row is among those stored.
    """
    name, rows = out.name, rows_of(out)

    def bound(mbs: Any, t: float, sensorNumbers: Any, factors: Any, configuration: Any) -> list[float]:
        nonlocal rows
        look()
        found = bounds_at(watch, t).get(name)
        if found is None:  # before the first step, which is how Exudyn asks for the size, or bounds have ended
            return [np.inf] * rows
        rows = len(found)
        return found.tolist()

    given = {"name": f"bound of {name}", "storeInternal": True, **options}
    return SensorUserFunction(sensorUserFunction=bound, **given)


def rows_of(out: Output) -> int:
    """Return how many rows an output has, as far as that is known without its body."""
    return len(out.labels) or (1 if callable(out.rows) else len(np.atleast_2d(out.rows)))
