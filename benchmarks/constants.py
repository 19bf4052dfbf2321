"""Which of our chosen numbers decide what is told: each is doubled and halved, and the figures are counted again.

    python benchmarks/constants.py [--seeds 16] [--only NAME ...] [--docs]       half an hour

Moved are the numbers in capital letters of the folders that tell a mechanism's errors and bounds; each has its reason
beside it. The scenes are random mechanisms with stored truths, as in half_widths.py: "good" and "within" are its
words; "above" counts components of which an error is above its bound.
"""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from textwrap import wrap
from types import ModuleType
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import page
from benchmarks.half_widths import is_good, is_left_out
from benchmarks.told_and_true import of_seed

MARK = "constants"
FOLDERS = ("mechanism", "mechanism_errors", "mechanism_bounds", "mbs.mirror")
# counts of parts of a whole, orders of a scheme and of polynomials, what IEEE numbers are: no choices
NO_CHOICES = (
    "THIRDS",
    "RIGID_MODES",
    "ORDER",
    "SECTIONS",
    "EPSILON",
    "GOLDEN",
    "ROUNDED",
    "DEFINITE",
    "POINTS",
)
FACTORS = (2, 0.5)
HEAD = f"{'':<52}{'numbers':>8}{'good':>7}{'within':>8}{'bounds':>8}{'above':>7}"


class Figures(NamedTuple):
    """Numbers that are compared; of these good, and with the truth within two half widths; bounds; errors above."""

    numbers: int
    good: int
    within: int
    bounds: int
    above: int


def figures(seeds: list[int]) -> Figures:
    """Return the figures of so many random mechanisms."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # numbers that overflow where a constant is moved are what is looked for
        results = [of_seed(seed) for seed in seeds]
    records = [record for one in results for record in one.get("records", ()) if not is_left_out(record)]
    bounds = [value for one in results for value in one.get("bounds", ())]
    within = sum(record["is known"] and record["inside"] == 1 for record in records)
    above = sum(value["below"] > 0 for value in bounds)
    return Figures(len(records), sum(map(is_good, records)), within, len(bounds), above)


def numbers_of(folder: str) -> Iterator[tuple[ModuleType, str, float]]:
    """Yield the chosen numbers of a folder: module, name, value."""
    package = import_module(f"exudyn_romerr.{folder}")
    for found in iter_modules(package.__path__):
        module = import_module(f"{package.__name__}.{found.name}")
        text = Path(module.__file__).read_text(encoding="utf-8")
        for name, value in vars(module).items():
            is_own = re.search(rf"^(?:[A-Z_0-9]+, )*{name}(?:, [A-Z_0-9]+)* = ", text, re.MULTILINE)
            if name.isupper() and type(value) in (int, float) and name not in NO_CHOICES and is_own:
                yield module, name, value


@contextmanager
def moved(module: ModuleType, name: str, factor: float) -> Iterator[None]:
    """Multiply a number for a while; a count stays one."""
    kept = getattr(module, name)
    setattr(module, name, max(1, round(kept * factor)) if isinstance(kept, int) else kept * factor)
    try:
        yield
    finally:
        setattr(module, name, kept)


def line_of(label: str, found: Figures) -> str:
    """Return a line of the table."""
    return f"{label:<52}{found.numbers:8d}{found.good:7d}{found.within:8d}{found.bounds:8d}{found.above:7d}"


def table(seeds: list[int], only: list[str]) -> str:
    """Return the figures as they are, and where a number was moved that changes them; the others by their names."""
    here, lines, others = figures(seeds), [], []
    for folder in FOLDERS:
        for module, name, value in numbers_of(folder):
            label = f"{module.__name__.removeprefix('exudyn_romerr.')}.{name}"
            if only and name not in only:
                continue
            rows = []
            for factor in FACTORS:
                with moved(module, name, factor):
                    rows.append((f"{label} = {value:g}, times {factor:g}", figures(seeds)))
            changed = [line_of(*row) for row in rows if row[1] != here]
            lines += changed
            others += [] if changed else [label]
            print(*changed or [f"{label}: no figure changes"], sep="\n", file=sys.stderr, flush=True)
    unmoved = f"{len(others)} more, of which neither changes a figure: {', '.join(others)}" if others else ""
    return "\n".join([HEAD, line_of("as they are", here), *lines, *wrap(unmoved, 130)])


def main(arguments: list[str] | None = None) -> str:
    """Measure, print and return the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--seeds", type=int, default=16, help="random mechanisms 0 .. SEEDS - 1")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="numbers of these names")
    parser.add_argument("--docs", action="store_true", help=f"write the table into {page.PAGE.name}")
    options = parser.parse_args(arguments)
    return page.show(MARK, table([*range(options.seeds)], options.only), options.docs)


if __name__ == "__main__":
    main()
