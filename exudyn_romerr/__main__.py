"""Command line: run a script and tell its errors; what saved reports say, as text, picture, HTML page or table.

Nothing but the standard library is imported before a script runs.
"""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from typing import TYPE_CHECKING

from . import __version__
from .errors import InputError, RomErrError
from .report.answers import WRONG_USAGE, Tolerances
from .scripts.execute import INTERRUPTED
from .scripts.files import checked_files, tell_on_stderr, tried
from .scripts.run import run, show, write_files

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .report.report import BoundReport
    from .scripts.run import Run

ABOUT = "How wrong reduced flexible bodies make an Exudyn simulation: of a script as it is, or of a saved report."
ENDINGS = {"html": (".html", ".htm"), "csv": (".csv", ".txt")}  # a script of another ending is not written over
SAVED = ("run.npz", "what report.save(...) wrote")
SWEPT = ("folder", "what sweep(..., folder=...) was given")
WRITTEN = {
    "save": "write the reports for romerr show, plot, report: run.npz",
    "html": "write an HTML page",
    "plot": "draw the sensors and their errors: .png, .svg, .pdf",
    "json": "write all numbers and answers for other programs",
}
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line (default: that of the process) and return its exit status, see STATUS."""
    given = _parser().parse_args(arguments)
    if given.run in (_run, _verify, _modes, _tune):
        return given.run(given)
    for stream in (sys.stdout, sys.stderr):  # no name of an output breaks a terminal that cannot show it
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    status = 0
    try:
        status = given.run(given) or 0
        sys.stdout.flush()
    except RomErrError as error:
        print(f"romerr: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:  # the reader, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        "romerr",
        description=ABOUT,
        epilog=f"example: romerr show run.npz\n\n{STATUS}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(required=True, metavar="command")
    _add_run(commands)
    _add_verify(commands)
    _add_modes(commands)
    _add_tune(commands)
    saved = _add(commands, "show", _show, "print the summary", "romerr show run.npz --tolerance 1%")
    saved.add_argument("--tolerance", action="append", type=_tolerance, metavar="X", help="as of romerr run")
    plot = _add(
        commands,
        "plot",
        _plot,
        "draw outputs and their errors",
        'romerr plot run.npz --output "tip z"',
        "png",
    )
    plot.add_argument(
        "--output", action="extend", nargs="+", metavar="NAME", help="only these outputs (default: all)"
    )
    page = _add(commands, "report", _report, "write an HTML page", "romerr report run.npz -o run.html", "html")
    page.add_argument("--tolerance", action="append", type=_tolerance, metavar="X", help="as of romerr run")
    _add(commands, "csv", _csv, "write values and errors over time", "romerr csv run.npz -o run.csv", "csv")
    collect = _add(commands, "collect", _collect, "make a table of a sweep", "romerr collect results", of=SWEPT)
    collect.add_argument("-o", metavar="file", dest="to", help="table.csv, or table.md; default: print it")
    return parser


def _add(
    commands, name: str, run, text: str, example: str, ending: str = "", of: tuple[str, str] = SAVED
) -> argparse.ArgumentParser:
    """Add a command; one that writes a file has an ending for it."""
    parser = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}.",
        epilog=f"example: {example}",
        allow_abbrev=False,
    )
    parser.add_argument("file", metavar=of[0], help=of[1])
    if ending:
        known = "; .svg and .pdf too" if ending == "png" else ""
        parser.add_argument("-o", metavar="file", dest="to", help=f"default: run.{ending} beside run.npz{known}")
    parser.set_defaults(run=run, ending=ending)
    return parser


def _add_run(commands) -> None:
    """The command that runs a script and tells what is estimated of it."""
    about = "run a script and tell how wrong its reduced bodies make it"
    parser = _add_scripted(commands, "run", about, "romerr run --tolerance 1% model.py", STATUS_OF_RUN)
    for option, what in WRITTEN.items():
        parser.add_argument(f"--{option}", metavar="file", help=what)
    parser.add_argument("--features", action="store_true", help="also peak, RMS and last value of each sensor")
    _add_script(parser, _run)


def _add_verify(commands) -> None:
    """The command that measures."""
    about = "run a script again and again, and measure its errors"
    parser = _add_scripted(commands, "verify", about, "romerr verify --tolerance 1% model.py", STATUS_OF_VERIFY)
    parser.add_argument("--jobs", type=int, metavar="N", help="runs at a time (default: as memory allows)")
    parser.add_argument("--timeout", type=float, metavar="S", help="end a run after so many seconds")
    parser.add_argument(
        "--controllers",
        choices=("follow", "hold"),
        default="follow",
        help="PreStep functions are called at every shorter step, or at the steps of the script (default: follow)",
    )
    parser.add_argument("--modes-by-call", action="store_true", help="also more modes by the script's own call")
    for option in ("json", "plot"):
        parser.add_argument(f"--{option}", metavar="file", help=WRITTEN[option])
    _add_script(parser, _verify)


def _add_modes(commands) -> None:
    """The command that tells of modes."""
    about = "run a script and tell which coordinate of its reduced bodies is which"
    parser = _add_scripted(commands, "modes", about, "romerr modes model.py", STATUS_OF_MODES, is_judged=False)
    parser.add_argument("--table", metavar="file", help="write the tables: modes.csv or modes.html")
    _add_script(parser, _modes)


def _modes(given: argparse.Namespace) -> int:
    """Run a script, print and write the tables of its bodies; the exit status is the script's."""
    try:
        files = checked_files({"table": given.table})
        done = run(given.script, given.arguments)
    except InputError as error:
        print(f"romerr: {error}", file=sys.stderr)
        return WRONG_USAGE
    done.ending.show()
    from .mode_selection.mode_table import write_tables
    from .scripts.modes import mode_tables

    tables, lines = mode_tables(done)
    written = [tried(path, partial(write_tables, tables, path)) for path in files.values()]
    show("\n".join(["", f"romerr {__version__}: {given.script}", *lines, *written]))
    done.ending.leave()
    return done.ending.status


