"""What is changed in Exudyn while a script runs once more: shorter steps, more modes, all sensors at every step."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Callable
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial, wraps
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mode_selection.modal_content import FurtherModes
from ...report.verdicts import until, until_load
from ..access.mbs_items import Items
from ..access.solvers import SAME_TIME, ended_by
from .found_bodies import DYNAMIC, STATIC, StandIn, settings_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from types import ModuleType

    from .found_bodies import FoundBodies

PARTS = ("InitializeSolverInitialConditions", "SolveSteps")  # of a solve made step by step
ORDERS = {"DOPRI5": 5, "ODE23": 3}  # of methods that choose their steps by tolerances
ENDINGS = (".txt", ".sol")  # of solution files, text or binary, whose name has none
RIGID = "RBE2"
CALLS = {  # of FEMinterface: the argument that is the number of modes
    "ComputeHurtyCraigBamptonModes": "nEigenModes",
    "ComputeEigenmodes": "nModes",
    "ComputeEigenModesWithBoundaryNodes": "nEigenModes",
    "ComputeHurtyCraigBamptonModesNGsolve": "nEigenModes",
    "ComputeEigenmodesNGsolve": "nModes",
}


@dataclass
class Recorded:
    """What all sensors showed in a solve: an array (T, 1 + r) for each, time first.

    kind : "dynamic" or "static". fixed : whether all steps are of one size. h, count : of them in the unchanged run.
    numbers : of the sensors. until : of a solve that ended before its end, when and by what; on_purpose : whether
    that was meant. seconds : CPU time. has_bodies : whether it moves reduced bodies; `romerr run` counts no others.
    """

    kind: str
    fixed: bool
    h: float = 0.0
    count: int = 0
    seconds: float = 0.0
    until: str = ""
    on_purpose: bool = False
    has_bodies: bool = False
    numbers: list[int] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    shows: list[str] = field(default_factory=list)
    data: list[np.ndarray] = field(default_factory=list)


class Variation(StandIn):
    """Stands in front of Exudyn's functions in a process that runs a script once more.

    Parameters
    ----------
    bodies : those that the script adds
    steps : so many times as many, a whole number but for `tune`
    vectors : order of a body -> vectors (N, m) beside its modes
    factor : so many times as many modes by the script's own calls
    numbers : of modes by the script's own calls, in their order. further : so many modes beyond these are computed,
        for bodies to tell what they would do
    hold : whether PreStep functions are called at the steps of the unchanged run only
    place : (path, keep) -> path, where Exudyn may write; keep : whether what is there is needed
    before : is called with the mbs of a solve that is about to begin

    Attributes
    ----------
    solves : Recorded, in their order. calls : that make modes, where they stand, and their
    numbers of them. has_controllers : whether there are PreStep functions.
    """

    def __init__(
        self,
        bodies: FoundBodies,
        steps: float = 1,
        vectors: Mapping[int, np.ndarray] | None = None,
        factor: int = 1,
        hold: bool = False,
        place: Callable[..., str] = lambda path, keep=False: path,
        before: Callable[[Any], None] = lambda mbs: None,
        numbers: Sequence[int] = (),
        further: int = 0,
    ):
        super().__init__()
        self._bodies, self._steps, self._vectors, self._factor = bodies, steps, dict(vectors or {}), factor
        self._hold, self._place, self._before = hold and steps > 1, place, before
        self.solves: list[Recorded] = []
        self.has_controllers = False
        self._numbers, self._further = numbers, further
        self.calls: list[dict[str, Any]] = []
        self._makes_modes = False
        self._kinds: list[str] = []  # of the calls that made modes
        self._open: dict[int, ExitStack] = {}  # solves made step by step, by the solver's identity
        self._coarse: tuple[float, float] | None = None  # start and step of the unchanged run

    def install(self, exudyn: ModuleType) -> None:
        """Exudyn was imported."""
        self._exudyn, system = exudyn, exudyn.MainSystem
        self.replace(system, "AddSensor", self._add_sensor)
        self.replace(system, "Assemble", self._assemble)
        self.replace(system, "SetPreStepUserFunction", self._set_pre_step)
        self.replace(exudyn, "SetWriteToFile", self._set_write_to_file)
        for owner in (exudyn.Renderer, exudyn.SystemContainer):  # without a window it raises, or waits for one
            self.replace(owner, "RedrawAndSaveImage", _no_image)
        for name in (*DYNAMIC, STATIC):
            solver = getattr(exudyn, name)
            self.replace(solver, "SolveSystem", partial(self._solve, name == STATIC))
            self.replace(solver, "InitializeSolver", partial(self._initialize, name == STATIC))
            self.replace(solver, "FinalizeSolver", self._finalize)
            for part in PARTS:
                self.replace(solver, part, self._step)

    @property
    def may_be_rigid(self) -> bool:
        """Whether modes may make interfaces rigid: those of RBE2, and of no call that is known."""
        return not self._kinds or any(RIGID in kind for kind in self._kinds)

    def install_fem(self, fem: ModuleType) -> None:
        """exudyn.FEM was imported: its calls make more modes."""
        for name, argument in CALLS.items():
            if hasattr(fem.FEMinterface, name):
                self.replace(fem.FEMinterface, name, partial(self._compute_modes, argument))

    def _compute_modes(self, argument: str, call: Any, *arguments: Any, **options: Any) -> Any:
        given = inspect.signature(call).bind(*arguments, **options)
        self._kinds.append(str(given.arguments.get("computationMode", "")))
        if self._factor > 1 and argument in given.arguments:
            given.arguments[argument] = self._factor * given.arguments[argument]
        if argument in given.arguments and not self._makes_modes:
            return self._noted_call(call, given, argument)
        return call(*given.args, **given.kwargs)

    def _noted_call(self, call: Any, given: inspect.BoundArguments, argument: str) -> Any:
        """Make modes, as many as `numbers` says, and first more of them for bodies that tell what these would do."""
        line = sys._getframe(3)
        noted = {"call": call.__name__, "argument": argument, "number": int(given.arguments[argument])}
        noted |= {"file": os.path.basename(line.f_code.co_filename), "line": line.f_lineno}
        if noted not in self.calls:  # one line of the script may make modes of several bodies
            self.calls.append(noted)
        which = self.calls.index(noted)
        if which < len(self._numbers):
            given.arguments[argument] = self._numbers[which]
        self._makes_modes = True  # by calls of its own, which are not the script's
        number, fem, more = given.arguments[argument], given.arguments["self"], None
        if self._further:
            with suppress(Exception):  # there may be no more of them
                given.arguments[argument] = number + self._further
                call(*given.args, **given.kwargs)
                more = np.array(fem.modeBasis["matrix"])
        given.arguments[argument] = number
        try:
            found = call(*given.args, **given.kwargs)
        finally:
            self._makes_modes = False
        own = fem.modeBasis["matrix"].shape[1]
        if more is not None and more.shape[1] == own + self._further:
            self._bodies.further[fem] = FurtherModes(which, number, more[:, own:])
        return found

    def _add_sensor(self, call: Any, mbs: Any, pyObject: Any) -> Any:
        item = {**dict(pyObject), "storeInternal": True}
        if item.get("fileName"):
            item["fileName"] = self._place(item["fileName"])
        return call(mbs, item)

    def _assemble(self, call: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
        from ..floating.sensor_outputs import add_chosen_sensors  # once a script has configured what it likes
        from .wider_body import widen

        add_chosen_sensors(mbs, [body.number for body in self._bodies.of(mbs)])
        for body in self._bodies.of(mbs):
            vectors = self._vectors.get(body.order)
            if vectors is not None and mbs.GetObject(body.number)["modeBasis"].shape[1] == body.modes:
                widen(mbs, body, vectors)
        return call(mbs, *arguments, **options)

    def _set_pre_step(self, call: Any, mbs: Any, function: Any) -> Any:
        self.has_controllers |= bool(function)
        return call(mbs, self._at_coarse_steps(function) if self._hold and function else function)

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

    def _solve(self, is_static: bool, call: Any, solver: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
        given = settings_of(arguments, options)
        with self._around(solver, mbs, given, is_static), self._more_steps(given, is_static):
            return call(solver, mbs, *arguments, **options)

    def _initialize(self, is_static: bool, call: Any, solver: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
        around, settings = ExitStack(), settings_of(arguments, options)
        around.enter_context(self._around(solver, mbs, settings, is_static))
        self._open[id(solver)] = around
        with self._more_steps(settings, is_static):
            return call(solver, mbs, *arguments, **options)

    def _step(self, call: Any, solver: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
        """A part of a solve made step by step, before which a script may set steps anew."""
        with self._more_steps(settings_of(arguments, options), id(solver) not in self._open):
            return call(solver, mbs, *arguments, **options)

    @contextmanager
    def _more_steps(self, settings: Any, is_unchanged: bool) -> Iterator[None]:
        integration = settings.timeIntegration
        count = integration.numberOfSteps
        integration.numberOfSteps = count if is_unchanged else max(round(self._steps * count), 1)
        try:
            yield
        finally:
            integration.numberOfSteps = count

    def _finalize(self, call: Any, solver: Any, *arguments: Any, **options: Any) -> Any:
        try:
            return call(solver, *arguments, **options)
        finally:
            self._open.pop(id(solver), ExitStack()).close()

    @contextmanager
    def _around(self, solver: Any, mbs: Any, settings: Any, is_static: bool) -> Iterator[None]:
        """What is done before and after a solve."""
        self._before(mbs)
        recorded = Recorded("static" if is_static else "dynamic", True)
        with self._changed(mbs, settings, is_static, recorded):
            begin, error = process_time(), None
            try:
                yield
            except BaseException as raised:
                error = raised
                raise
            finally:
                recorded.seconds = process_time() - begin
                _note_end(recorded, solver, mbs.systemData.GetTime(), settings.timeIntegration.endTime, error)
                self._record(mbs, recorded)

    def _set_write_to_file(self, call: Any, filename: str, *arguments: Any, **options: Any) -> Any:
        self._place_directory()
        return call(self._placed_name(filename), *arguments, **options)

    def _place_directory(self) -> None:
        """Exudyn puts its output directory in front of names, which are relative ones then."""
        directory = self._exudyn.config.outputDirectory
        if directory:
            self._exudyn.config.outputDirectory = os.path.dirname(self._place(os.path.join(directory, "x")))

    def _placed_name(self, name: str, keep: bool = False) -> str:
        """Return a name that Exudyn may write to, also with the endings that it adds."""
        for ending in ENDINGS if name else ():
            self._one_placed(f"{name}{ending}", keep)
        return self._one_placed(name, keep)

    def _one_placed(self, name: str, keep: bool) -> str:
        directory = self._exudyn.config.outputDirectory
        if name and directory and not os.path.isabs(name):
            self._place(os.path.join(directory, name), keep)
            return name
        return self._place(name, keep)

    @contextmanager
    def _changed(self, mbs: Any, settings: Any, is_static: bool, recorded: Recorded) -> Iterator[None]:
        """Change settings of a solve until it has ended."""
        with ExitStack() as stack:

            def change(owner: Any, name: str, value: Any) -> None:
                stack.callback(setattr, owner, name, getattr(owner, name))
                setattr(owner, name, value)

            solution, integration = settings.solution, settings.timeIntegration
            change(solution.sensors, "active", True)
            change(solution.sensors, "writePeriod", 0.0)
            change(solution, "recordImagesInterval", -1)  # there is no window to record
            self._place_directory()
            change(solution.file, "name", self._placed_name(solution.file.name, solution.file.append))
            change(solution.restart, "name", self._placed_name(solution.restart.name, keep=True))
            change(solution, "solverInformationFileName", self._placed_name(solution.solverInformationFileName))
            for sensor in Items(mbs).sensors:
                self._placed_name(sensor.get("fileName", ""))
            if not is_static:
                count = integration.numberOfSteps
                recorded.count = count
                recorded.h = (integration.endTime - integration.startTime) / count
                change(integration, "minimumStepSize", integration.minimumStepSize / self._steps)
                method = integration.solverType.name
                if method in ORDERS and integration.automaticStepSize:
                    recorded.fixed = False
                    for name in ("absoluteTolerance", "relativeTolerance"):
                        change(integration, name, getattr(integration, name) / self._steps ** ORDERS[method])
                    change(integration, "initialStepSize", integration.initialStepSize / self._steps)
                self._coarse = (integration.startTime, recorded.h) if recorded.fixed else None  # none to hold at
            yield

    def _record(self, mbs: Any, recorded: Recorded) -> None:
        """Copy what sensors have stored."""
        for i, sensor in enumerate(Items(mbs).sensors):
            data = np.array(mbs.GetSensorStoredData(i), dtype=float)
            if data.ndim == 2 and data.shape[1] > 1:
                recorded.numbers.append(i)
                recorded.names.append(sensor["name"])
                shows = sensor.get("outputVariableType")
                recorded.shows.append("" if shows is None else shows.name)
                recorded.data.append(data)
        recorded.has_bodies = bool(self._bodies.of(mbs))
        self.solves.append(recorded)


def _note_end(recorded: Recorded, solver: Any, t: float, end: float, error: BaseException | None) -> None:
    """Note what ended a solve before its end; end : of a dynamic one."""
    is_static = recorded.kind == "static"
    if is_static or t < end * (1 - SAME_TIME):
        why, recorded.on_purpose = ended_by(solver, error)
        recorded.until = until(t, end, why) if not is_static else why and until_load(t, why)


def _no_image(*arguments: Any, **options: Any) -> None:
    """Save no image of a window that is not there."""
