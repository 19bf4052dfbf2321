"""Command line: what saved reports say, as text, picture, HTML page or table. Needs no Exudyn."""

from __future__ import annotations

import argparse
import math
import os
import sys
from typing import TYPE_CHECKING

from . import __version__, load_report
from .errors import InputError, RomErrError
from .sweeps.collect import text_of, write_table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .report.report import BoundReport

ABOUT = "Errors of a reduced simulation, estimated and bounded, from the file that report.save(...) wrote."
ENDINGS = {"html": (".html", ".htm"), "csv": (".csv", ".txt")}  # a script of another ending is not written over
SAVED = ("run.npz", "what report.save(...) wrote")
SWEPT = ("folder", "what sweep(..., folder=...) was given")
STATUS = "exit status: 0 fine; 1 something given is wrong, the message says what to do; 2 wrong usage"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line (default: that of the process) and return its exit status, see STATUS."""
    for stream in (sys.stdout, sys.stderr):  # no name of an output breaks a terminal that cannot show it
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    given = _parser().parse_args(arguments)
    try:
        given.run(given)
        sys.stdout.flush()
    except RomErrError as error:
        print(f"romerr: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:  # the reader, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


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
    show = _add(commands, "show", _show, "print the summary", "romerr show run.npz --tolerance 1%")
    show.add_argument(
        "--tolerance",
        type=_tolerance,
        metavar="X",
        help="say of every output whether its error is within X: 1%% of each row's largest value, or in its unit",
    )
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
    _add(commands, "report", _report, "write an HTML page", "romerr report run.npz -o run.html", "html")
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


def _tolerance(text: str) -> tuple[float, bool]:
    """A number, and whether it is a share."""
    share = text.rstrip().endswith("%")
    try:
        number = float(text.rstrip().rstrip("%")) / (100 if share else 1)
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive number, or one with %")
    return number, share


def _show(given: argparse.Namespace) -> None:
    report = load_report(given.file)
    print(report)
    for name in report.outputs if given.tolerance else ():
        print(report.assess(name, *given.tolerance))


def _plot(given: argparse.Namespace) -> None:
    report, to = _opened(given)
    report.plot(to, given.output)
    print(f"written: {to}")


def _report(given: argparse.Namespace) -> None:
    report, to = _opened(given)
    report.to_html(to)
    print(f"written: {to}")


def _csv(given: argparse.Namespace) -> None:
    report, to = _opened(given)
    report.to_csv(to)
    print(f"written: {to}")


def _collect(given: argparse.Namespace) -> None:
    if given.to is None:
        print(text_of(given.file))
        return
    write_table(given.file, given.to)
    print(f"written: {given.to}")


def _opened(given: argparse.Namespace) -> tuple[BoundReport, str]:
    """The report, and where to write: never over it, and only what the ending says."""
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
