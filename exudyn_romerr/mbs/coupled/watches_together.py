"""Which runs of the bodies of a mechanism fit together, and what ends them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...errors import AssumptionError, RunError
from ...online.kept_estimate import KeptEstimate

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from ...online.run import Opening, Run

ENDED = "estimates are those under frozen inputs, for the linearised mechanism has none: {}"


def check_openings(watches: Sequence[Any], before: Any) -> None:
    """Raise RunError unless the runs of watches open together; before: the Reaction of those that they go on from."""
    openings: list[Opening | None] = [watch.opening for watch in watches]
    if len({opening is None for opening in openings}) > 1:
        raise RunError("bounds of its bodies begin at different times")
    if before is None and any(opening is not None and opening.before is not None for opening in openings):
        raise RunError("the run before, which this one continues, has none")


def check_extensions(watches: Sequence[Any], count: int) -> None:
    """Raise RunError unless all watches have taken so many rows, or have not begun."""
    for watch in watches:
        taken = (watch.opening is not None) + (0 if watch.extension is None else len(watch.extension.new.t))
        if watch.error is not None or (watch.run is not None and taken < count):
            raise RunError(f"bounds of object {watch.item} have ended")


def fall_back(watches: Sequence[Any], error: Exception) -> bool:
    """Let estimates be those under frozen inputs, and say why; return whether it could be said: runs have begun."""
    runs: list[Run] = [watch.run for watch in watches if watch.run is not None]
    for run in runs:
        run.messages.append(ENDED.format(error))
        run.estimate, run.companion = KeptEstimate(), None
    return bool(runs)


def require_vectors(watches: Sequence[Any]) -> None:
    """Raise AssumptionError unless all bodies can have estimates together."""
    without = [watch for watch in watches if watch.error or (watch.is_frozen and watch.enriched is None)]
    if without:
        raise AssumptionError(f"it needs all bodies, and has no vectors of object {without[0].item}")


def open_together(watches: Sequence[Any]) -> None:
    """Postpone openings until all bodies have one: solvers without accelerations may hold back some."""
    opening = [watch for watch in watches if watch.opening is not None]
    if len(opening) < len(watches) and not any(watch.error for watch in watches):
        for watch in opening:
            watch.postpone()


def end_with(failed: Sequence[Any], watches: Sequence[Any]) -> None:
    """End coupled bounds where watches have failed: they need all bodies."""
    for watch in watches if failed else ():
        if watch.error is None:
            reason = f"{type(failed[0].error).__name__}: {failed[0].error}"
            watch.error = RunError(
                f"coupled bounds need all bodies of the mechanism, and object {failed[0].item} has none: {reason}"
            )


def why_not_coupled(watches: Iterable[Any]) -> str:
    """Return why no linearised mechanism answers the errors of bodies; empty: none of them asks for one."""
    reasons = (str(x.error) if x.error is not None else x.subject.why_not_coupled for x in watches)
    return next(filter(None, reasons), "")