def _add_tune(commands) -> None:
    """The command that looks for the cheapest modes and step."""
    about = "find the cheapest number of modes and step that meet a tolerance"
    parser = _add_scripted(commands, "tune", about, "romerr tune --tolerance 1% model.py", STATUS_OF_VERIFY)
    parser.add_argument("--only", choices=("modes", "step"), help="what alone may vary (default: both)")
    parser.add_argument("--timeout", type=float, metavar="S", help="end a run after so many seconds")
    for option in ("json", "plot"):
        parser.add_argument(f"--{option}", metavar="file", help=WRITTEN[option])
    _add_script(parser, _tune)


def _tune(given: argparse.Namespace) -> int:
    """Look for the cheapest pair, print and write it."""
    from .scripts.tune import tune

    return _several_runs(given, partial(tune, only=given.only))


def _verify(given: argparse.Namespace) -> int:
    """Measure, print and write the answer."""
    from .scripts.verify import verify

    own = {name: getattr(given, name) for name in ("units", "controllers", "jobs", "modes_by_call")}
    return _several_runs(given, partial(verify, **own))


def _several_runs(given: argparse.Namespace, find) -> int:
    """Let a function make its runs of a script, print and write what it has found."""
    try:
        files = checked_files({option: getattr(given, option) for option in ("json", "plot")})
        found = find(
            given.script,
            given.arguments,
            tolerance=given.tolerance,
            timeout=given.timeout,
            progress=None if given.quiet else tell_on_stderr,
        )
    except RomErrError as error:
        print(f"romerr: {error}", file=sys.stderr)
        return WRONG_USAGE
    except KeyboardInterrupt:
        print("romerr: stopped before there was anything to show", file=sys.stderr)
        return INTERRUPTED
    written = [tried(path, partial({"json": found.save, "plot": found.plot}[x], path)) for x, path in files.items()]
    if not given.quiet:
        show("\n".join([f"romerr {__version__}: {given.script}", str(found), *written]))
    _tell_misspelt(found.misspelt if given.quiet else [])
    return found.status


