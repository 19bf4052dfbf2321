"""What is changed in Exudyn while a script runs once more: shorter steps, more modes, all sensors at every step."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import wraps
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from types import ModuleType

    from .found_bodies import FoundBodies

SOLVERS = ("MainSolverImplicitSecondOrder", "MainSolverExplicit", "MainSolverStatic")
STATIC = "MainSolverStatic"
ORDERS = {"DOPRI5": 5, "ODE23": 3}  # of methods that choose their steps by tolerances
CALLS = {  # of FEMinterface: the argument that is the number of modes
    "ComputeHurtyCraigBamptonModes": "nEigenModes",
    "ComputeEigenmodes": "nModes",
    "ComputeEigenModesWithBoundaryNodes": "nEigenModes",
}


@dataclass
class Recorded:
    """What all sensors showed in a solve: an array (T, 1 + r) for each, time first.

    kind : "dynamic" or "static". fixed : whether all steps are of one size. h : that of the unchanged run.
    """

    kind: str
    fixed: bool
    h: float = 0.0
    names: list[str] = field(default_factory=list)
    shows: list[str] = field(default_factory=list)
    data: list[np.ndarray] = field(default_factory=list)


class Variation:
    """Stands in front of Exudyn's functions in a process that runs a script once more.

    Parameters
    ----------
    bodies : those that the script adds
    steps : so many times as many
    vectors : order of a body -> vectors (N, m) beside its modes
    factor : so many times as many modes by the script's own calls
    hold : whether PreStep functions are called at the steps of the unchanged run only
    place : path -> path, where Exudyn may write

    Attributes
    ----------
    solves : Recorded, in their order. notes : what could not be done.
    """

    def __init__(
        self,
        bodies: FoundBodies,
        steps: int = 1,
        vectors: Mapping[int, np.ndarray] | None = None,
        factor: int = 1,
        hold: bool = False,
        place: Callable[[str], str] = str,
    ):
        self._bodies, self._steps, self._vectors, self._factor = bodies, steps, dict(vectors or {}), factor
        self._hold, self._place = hold and steps > 1, place
        self.solves: list[Recorded] = []
        self.notes: list[str] = []
        self._coarse: tuple[float, float] | None = None  # start and step of the unchanged run

    def install(self, exudyn: ModuleType) -> None:
        """Exudyn was imported."""
        system = exudyn.MainSystem
        system.AddSensor = self._sensor_added(system.AddSensor)
        system.Assemble = self._assembled(system.Assemble)
        system.SetPreStepUserFunction = self._held(system.SetPreStepUserFunction)
        for name in SOLVERS:
            solver = getattr(exudyn, name)
            solver.SolveSystem = self._solved(solver.SolveSystem, name == STATIC)

    def install_fem(self, fem: ModuleType) -> None:
        """exudyn.FEM was imported: its calls make more modes."""
        for name, argument in CALLS.items():
            if self._factor > 1 and hasattr(fem.FEMinterface, name):
                setattr(fem.FEMinterface, name, self._with_more(getattr(fem.FEMinterface, name), argument))

    def _with_more(self, call: Any, argument: str) -> Any:
        @wraps(call)
        def more(*arguments: Any, **options: Any) -> Any:
            given = inspect.signature(call).bind(*arguments, **options)
            if argument in given.arguments:
                given.arguments[argument] = self._factor * given.arguments[argument]
            return call(*given.args, **given.kwargs)

        return more

    def _sensor_added(self, add_sensor: Any) -> Any:
        @wraps(add_sensor)
        def AddSensor(mbs: Any, sensor: Any) -> Any:
            item = dict(sensor)
            item["storeInternal"] = True
            if item.get("fileName"):
                item["fileName"] = self._place(item["fileName"])
            return add_sensor(mbs, item)

        return AddSensor

    def _assembled(self, assemble: Any) -> Any:
        @wraps(assemble)
        def Assemble(mbs: Any, *arguments: Any, **options: Any) -> Any:
            from .chosen_outputs import add_chosen_sensors  # once a script has configured what it likes
            from .wider_body import widen

            add_chosen_sensors(mbs, self._bodies.of(mbs))
            for body in self._bodies.of(mbs):
                vectors = self._vectors.get(body.order)
                if vectors is not None and mbs.GetObject(body.number)["modeBasis"].shape[1] == body.modes:
                    widen(mbs, body, vectors)
            return assemble(mbs, *arguments, **options)

        return Assemble

    def _held(self, set_function: Any) -> Any:
        @wraps(set_function)
        def SetPreStepUserFunction(mbs: Any, function: Any) -> Any:
            return set_function(mbs, self._at_coarse_steps(function) if self._hold and function else function)

        return SetPreStepUserFunction

    def _at_coarse_steps(self, function: Any) -> Any:
        @wraps(function)
        def held(mbs: Any, t: float) -> Any:
            if self._coarse is None:
                return function(mbs, t)
            start, h = self._coarse
            number = round((t - start) / h * self._steps)  # of the short step that ends at t
            if number % self._steps != 1:
                return True
            return function(mbs, start + h * ((number - 1) // self._steps + 1))

        return held

    def _solved(self, solve_system: Any, is_static: bool) -> Any:
        @wraps(solve_system)
        def SolveSystem(solver: Any, mbs: Any, settings: Any, *arguments: Any, **options: Any) -> Any:
            recorded = Recorded("static" if is_static else "dynamic", True)
            with self._changed(settings, is_static, recorded):
                try:
                    return solve_system(solver, mbs, settings, *arguments, **options)
                finally:
                    self._record(mbs, recorded)

        return SolveSystem

    @contextmanager
    def _changed(self, settings: Any, is_static: bool, recorded: Recorded) -> Iterator[None]:
        """Change settings of a solve until it has ended."""
        with ExitStack() as stack:

            def change(owner: Any, name: str, value: Any) -> None:
                stack.callback(setattr, owner, name, getattr(owner, name))
                setattr(owner, name, value)

            sensors, file, integration = settings.solution.sensors, settings.solution.file, settings.timeIntegration
            change(sensors, "active", True)
            change(sensors, "writePeriod", 0.0)
            change(file, "name", self._place(file.name))
            if not is_static:
                count = integration.numberOfSteps
                recorded.h = (integration.endTime - integration.startTime) / count
                self._coarse = (integration.startTime, recorded.h)
                change(integration, "numberOfSteps", self._steps * count)
                change(integration, "minimumStepSize", integration.minimumStepSize / self._steps)
                method = str(integration.solverType if hasattr(integration, "solverType") else "").split(".")[-1]
                if method in ORDERS and integration.automaticStepSize:
                    recorded.fixed = False
                    for name in ("absoluteTolerance", "relativeTolerance"):
                        change(integration, name, getattr(integration, name) / self._steps ** ORDERS[method])
                    change(integration, "initialStepSize", integration.initialStepSize / self._steps)
            yield

    def _record(self, mbs: Any, recorded: Recorded) -> None:
        """Copy what sensors have stored."""
        for i in range(mbs.systemData.NumberOfSensors()):
            sensor = mbs.GetSensor(i)
            data = np.array(mbs.GetSensorStoredData(i), dtype=float)
            if data.ndim == 2 and data.shape[1] > 1:
                recorded.names.append(sensor["name"])
                shows = sensor.get("outputVariableType")
                recorded.shows.append("" if shows is None else shows.name)
                recorded.data.append(data)
        self.solves.append(recorded)
