"""Run a script of the user's, watch its reduced bodies, and answer when it has ended: romerr run, romerr.run."""

from __future__ import annotations

import os
import shlex
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property, partial, wraps
from typing import TYPE_CHECKING, Any

from ..report.answers import Answer, tolerances_of
from .after_import import after_import
from .execute import Ending, check_script, execute
from .files import Judged, tried

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from types import ModuleType

    from ..mode_selection.mode_table import ModeTable
    from ..report.answers import Tolerances
    from ..report.judgement import Judgement, Solve
    from ..report.report import BoundReport
    from .verify import Verification

INTERFACES = ("free", "rigid")
NO_EXUDYN = "the script does not import exudyn, so there is nothing to tell"
NO_SOLVE = "{} reduced flexible {}, but no solve moves {}: nothing to tell"
NO_BODY = "no reduced flexible body (ObjectFFRFreducedOrder) in {} {}: nothing is reduced, so no mode is missing"
NOTHING = "no reduced flexible body and no solve: nothing to tell"
NOT_WATCHED = "{} in other processes ({} started) not watched: the answer below is of this process alone"
MEASURE = "To measure what is not known: romerr verify {}"
TUNE = "To find how many modes are enough: romerr tune {}"
NOT_READ = "the script was not run: it is no Python that can be read ({})"
CHOSEN = "the scene has no sensors; outputs chosen for it: interfaces, and the node of each body farthest from them"


@dataclass
class Run(Judged):
    """What came of a run of a script.

    Attributes
    ----------
    script : as given
    ending : how the script ended: .status, .error
    solves : what was found of each solve that moved reduced bodies
    notes : lines about what was not watched, and why
    tolerances : as asked for
    arguments : of the script
    units : of length, as the user gave it
    steps : what measure_step has measured; None: nothing
    home : working folder when it began
    """

    script: str
    ending: Ending
    solves: list[Solve]
    notes: list[str]
    tolerances: Tolerances
    arguments: Sequence[str] = ()
    units: str = ""
    steps: Verification | None = None
    home: str = ""

    @property
    def reports(self) -> list[BoundReport]:
        """The reports of all solves that have one, in their order; each as monitor.report() of attach."""
        return [solve.report for solve in self.solves if solve.report is not None]

    @cached_property
    def judgement(self) -> Judgement:
        """Verdicts on every sensor, component and cause."""
        from ..report.judgement import Judgement, rows_of_solve

        rows = [row for solve in self.solves for row in rows_of_solve(solve, self.tolerances)]
        notes = [*self.notes]
        if self.steps is not None:
            from .measured_step import with_measured_steps

            rows, others = with_measured_steps(rows, self.steps)
            notes += [*self.steps.notes, *self.steps.missing, *others]
        return Judgement(rows, self.solves, notes)

    def measure_step(self, progress: Callable[[str], None] | None = None) -> None:
        """Run the script with half the step and a quarter of it, where its estimate leaves the step's error open.

        What was stopped by Ctrl-C is not run again.

        Parameters
        ----------
        progress : function(text), optional
            Is told what is done.

        Raises
        ------
        RunError
            The script does nothing in a process of its own that could be compared.
        """
        from .measured_step import is_open

        if any(map(is_open, self.judgement.rows)) and not isinstance(self.ending.error, KeyboardInterrupt):
            from .verify import measure_steps

            path = os.path.join(self.home, self.script)
            self.steps = measure_steps(path, self.home, self.arguments, self.tolerances, self.units, progress)
            del self.judgement

    @property
    def status(self) -> int:
        """Exit status: the script's own; if it ended well and a tolerance was asked for, that of the answer.

        A name in a tolerance that no sensor has is wrong usage.
        """
        return self.ending.status or super().status

    def _of_solves(self) -> dict[str, Any]:
        solves = [
            {
                "number": solve.number,
                "kind": solve.kind,
                "bodies": solve.bodies,
                "refused": [{"body": which, "reason": why} for which, why in solve.refused],
                "failure": None if solve.failure is None else str(solve.failure),
                "cpu_s": solve.seconds,
            }
            for solve in self.solves
        ]
        seconds = sum(solve.seconds + solve.our_seconds for solve in self.solves)
        return {"bodies": sum(solve.bodies for solve in self.solves), "solves": solves, "cpu_s": seconds}

    def __str__(self) -> str:
        from ..report.judgement import text

        again = [self.script, *map(str, self.arguments)]
        lines = [*self.misspelt, text(self.judgement, shlex.join(again), MEASURE)]
        of_modes = [row.of["modes"].answer for row in self.judgement.rows if "modes" in row.of]
        if Answer.TOO_LARGE in of_modes:
            asked = (word for text in self.tolerances.texts for word in ("--tolerance", text))
            lines.append(TUNE.format(shlex.join([*asked, *again])))
        return "\n".join(lines)