def _features(done: Run) -> list[str]:
    """Lines of peaks, RMS and values at the end of all sensors in all solves that have a report."""
    from .report.derived import features_table
    from .report.table import aligned

    return ["", *aligned(features_table(done.reports))] if done.reports else []


def _tell_misspelt(lines: Sequence[str]) -> None:
    """Print what is wrong usage even where no answer is wanted."""
    for line in lines:
        print(f"romerr: {line}", file=sys.stderr)


def _add_scripted(
    commands, name: str, about: str, example: str, status: str, is_judged: bool = True
) -> argparse.ArgumentParser:
    """Add a command about a script; its options come before the script, whose own come after it."""
    parser = commands.add_parser(
        name,
        help=about,
        description=f"{about[0].upper()}{about[1:]}. The script needs no line of ours.",
        epilog=f"example: {example}\n\n{status}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        usage=f"romerr {name} [options] script.py [its arguments]",
        allow_abbrev=False,
    )
    if not is_judged:
        return parser
    parser.add_argument(
        "--tolerance",
        action="append",
        default=[],
        metavar="X",
        help="the error that is allowed: in the model's units (0.001), as a share of each largest value (1%%), or of "
        "one sensor (tip=0.001); repeatable",
    )
    parser.add_argument("--units", default="", metavar="U", help="the model's unit of length, to be printed: mm")
    parser.add_argument("--quiet", action="store_true", help="print no answer")
    return parser


def _add_script(parser: argparse.ArgumentParser, run) -> None:
    parser.add_argument("script", help="an Exudyn script")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    parser.set_defaults(run=run)


def _run(given: argparse.Namespace) -> int:
    """Run a script, print and write the answer; the exit status is the script's, or that of the answer."""
    try:
        files = checked_files({option: getattr(given, option) for option in WRITTEN})
        done = run(given.script, given.arguments, tolerance=given.tolerance, units=given.units)
    except InputError as error:
        print(f"romerr: {error}", file=sys.stderr)
        return WRONG_USAGE
    done.ending.show()
    written = write_files(done, files)
    if not given.quiet:
        told = [str(done), *(_features(done) if given.features else [])]
        show("\n".join(["", f"romerr {__version__}: {given.script}", *told, *written]))
    _tell_misspelt(done.misspelt if given.quiet else [])
    done.ending.leave()
    return done.status


def _tolerance(text: str) -> str:
    """The text, if it is a tolerance."""
    try:
        Tolerances([text])
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


def _show(given: argparse.Namespace) -> int:
    from . import load_report

    report = load_report(given.file)
    try:
        print(report.summary(given.tolerance))
    except InputError as error:  # a name that no output has
        print(f"romerr: {error}", file=sys.stderr)
        return WRONG_USAGE
    return 0


def _plot(given: argparse.Namespace) -> None:
    report, to = _opened(given)
    report.plot(to, given.output)
    print(f"written: {to}")


def _report(given: argparse.Namespace) -> None:
    report, to = _opened(given)
    report.to_html(to, given.tolerance)
    print(f"written: {to}")


def _csv(given: argparse.Namespace) -> None:
    report, to = _opened(given)
    report.to_csv(to)
    print(f"written: {to}")


def _collect(given: argparse.Namespace) -> None:
    from .sweeps.collect import text_of, write_table

    if given.to is None:
        print(text_of(given.file))
        return
    write_table(given.file, given.to)
    print(f"written: {given.to}")


def _opened(given: argparse.Namespace) -> tuple[BoundReport, str]:
    """The report, and where to write: never over it, and only what the ending says."""
    from . import load_report

    to = given.to or f"{os.path.splitext(given.file)[0]}.{given.ending}"
    report = load_report(given.file)
    if os.path.exists(to) and os.path.samefile(to, given.file):
        raise InputError(f"{to} is the report itself and would be lost; pass another name after -o")
    known = ENDINGS.get(given.ending)
    if known and not to.lower().endswith(known):
        raise InputError(f"{to} does not end in {' or '.join(known)}; pass such a name after -o")
    return report, to


if __name__ == "__main__":
    sys.exit(main())
