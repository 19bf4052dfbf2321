"""Items of an mbs, read when a solve begins: the running solver, what acts on a reduced body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import AssumptionError
from ...mechanism.scheme import Scheme

if TYPE_CHECKING:
    from collections.abc import Callable

FFRF, QUATERNIONS = "FFRFreducedOrder", "RigidBodyEP"  # types of floating bodies, of nodes with Euler parameters
BODIES = (FFRF, "Ground", "PointGround")


def _just_begun(mbs: Any, static: bool = False) -> Any:
    """Return the solver in mbs.sys that has taken no step, or None; they stay there after their end."""
    solver = mbs.sys.get("staticSolver" if static else "dynamicSolver")
    return None if solver is None or solver.it.currentStepIndex > 0 else solver


def running_static_solver(mbs: Any, known: Any) -> Any:
    """Return the static solver whose first call of the hook this is, or None; `known`: the last one returned.

    A static solver kept out of mbs.sys by storeSolver=False cannot be told from a dynamic one.
    """
    solver = _just_begun(mbs, static=True)
    return None if solver is known else solver


def end_time(mbs: Any, static: bool) -> float | None:
    """Return the time the dynamic solver that has just begun is to go to; None if it is not kept in mbs.sys."""
    solver = None if static else _just_begun(mbs)
    return None if solver is None else float(solver.it.endTime)


def is_verbose(mbs: Any, static: bool) -> bool:
    """Whether the solver that has just begun was asked to tell of every step (verboseMode = 2)."""
    solver = _just_begun(mbs, static)
    return solver is not None and solver.output.verboseMode > 1


def newton_tolerance(mbs: Any, static: bool) -> float:
    """Return the relative tolerance of the running solver's Newton iterations; 0 if it has none."""
    solver = mbs.sys.get("staticSolver" if static else "dynamicSolver")
    newton = getattr(solver, "newton", None)  # explicit solvers have none
    return 0.0 if newton is None else float(newton.relativeTolerance)


def solver_name(mbs: Any) -> str:
    """Return what the dynamic solver calls itself; empty: it is not kept in mbs.sys."""
    solver = mbs.sys.get("dynamicSolver")
    return "" if solver is None else str(solver.GetSolverName())


def scheme_of(mbs: Any) -> Scheme | None:
    """Return the scheme of the dynamic solver that has just begun; None if it is not kept."""
    solver = mbs.sys.get("dynamicSolver")
    return None if solver is None or solver.it.currentStepIndex > 0 else scheme_from(solver)


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


def require_inputs_only(mbs: Any, node: int, item: int) -> None:
    """Raise AssumptionError if a load, joint, connector or other object acts on the reduced body.

    The bound knows the load B f(t) and nothing else.
    """
    markers = _markers_on(mbs, node, item)
    system = mbs.systemData
    culprits = [
        f"load {i}" for i in range(system.NumberOfLoads()) if int(mbs.GetLoad(i)["markerNumber"]) in markers
    ] + [
        f"object {i}"
        for i in range(system.NumberOfObjects())
        if i != item and _touches(mbs.GetObject(i), markers, node)
    ]
    if culprits:
        raise AssumptionError(
            f"on the reduced body (object {item}) act beside its input_function: {', '.join(culprits)}; "
            "a bound covers prescribed loads only, so pass them as columns of inputs= to add_reduced_body"
        )


def sensor_name(mbs: Any, number: int) -> str:
    """Return the name of a sensor; where several have it, with its number."""
    name = mbs.GetSensor(number)["name"]
    others = (i for i in range(mbs.systemData.NumberOfSensors()) if i != number)
    return f"{name} (sensor {number})" if any(mbs.GetSensor(i)["name"] == name for i in others) else name


def _markers_on(mbs: Any, node: int, item: int) -> set[int]:
    found = set()
    for i in range(mbs.systemData.NumberOfMarkers()):
        marker = mbs.GetMarker(i)
        bodies = numbers(marker, "bodyNumber") | numbers(marker, "objectNumber")
        if item in bodies or node in numbers(marker, "nodeNumber") | numbers(marker, "nodeNumbers"):
            found.add(i)
    return found


def _touches(item: dict, markers: set[int], node: int) -> bool:
    nodes = numbers(item, "nodeNumber") | numbers(item, "nodeNumbers")
    return node in nodes or not markers.isdisjoint(numbers(item, "markerNumbers"))


def numbers(item: dict, key: str) -> set[int]:
    """Return the item numbers under a key, which may hold one or a list."""
    value = item.get(key, [])
    return {int(number) for number in (value if isinstance(value, list | tuple) else [value])}


def dense(matrix: Any, n: int) -> np.ndarray:
    """Return a matrix (n, n) of Exudyn, where an empty one is zero."""
    found = np.asarray(matrix.Convert2DenseMatrix(), dtype=float)
    return found if found.size else np.zeros((n, n))


def node_coordinates(mbs: Any, node: int) -> range:
    """Return the numbers of a node's coordinates in the mbs."""
    first = mbs.GetNodeODE2Index(node)
    return range(first, first + len(mbs.GetNode(node)["referenceCoordinates"]))
