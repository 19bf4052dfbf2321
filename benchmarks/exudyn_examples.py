"""Exudyn's own flexible examples, with our lines and without: same results, estimate, bound, truth, cost.

    python benchmarks/exudyn_examples.py CHECKOUT [--only NAME ...] [--pairs 3]
    python benchmarks/exudyn_examples.py CHECKOUT --docs     writes the table into docs/exudyn_examples.md, too

CHECKOUT is a work tree of github.com/jgerstmayr/EXUDYN; needs ngsolve. Every script runs in a process and a folder of
its own (exudyn_recorder.py), headless, patched by exudyn_patches.py and by nothing else. CPU time: of the solve and
the report, over that of the solve without our lines, in turn; floating_body, attach and the call that begins a solve
come before it and are counted apart.

Truths are runs of a script with many more modes, same steps: its outputs are compared with estimate and bound at all
instants. Of the estimate only the modes' part can be compared so, since steps are the same.
"""

import argparse
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks import page
from benchmarks.exudyn_patches import EXAMPLES, Example
from benchmarks.exudyn_runs import Case, Comparison, Outcome, differences, run_cases, run_truths

ROOT = Path("main/pythonDev")
PAGE = page.ROOT / "docs" / "exudyn_examples.md"
COLUMNS = (
    "example|lines|scope|output|largest value|error about|bound|bound / value|truth|error|modes' part off by|"
    "bound / error|above the bound|results with and without|CPU time|before"
).split("|")
NEWTON = 1e-9  # of an output: what Newton's tolerance leaves is no error of the reduction


def rounded(x: float) -> str:
    """Return two digits of a number, without an exponent where it has few zeros."""
    return f"{float(f'{x:.2g}'):.2g}" if x and not 1e-2 <= abs(x) < 1e4 else f"{float(f'{x:.2g}'):g}"


def shown(share: float) -> str:
    """Return a share in per cent, or how many times as large the bound is."""
    return f"{rounded(share)} times" if share > 10 else f"{rounded(100 * share)} %"


def rows(case: Case) -> list[list[str]]:
    """Return a row of the table for each output, or for each refusal."""
    told, example = case.ours.told, EXAMPLES[case.name]
    head = {"example": case.name, "lines": case.view, "results with and without": equality(case)}
    made = [row(head, scope=f"refused by {text}") for text in told["refusals"]]
    if told["failed"] != case.bare.told["failed"] or not (made or told["bodies"]):
        made.append(row(head, scope=f"script fails: {told['failed']}"))
    stopped = any("refused" in body for body in told["bodies"])  # a solve that was stopped costs little
    costs = {} if stopped else {"CPU time": f"{case.ratio:.1f} times", "before": f"{rounded(case.offline)} s"}
    for i, body in enumerate(told["bodies"]):
        if "refused" in body:
            made.append(row(head, scope=f"{part_of(example, i, case.ours)}refused by {body['refused']}"))
    return made + [row(head, **cells_of(example, case.ours, key), **costs) for key in outputs(case.ours)]


def equality(case: Case) -> str:
    """Return whether results with and without our lines are the same, in words."""
    changed, count = differences(case.bare.states, case.ours.states), len(case.bare.states)
    return f"{len(changed)} of {count} arrays differ" if changed else f"all {count} arrays equal"


def compared(comparison: Comparison) -> list[list[str]]:
    """Return a row of estimate, bound and error for each output."""
    coarse, made = comparison.coarse, []
    for key in outputs(coarse):
        value, part, bound = (coarse.series.get(f"{key[0]} {what} {key[1]}") for what in ("value", MODES, "bound"))
        missed = comparison.fine.series[f"{key[0]} value {key[1]}"] - value
        error, floor = np.abs(missed), NEWTON * np.max(np.abs(value))
        found = cells_of(EXAMPLES[comparison.name], coarse, key)
        found |= {"truth": comparison.truth, "error": rounded(error.max()), "bound / error": sharpness(bound, error)}
        found["above the bound"] = f"{int(np.sum(np.any(error > bound + floor, axis=1)))} of {len(error)}"
        if part is not None:
            found["modes' part off by"] = shown(np.abs(part - missed).max() / error.max())
        made.append(row({"example": comparison.name}, **found))
    return made


SERIES, MODES = ("value", "estimate", "half width", "bound"), "modes' part"


