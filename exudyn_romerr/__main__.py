"""Command line: run a script and tell its errors; what saved reports say, as text, picture, HTML page or table.

Nothing but the standard library is imported before a script runs.
"""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from . import __version__
from .errors import InputError, RomErrError
from .report.answers import WRONG_USAGE, Tolerances
from .scripts.execute import INTERRUPTED
from .scripts.files import checked_files, tell_on_stderr, tried
from .scripts.run import INTERFACES, mode_tables, run, show, write_files

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from .report.report import BoundReport
    from .scripts.files import Answered
    from .scripts.run import Run

ABOUT = "How wrong reduced flexible bodies make an Exudyn simulation: of a script as it is, or of a saved report."
ENDINGS = {"html": (".html", ".htm"), "csv": (".csv", ".txt")}  # a script of another ending is not written over
STATUS = "exit status: 0 fine; 1 something given is wrong, the message says what to do; 2 wrong usage"
STATUS_OF_RUN = (
    "exit status: that of the script; with --tolerance, where the script ends well: 0 enough, 3 too large, "
    "4 not known; 2 wrong usage, a --tolerance of a sensor that there is not, too"
)
STATUS_OF_MODES = "exit status: that of the script; 2 wrong usage"
STATUS_OF_VERIFY = (
    "exit status: 0; with --tolerance: 0 enough, 3 too large, 4 not known; 2: nothing could be run, or a --tolerance "
    "of a sensor that there is not"
)
WRITTEN = ("save", "html", "plot", "json")
JUDGED = ("tolerance", "units", "quiet")
OPTIONS = {  # of commands about a script; those that write a file first
    "save": {"metavar": "file", "help": "write the reports for romerr show, plot, report: run.npz"},
    "html": {"metavar": "file", "help": "write an HTML page, one sheet of A4 in print"},
    "plot": {"metavar": "file", "help": "draw the sensors and their errors: .png, .svg, .pdf"},
    "json": {"metavar": "file", "help": "write all numbers and answers for other programs"},
    "table": {"metavar": "file", "help": "write the tables: modes.csv or modes.html"},
    "tolerance": {
        "action": "append",
        "default": [],
        "metavar": "X",
        "help": "the error that is allowed: in the model's units (0.001), as a share of each largest value (1%%), or "
        "of one sensor (tip=0.001); repeatable",
    },
    "units": {"default": "", "metavar": "U", "help": "the model's unit of length, to be printed: mm"},
    "quiet": {"action": "store_true", "help": "print no answer"},
    "features": {"action": "store_true", "help": "also peak, RMS and last value of each sensor"},
    "interfaces": {
        "choices": INTERFACES,
        "default": "free",
        "help": "rigid: interfaces that RBE2 modes make rigid are so in reality (default: free)",
    },
    "measure-step": {
        "action": "store_true",
        "help": "where the step's error is not known, also run with half the step and a quarter: 7 times the run",
    },
    "jobs": {"type": int, "metavar": "N", "help": "runs at a time (default: as memory allows)"},
    "timeout": {"type": float, "metavar": "S", "help": "end a run after so many seconds"},
    "controllers": {
        "choices": ("follow", "hold"),
        "default": "follow",
        "help": "PreStep functions are called at every shorter step, or at the steps of the script (default: follow)",
    },
    "modes-by-call": {"action": "store_true", "help": "also more modes by the script's own call"},
    "only": {"choices": ("modes", "step"), "help": "what alone may vary (default: both)"},
}


class _Scripted(NamedTuple):
    """A command about a script: what it does, an example of its options, what its exit status is, its options."""

    about: str
    example: str
    status: str
    options: tuple[str, ...]


SCRIPTED = {
    "run": _Scripted(
        "run a script and tell how wrong its reduced bodies make it",
        " --tolerance 1%",
        STATUS_OF_RUN,
        (*JUDGED, *WRITTEN, "features", "interfaces", "measure-step"),
    ),
    "verify": _Scripted(
        "run a script again and again, and measure its errors",
        " --tolerance 1%",
        STATUS_OF_VERIFY,
        (*JUDGED, "jobs", "timeout", "controllers", "modes-by-call", "json", "plot"),
    ),
    "modes": _Scripted(
        "run a script and tell which coordinate of its reduced bodies is which", "", STATUS_OF_MODES, ("table",)
    ),
    "tune": _Scripted(
        "find the cheapest number of modes and step that meet a tolerance",
        " --tolerance 1%",
        STATUS_OF_VERIFY,
        (*JUDGED, "only", "timeout", "json", "plot"),
    ),
}


