"""What ended a solve before its end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from ...report.report import BoundReport


class EndedBy(NamedTuple):
    """What ended a solve early, in words, and whether that was on purpose; empty: nothing is known to have."""

    why: str
    on_purpose: bool = False


SAME_TIME = 1e-9  # of a time: solvers add up their steps, and users give the next start as they think of it
TO_ITS_END = EndedBy("")
INTERRUPTED = "it was interrupted (Ctrl-C)"


def ended_by(solver: Any, error: BaseException | None = None) -> EndedBy:
    """Return what ended a solve; error : what it has raised."""
    if error is not None:
        return EndedBy(raised(error))
    output = solver.output
    if (meant := on_purpose(solver)).why:
        return meant
    if output.simulationTimeout:
        return EndedBy("its time was over (simulationSettings.timeIntegration.simulateInRealtime, or a timeout)")
    return TO_ITS_END if output.finishedSuccessfully else EndedBy("the solve failed")


def on_purpose(solver: Any) -> EndedBy:
    """Return what the user has ended a solve by, which may still run otherwise; solver : None: not known."""
    if solver is not None and solver.output.simulationStoppedByUserFunction:
        return EndedBy("a user function that returned False stopped it on purpose", True)
    if solver is not None and solver.output.simulationStoppedByUser:
        return EndedBy("it was stopped in the window", True)
    return TO_ITS_END


def note_end(report: BoundReport, ending: EndedBy) -> None:
    """Let a report of a run that ended early, and those of its bodies, say by what."""
    for one in (report, *getattr(report, "bodies", ())) if ending.why else ():
        if one.planned_end is not None or one.time == "static":
            one.ended_by, one.on_purpose = ending


def raised(error: BaseException) -> str:
    """Return the exception of a user function where one is the cause of Exudyn's."""
    chain: list[BaseException] = []
    while error is not None and all(error is not other for other in chain):
        chain.append(error)
        error = error.__cause__ or error.__context__
    if any(isinstance(one, KeyboardInterrupt) for one in chain):
        return INTERRUPTED
    return f"{type(chain[-1]).__name__}: {' '.join(str(chain[-1]).split())}"