def outputs(outcome: Outcome) -> list[tuple[str, str]]:
    """Return (number of the body, name) of all outputs."""
    split = (key.split(" ", 2) for key in outcome.series if " value " in key)
    return [(number, name) for number, _, name in split]


def cells_of(example: Example, outcome: Outcome, key: tuple[str, str]) -> dict[str, str]:
    """Return what a report says of an output: value, estimate and bound, each its largest."""
    (number, name), body = key, outcome.told["bodies"][int(key[0])]
    unit = next(out["unit"] for out in body["outputs"] if out["name"] == name)
    series = (outcome.series.get(f"{number} {what} {name}") for what in SERIES)
    value, estimate, half_width, bound = (None if x is None else float(np.max(np.abs(x))) for x in series)
    return {
        "scope": body["scope"],
        "output": part_of(example, int(number), outcome) + name,
        "largest value": f"{rounded(value)} {unit}",
        "error about": "" if estimate is None else f"{rounded(estimate)} +- {rounded(half_width)}",
        "bound": rounded(bound) if np.isfinite(bound) else "none",
        "bound / value": shown(bound / value) if value and np.isfinite(bound) else "",
    }


def sharpness(bound: np.ndarray, error: np.ndarray) -> str:
    """Return the largest bound over the largest error of all rows together, and of the row where it is worst."""
    if not np.isfinite(bound).all():
        return ""
    together = rounded(bound.max() / error.max())
    largest = error.max(axis=0)
    if len(largest) == 1:
        return together
    return f"{together}, one row {rounded((bound.max(axis=0)[largest > 0] / largest[largest > 0]).max())}"


def part_of(example: Example, i: int, outcome: Outcome) -> str:
    """Return the name of a body, for its outputs, if the script has several in turn."""
    return f"{example.parts[i]}: " if len(example.parts) == len(outcome.told["bodies"]) else ""


def row(head: dict[str, str], **cells: str) -> list[str]:
    """Return a row of the table; cells that are not there are empty."""
    return [{**head, **cells}.get(column, "") for column in COLUMNS]


def line(cells: list[str]) -> str:
    """Return a row as markdown."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def main(arguments: list[str] | None = None) -> list[list[str]]:
    """Run the examples, print and return the rows of the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("checkout", type=Path, help="work tree of Exudyn's repository")
    parser.add_argument("--only", nargs="+", choices=EXAMPLES, default=list(EXAMPLES), metavar="NAME")
    parser.add_argument("--pairs", type=int, default=3, help="at most; no more once an example has taken long")
    parser.add_argument("--docs", action="store_true", help=f"write the table into {PAGE.name}")
    options = parser.parse_args(arguments)
    root = options.checkout / ROOT
    if not root.is_dir():
        parser.error(f"{root} is not there; needed: a work tree of github.com/jgerstmayr/EXUDYN")
    lines, table = [line(COLUMNS), line(["---"] * len(COLUMNS))], []
    print("\n".join(lines))
    with tempfile.TemporaryDirectory() as folder:
        for name in options.only:
            made = example_rows(name, root, Path(folder), options.pairs)
            print("\n".join(map(line, made)), flush=True)
            table += made
    notes = noted(options.only)
    print("\n" + notes)
    if options.docs:
        page.put_between("examples", "\n".join([*lines, *map(line, table), "", notes]), PAGE)
    return table


def noted(names: list[str]) -> str:
    """Return the notes of examples as a paragraph, each note once."""
    notes: dict[str, list[str]] = {}
    for name in names:
        notes.setdefault(EXAMPLES[name].note, []).append(name)
    return textwrap.fill(" ".join(f"*{', '.join(of)}:* {note}." for note, of in notes.items() if note), 128)


def example_rows(name: str, root: Path, folder: Path, pairs: int) -> list[list[str]]:
    """Return the rows of one example: with our lines, then against truths."""
    example = EXAMPLES[name]
    try:
        cases = run_cases(name, example, root, folder, pairs)
        found = [made for case in cases for made in rows(case)]
        return found + [made for truth in run_truths(name, example, root, folder, cases) for made in compared(truth)]
    except (RuntimeError, subprocess.TimeoutExpired) as error:
        return [row({"example": name}, scope=f"not run: {error}")]  # the others still can be


if __name__ == "__main__":
    main()