class _OfFile(NamedTuple):
    """A command about a saved report, or a folder: what it does, the rest of an example, what it is of.

    ending : of the file that it writes of a report; write : does so.
    """

    about: str
    example: str
    of: tuple[str, str] = ("run.npz", "what report.save(...) wrote")
    ending: str = ""
    write: Callable[[BoundReport, str, argparse.Namespace], None] | None = None


OF_FILES = {
    "show": _OfFile("print the summary", "run.npz --tolerance 1%"),
    "plot": _OfFile(
        "draw outputs and their errors",
        'run.npz --output "tip z"',
        ending="png",
        write=lambda report, to, given: report.plot(to, given.output),
    ),
    "report": _OfFile(
        "write an HTML page, one sheet of A4 in print",
        "run.npz -o page.html",
        ending="html",
        write=lambda report, to, given: report.to_html(to, given.tolerance),
    ),
    "csv": _OfFile(
        "write values and errors over time",
        "run.npz -o run.csv",
        ending="csv",
        write=lambda report, to, given: report.to_csv(to),
    ),
    "collect": _OfFile("make a table of a sweep", "results", ("folder", "what sweep(..., folder=...) was given")),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line (default: that of the process) and return its exit status, see STATUS."""
    given = _parser().parse_args(arguments)
    if given.command in SCRIPTED:
        return {"run": _run, "verify": _verify, "modes": _modes, "tune": _tune}[given.command](given)
    for stream in (sys.stdout, sys.stderr):  # no name of an output breaks a terminal that cannot show it
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    status = 0
    try:
        status = {"show": _show, "collect": _collect}.get(given.command, _write)(given) or 0
        sys.stdout.flush()
    except RomErrError as error:
        return _wrong(error, 1)
    except BrokenPipeError:  # the reader, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status


def _wrong(error: object, status: int = WRONG_USAGE) -> int:
    print(f"romerr: {error}", file=sys.stderr)
    return status


def _parser() -> argparse.ArgumentParser:
    own = {"formatter_class": argparse.RawDescriptionHelpFormatter, "allow_abbrev": False}
    epilog = f"example: romerr show run.npz\n\n{STATUS}"
    parser = argparse.ArgumentParser("romerr", description=ABOUT, epilog=epilog, **own)
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(required=True, metavar="command", dest="command")
    for name, one in SCRIPTED.items():
        about = f"{one.about[0].upper()}{one.about[1:]}. The script needs no line of ours."
        example = f"example: romerr {name}{one.example} model.py\n\n{one.status}"
        usage = f"romerr {name} [options] script.py [its arguments]"
        of = commands.add_parser(name, help=one.about, description=about, epilog=example, usage=usage, **own)
        for option in one.options:
            of.add_argument(f"--{option}", **OPTIONS[option])
        of.add_argument("script", help="an Exudyn script")
        of.add_argument("arguments", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    for name, one in OF_FILES.items():
        about, example = f"{one.about[0].upper()}{one.about[1:]}.", f"example: romerr {name} {one.example}"
        of = commands.add_parser(name, help=one.about, description=about, epilog=example, allow_abbrev=False)
        of.add_argument("file", metavar=one.of[0], help=one.of[1])
        if one.ending:
            known = "; .svg and .pdf too" if one.ending == "png" else ""
            of.add_argument("-o", metavar="file", dest="to", help=f"default: run.{one.ending} beside run.npz{known}")
        if name in ("show", "report"):
            of.add_argument("--tolerance", action="append", type=_tolerance, metavar="X", help="as of romerr run")
    all_of = commands.choices
    all_of["plot"].add_argument(
        "--output", action="extend", nargs="+", metavar="NAME", help="only these outputs (default: all)"
    )
    all_of["collect"].add_argument("-o", metavar="file", dest="to", help="table.csv, or table.md; default: print it")
    return parser


def _tolerance(text: str) -> str:
    """The text, if it is a tolerance."""
    try:
        Tolerances([text])
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


# --- scripts ---


def _run(given: argparse.Namespace) -> int:
    """Run a script, print and write the answer; the exit status is the script's, or that of the answer."""
    try:
        files = checked_files({option: getattr(given, option) for option in WRITTEN})
        own = {name: getattr(given, name) for name in ("tolerance", "units", "interfaces")}
        done = run(given.script, given.arguments, **own)
    except InputError as error:
        return _wrong(error)
    done.ending.show()
    not_measured = _measured_step(done, given) if given.measure_step else []
    written = write_files(done, files)
    features = _features(done) if given.features and not given.quiet else []
    _tell(given, done, [*not_measured, *features, *written])
    done.ending.leave()
    return done.status


def _measured_step(done: Run, given: argparse.Namespace) -> list[str]:
    """Let a run measure its step; return a line where that cannot be had."""
    try:
        done.measure_step(None if given.quiet else tell_on_stderr)
    except RomErrError as error:
        return [f"the step was not measured: {error}"]
    except KeyboardInterrupt:
        return ["the step was not measured: stopped before there was anything to compare"]
    return []


def _features(done: Run) -> list[str]:
    """Lines of peaks, RMS and values at the end of all sensors in all solves that have a report."""
    from .report.derived import features_table
    from .report.verdict_text import aligned

    return ["", *aligned(features_table(done.reports))] if done.reports else []


def _modes(given: argparse.Namespace) -> int:
    """Run a script, print and write the tables of its bodies; the exit status is the script's."""
    try:
        files = checked_files({"table": given.table})
        done = run(given.script, given.arguments)
    except InputError as error:
        return _wrong(error)
    done.ending.show()
    from .mode_selection.mode_table import write_tables

    tables, lines = mode_tables(done)
    written = [tried(path, partial(write_tables, tables, path)) for path in files.values()]
    show("\n".join(["", f"romerr {__version__}: {given.script}", *lines, *written]))
    done.ending.leave()
    return done.ending.status


def _tune(given: argparse.Namespace) -> int:
    """Look for the cheapest pair, print and write it."""
    from .scripts.tune import tune

    return _several_runs(given, partial(tune, only=given.only))


def _verify(given: argparse.Namespace) -> int:
    """Measure, print and write the answer."""
    from .scripts.verify import verify

    own = {name: getattr(given, name) for name in ("units", "controllers", "jobs", "modes_by_call")}
    return _several_runs(given, partial(verify, **own))


def _several_runs(given: argparse.Namespace, find: Callable) -> int:
    """Let a function make its runs of a script, print and write what it has found."""
    try:
        files = checked_files({option: getattr(given, option) for option in ("json", "plot")})
        tell = None if given.quiet else tell_on_stderr
        own = {"tolerance": given.tolerance, "timeout": given.timeout, "progress": tell}
        found = find(given.script, given.arguments, **own)
    except RomErrError as error:
        return _wrong(error)
    except KeyboardInterrupt:
        return _wrong("stopped before there was anything to show", INTERRUPTED)
    write = {"json": found.save, "plot": found.plot}
    _tell(given, found, [tried(path, partial(write[option], path)) for option, path in files.items()])
    return found.status


def _tell(given: argparse.Namespace, found: Answered, lines: Sequence[str]) -> None:
    """Print an answer, and lines below it; what is wrong usage even where no answer is wanted."""
    if not given.quiet:
        above = "\n" if given.command == "run" else ""  # below what the script has printed
        show("\n".join([f"{above}romerr {__version__}: {given.script}", str(found), *lines]))
        return
    for line in found.misspelt:
        _wrong(line)


# --- saved reports ---


def _show(given: argparse.Namespace) -> int:
    from . import load_report

    report = load_report(given.file)
    try:
        print(report.summary(given.tolerance))
    except InputError as error:  # a name that no output has
        return _wrong(error)
    return 0


def _write(given: argparse.Namespace) -> None:
    """Write a file of a report: never over it, and only what the ending says."""
    from . import load_report

    command = OF_FILES[given.command]
    to = given.to or f"{os.path.splitext(given.file)[0]}.{command.ending}"
    report = load_report(given.file)
    if os.path.exists(to) and os.path.samefile(to, given.file):
        raise InputError(f"{to} is the report itself and would be lost; pass another name after -o")
    known = ENDINGS.get(command.ending)
    if known and not to.lower().endswith(known):
        raise InputError(f"{to} does not end in {' or '.join(known)}; pass such a name after -o")
    command.write(report, to, given)
    print(f"written: {to}")


def _collect(given: argparse.Namespace) -> None:
    from .mbs.studies.sweeps import text_of, write_table

    if given.to is None:
        print(text_of(given.file))
        return
    write_table(given.file, given.to)
    print(f"written: {given.to}")


if __name__ == "__main__":
    sys.exit(main())
