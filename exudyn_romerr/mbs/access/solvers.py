"""The solver of a run as mbs.sys has it: what it is to do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from ...linear.run.balance import SolverFacts
from ...mechanism.scheme import Scheme

if TYPE_CHECKING:
    from collections.abc import Callable

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
    for one in (report, *report.bodies) if ending.why else ():
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


def just_begun(mbs: Any, static: bool = False) -> Any:
    """Return the solver in mbs.sys that has taken no step, or None; they stay there after their end."""
    solver = mbs.sys.get("staticSolver" if static else "dynamicSolver")
    return None if solver is None or solver.it.currentStepIndex > 0 else solver


def threads(mbs: Any) -> int:
    """Return how many a run has: after a solver with fewer, Exudyn's one task manager would go on with these."""
    settings = mbs.sys.get("simulationSettings")
    return 1 if settings is None else settings.parallel.numberOfThreads


def solver_facts(mbs: Any, static: bool, floor: float) -> SolverFacts:
    """Return what the solver in mbs.sys tells: where it is to go, if it is dynamic and has just begun; see there."""
    solver = mbs.sys.get("staticSolver" if static else "dynamicSolver")
    newton = getattr(solver, "newton", None)  # explicit solvers have none
    begun = None if static else just_begun(mbs)
    return SolverFacts(
        end_time=None if begun is None else float(begun.it.endTime),
        newton_tolerance=0.0 if newton is None else float(newton.relativeTolerance),
        floor=floor,
        name="" if static or solver is None else str(solver.GetSolverName()),
    )


def scheme_from(solver: Any) -> Scheme:
    """Return the parameters of a solver.

    Explicit and static ones resolve all modes, or fail: as the trapezoidal rule they add nothing of their own.
    """
    if not hasattr(solver, "newmarkBeta"):
        return Scheme.of_radius(1.0)
    return Scheme(solver.alphaM, solver.alphaF, solver.newmarkBeta, solver.newmarkGamma)


def holds_rates(settings: Any) -> bool:
    """Whether a solver with these settings holds rates of constraints (index 2)."""
    return settings is not None and settings.timeIntegration.generalizedAlpha.useIndex2Constraints


def load_factor(mbs: Any) -> Callable[[float], float]:
    """Return what the running static solver scales constant loads with at t, its default: linear in time."""
    times = mbs.sys["staticSolver"].it
    start, span = float(times.startTime), float(times.endTime - times.startTime)
    return lambda t: (t - start) / span