def run(
    script: str | os.PathLike,
    arguments: Sequence[str] = (),
    *,
    tolerance: Sequence[str] | str | float | None = None,
    units: str = "",
    interfaces: str = "free",
) -> Run:
    """Run a script in this process as `python script.py` does, and tell how wrong its reduced bodies make it.

    Every body made by AddObjectFFRFreducedOrder, CreateFFRFReducedOrderObject or ObjectFFRFreducedOrder is watched in
    every solve. Nothing of the script's run changes; what it raises is in .ending, not raised.

    Parameters
    ----------
    script : path
    arguments : sequence of str
        Its sys.argv[1:].
    tolerance : number, text or several texts, optional
        0.001 in the model's units, "1%" of each largest value, "tip=0.001" of one sensor.
    units : str
        The model's unit of length, such as "mm", to be printed; "": not known. Numbers stay what they are.
    interfaces : {"free", "rigid"}
        Whether interfaces that RBE2 modes make rigid deform in reality, or are as rigid as that.

    Returns
    -------
    Run
        print() it; .rows, .reports, .ending.

    Raises
    ------
    InputError
        No such script; a tolerance that is none; unknown interfaces.

    Notes
    -----
    Does not cover: solves in other processes; bodies whose FEMinterface is gone when they are added.
    """
    if interfaces not in INTERFACES:
        from ..checks import check_choice  # imports numpy, and the script comes first

        check_choice("interfaces", interfaces, INTERFACES)
    tolerances, path, home = tolerances_of(tolerance), check_script(script), os.getcwd()
    with _Watching(interfaces) as watching:
        ending = execute(path, arguments)
        options = ["--units", units] * bool(units) + ["--interfaces", interfaces] * (interfaces != INTERFACES[0])
        for solve in watching.solves:
            _note_options(solve, units, shlex.join(options))
        error = f"{type(ending.error).__name__}: {ending.error}"
        notes = [*watching.notes()] if ending.began else [NOT_READ.format(error)]
        return Run(path, ending, watching.solves, notes, tolerances, arguments, units, home=home)


def _note_options(solve: Solve, units: str, options: str) -> None:
    """Name units, and keep what repeats the run."""
    from ..report.data import name_units

    report = solve.report
    for one in () if report is None else (report, *report.bodies):
        one.made["options"] = options
        if units:
            name_units(one.outputs.values(), units)


class _Watching:
    """Watches what a script does until the end of the context."""

    def __init__(self, interfaces: str) -> None:
        self._stack, self._bodies, self._watched, self._processes = ExitStack(), None, None, 0
        self._interfaces = interfaces

    def __enter__(self) -> _Watching:
        handle, self._elsewhere = tempfile.mkstemp(prefix="romerr_")
        os.close(handle)
        self._stack.callback(os.remove, self._elsewhere)
        self._stack.enter_context(after_import("exudyn", self._meet))
        self._stack.enter_context(after_import("multiprocessing.process", self._count_processes))
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    @property
    def solves(self) -> list[Solve]:
        return [] if self._watched is None else self._watched.solves

    def notes(self) -> Iterator[str]:
        """Yield what is to be said beside the numbers."""
        elsewhere = os.path.getsize(self._elsewhere)
        if elsewhere or self._processes:
            yield NOT_WATCHED.format(_count(elsewhere, "solve") if elsewhere else "solves", self._processes)
        if self._watched is None:
            yield NO_EXUDYN
        elif not self.solves:
            bodies, plain = self._bodies.count, self._watched.plain
            if bodies:
                yield NO_SOLVE.format(bodies, *(("body", "it") if bodies == 1 else ("bodies", "them")))
            else:
                yield NO_BODY.format(plain, "solves" if plain != 1 else "solve") if plain else NOTHING
        elif any(solve.chosen for solve in self.solves):
            yield CHOSEN
        yield from dict.fromkeys(note for solve in self.solves for note in solve.notes)

    def _meet(self, exudyn: ModuleType) -> None:
        """Exudyn was imported: stand in front of what adds bodies and solves."""
        from ..mbs.scenes.found_bodies import FoundBodies
        from ..mbs.scenes.watched_solves import WatchedSolves

        self._bodies = FoundBodies()
        self._watched = WatchedSolves(self._bodies, self._elsewhere, self._interfaces)
        for one in (self._bodies, self._watched):
            one.install(exudyn)
            self._stack.callback(one.uninstall)

    def _count_processes(self, process: ModuleType) -> None:
        start = process.BaseProcess.start

        @wraps(start)
        def counted(own: Any) -> Any:
            self._processes += 1
            return start(own)

        process.BaseProcess.start = counted
        self._stack.callback(setattr, process.BaseProcess, "start", start)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def write_files(run: Run, files: dict[str, str]) -> list[str]:
    """Write what was asked for; return a line for each file: where it is, or why it is not.

    Of several solves each has a file with its number.
    """
    lines = []
    for option, path in files.items():
        if option == "json":
            lines.append(tried(path, partial(run.save, path)))
            continue
        stem, ending = os.path.splitext(path)
        reports = {solve.number: solve.report for solve in run.solves if solve.report is not None}
        for number, report in reports.items():
            to = path if len(reports) == 1 else f"{stem}_{number}{ending}"
            lines.append(tried(to, partial(_write, report, option, to, run.tolerances)))
        lines += [] if reports else [f"not written: {path}: no solve has a report"]
    return lines


def _write(report: BoundReport, option: str, path: str, tolerances: Tolerances) -> None:
    from ..report.formats.html_page import write_page
    from ..report.plots.panels import plot_report

    if option == "save":
        report.save(path)
    else:
        {"plot": plot_report, "html": write_page}[option](report, path, tolerances=tolerances)


def mode_tables(done: Run) -> tuple[list[ModeTable], list[str]]:
    """Return the mode tables of all bodies in all solves, and lines: all of them, and why there are no others."""
    from ..mbs.studies.mode_table import mode_table

    tables, lines = [], []
    for solve in done.solves:
        lines += [f"Solve {solve.number} ({solve.kind}):"] if len(done.solves) > 1 else []
        lines += [f"{which}: {why}" for which, why in solve.refused]
        for flex in solve.flexes:
            tables.append(mode_table(flex, solve.report))
            lines.append(f"{tables[-1]}\n")
        lines += (
            [] if solve.report else [f"What the run tells of modes is not known: {solve.failure or solve.until}."]
        )
    return tables, [*lines, *done.notes]


def show(text: str) -> None:
    """Print text, whatever the script has done to sys.stdout; what a terminal cannot show is replaced."""
    stream = sys.stdout if sys.stdout is not None and not sys.stdout.closed else sys.__stdout__
    if stream is None or stream.closed:
        return
    encoding = getattr(stream, "encoding", None) or "utf-8"
    try:
        print(text.encode(encoding, "replace").decode(encoding), file=stream, flush=True)
    except BrokenPipeError:  # the reader, such as `head`, has seen enough; the exit status is what it is
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
