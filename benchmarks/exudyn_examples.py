"""Exudyn's own flexible examples, with our lines and without: same results, what bound, at what cost.

    python benchmarks/exudyn_examples.py CHECKOUT [--only NAME ...] [--pairs 3] [--markdown]
    python benchmarks/exudyn_examples.py CHECKOUT --truth [--only NAME ...] [--markdown]

CHECKOUT is a work tree of github.com/jgerstmayr/EXUDYN; needs ngsolve. Every script runs in a process and a folder of
its own (exudyn_recorder.py), headless, patched by exudyn_patches.py and by nothing else. CPU time: of the solve and
the report, over that of the solve without our lines, in turn; floating_body, attach and the call that begins a solve
come before it and are counted apart.

--truth runs a script with many more modes, same steps, and compares its outputs with the bounds at every instant.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import textwrap
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
# no windows; threads on small matrices only wait for one another
os.environ.update({"EXUDYN_SUPPRESS_UI_WINDOW_OPEN": "1", "MPLBACKEND": "Agg", "OPENBLAS_NUM_THREADS": "1"})

import numpy as np

from benchmarks import exudyn_recorder
from benchmarks.exudyn_patches import EXAMPLES, Example, edited, inserted

ROOT = Path("main/pythonDev")
LIMIT = 1200  # s, for one script
ENOUGH = 30  # s, for one example: no further pairs after that
BARE = "without our lines"


class Outcome(NamedTuple):
    """What one run of a script left behind."""

    states: dict[str, np.ndarray]
    series: dict[str, np.ndarray]
    told: dict[str, Any]


def ran(source: str, script: Path, folder: Path) -> Outcome:
    """Run the source of a script in a new folder that has the test data of the original."""
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("solution", "testData"):
        (folder / name).mkdir(parents=True)
    if (script.parent / "testData").is_dir():
        shutil.copytree(script.parent / "testData", folder / "testData", dirs_exist_ok=True)
    path = folder / script.name
    path.write_text(source, encoding="utf-8")
    command = [sys.executable, exudyn_recorder.__file__, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, stdin=subprocess.DEVNULL)
    (folder / "out.txt").write_text(done.stdout + done.stderr)
    if done.returncode:
        raise RuntimeError(f"{script.name} ended with code {done.returncode}: {done.stderr[-1000:]}")
    states, series, told = (folder / name for name in exudyn_recorder.RESULTS)
    return Outcome(dict(np.load(states)), dict(np.load(series)), json.loads(told.read_text()))


def differences(bare: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> list[str]:
    """Return the names of what is not the same bit by bit, or is there only once; RuntimeError if all is empty."""
    if not any(x.size for x in bare.values()):
        raise RuntimeError("nothing to compare: the script left no states, no sensors and no files")
    names = [name for name in bare if name in other]
    changed = [
        name for name in names if not np.array_equal(bare[name], other[name], equal_nan=bare[name].dtype == float)
    ]
    return sorted({*bare} ^ {*other}) + changed


class Case(NamedTuple):
    """One view of an example: a run without our lines, one with them, and costs of all pairs."""

    name: str
    view: str
    bare: Outcome
    ours: Outcome
    ratio: float
    offline: float

    @property
    def equal(self) -> str:
        """Whether results are the same, in words."""
        changed = differences(self.bare.states, self.ours.states)
        count = len(self.bare.states)
        return f"{len(changed)} of {count} arrays differ" if changed else f"all {count} arrays equal"


def run_cases(name: str, example: Example, root: Path, folder: Path, pairs: int) -> list[Case]:
    """Run all views of an example, and the script without our lines, in turn."""
    script = root / example.file
    source = edited(name, script.read_text(encoding="utf-8"), (*example.repairs, *example.shorter))
    texts = {view: inserted(name, source, lines, example.before) for view, lines in example.lines.items()}
    rounds, begin = [], monotonic()
    while len(rounds) < pairs and (not rounds or monotonic() - begin < ENOUGH):
        place = folder / f"{name} {len(rounds)}"
        rounds.append({kind: ran(text, script, place / kind) for kind, text in {BARE: source, **texts}.items()})
    cases = []
    for view in texts:
        ratios, offline = np.median([cost(found[BARE], found[view]) for found in rounds], axis=0)
        cases.append(Case(name, view, rounds[0][BARE], rounds[0][view], float(ratios), float(offline)))
    return cases


def cost(bare: Outcome, ours: Outcome) -> tuple[float, float]:
    """Return the ratio of CPU times of the solves, offline work left out, and the seconds of that."""
    without, seconds = bare.told["seconds"]["solve"], ours.told["seconds"]
    steps = seconds["solve"] - seconds["begin"] + seconds["report"]
    return steps / max(without, 1e-9), seconds["attach"] + seconds["begin"]


def rounded(x: float) -> str:
    """Return two digits of a number, without an exponent where it has few zeros."""
    return f"{float(f'{x:.2g}'):.2g}" if x and not 1e-2 <= abs(x) < 1e4 else f"{float(f'{x:.2g}'):g}"


def shown(share: float) -> str:
    """Return a share in per cent, or how many times as large the bound is."""
    return f"{rounded(share)} times" if share > 10 else f"{rounded(100 * share)} %"


def rows(case: Case) -> list[list[str]]:
    """Return a row of the table for each output, or for each refusal."""
    told, example = case.ours.told, EXAMPLES[case.name]
    made = [row(case, scope=f"refused by {text}") for text in told["refusals"]]
    if told["failed"] != case.bare.told["failed"] or not (made or told["bodies"]):
        made.append(row(case, scope=f"script fails: {told['failed']}"))
    stopped = any("refused" in body for body in told["bodies"])  # a solve that was stopped costs little
    for i, body in enumerate(told["bodies"]):
        part = part_of(example, i, case.ours)
        if "refused" in body:
            made.append(row(case, scope=f"{part}refused by {body['refused']}"))
            continue
        for out in body["outputs"]:
            found = {
                "scope": body["scope"],
                "output": part + out["name"],
                "largest value": f"{rounded(out['value'])} {out['unit']}",
                "largest bound": f"{rounded(out['bound'])} {out['unit']}",
                "bound / value": shown(out["bound"] / out["value"]) if out["value"] else "value is zero",
                "CPU time": "" if stopped else f"{case.ratio:.1f} times",
                "before": "" if stopped else f"{rounded(case.offline)} s",
            }
            made.append(row(case, **found))
    return made


def part_of(example: Example, i: int, outcome: Outcome) -> str:
    """Return the name of a body, for its outputs, if the script has several in turn."""
    return f"{example.parts[i]}: " if len(example.parts) == len(outcome.told["bodies"]) else ""


def row(case: Case, **cells: str) -> list[str]:
    """Return a row of the table; cells that are not there are empty."""
    head = {"example": case.name, "lines": case.view, "results with and without": case.equal}
    return [{**head, **cells}.get(column, "") for column in COLUMNS]


COLUMNS = (
    "example|lines|scope|output|largest value|largest bound|bound / value|results with and without|CPU time|before"
).split("|")
TRUTH = (
    "example|run with|scope|output|largest value|error|estimate of the modes' part|off by|bound|bound / error|"
    "instants above the bound"
).split("|")
FROZEN = "scope='inputs frozen'"  # with all modes other bounds take long, and nobody asks for them
NEWTON = 1e-9  # of an output: what Newton's tolerance leaves is no error of the reduction


def truths(name: str, example: Example, root: Path, folder: Path) -> list[list[str]]:
    """Run the script with its modes and with many; return a row of errors and bounds for each output."""
    script, made = root / example.file, []
    for i, truth in enumerate(example.truth):
        source = edited(name, script.read_text(encoding="utf-8"), (*example.repairs, *example.shorter, *truth.both))
        place, quick = folder / f"{name} {i}", truth.lines.replace("outputs=", f"{FROZEN}, outputs=")
        coarse = ran(inserted(name, source, truth.lines, example.before), script, place / "coarse")
        fine = ran(inserted(name, edited(name, source, truth.more), quick, example.before), script, place / "fine")
        if coarse.series.keys() != fine.series.keys() or not coarse.series:
            raise RuntimeError(f"{truth.text}: outputs differ, or there are none: {coarse.told} {fine.told}")
        for key in (key for key in coarse.series if " value " in key):
            number, _, output = key.split(" ", 2)
            missed = fine.series[key] - coarse.series[key]
            error, estimate = np.abs(missed), coarse.series.get(f"{number} estimate {output}")
            bound, largest = coarse.series[f"{number} bound {output}"], np.max(np.abs(coarse.series[key]))
            above = int(np.sum(np.any(error > bound + NEWTON * largest, axis=1)))
            numbers = [rounded(x) for x in (largest, error.max())]
            numbers += ["", ""] if estimate is None else of_estimate(estimate, missed)
            numbers += [rounded(x) for x in (bound.max(), bound.max() / error.max())]
            scope, part = coarse.told["bodies"][int(number)]["scope"], part_of(example, int(number), coarse)
            made.append([name, truth.text, scope, part + output, *numbers, f"{above} of {len(error)}"])
    return made


def of_estimate(estimate: np.ndarray, missed: np.ndarray) -> list[str]:
    """Return the largest estimate, and what it is off by, of the largest error."""
    off = np.abs(estimate - missed).max() / np.abs(missed).max()
    return [rounded(np.abs(estimate).max()), f"{rounded(100 * off)} %"]


def printed(columns: list[str], made: list[list[str]], markdown: bool) -> None:
    """Print rows of a table, for a page or for the eye."""
    for cells in made:
        if markdown:
            print("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |", flush=True)
        else:
            print("; ".join(f"{name}: {cell}" for name, cell in zip(columns, cells, strict=True) if cell), flush=True)


def main(arguments: list[str] | None = None) -> list[list[str]]:
    """Run the examples, print and return the rows of the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("checkout", type=Path, help="work tree of Exudyn's repository")
    parser.add_argument("--only", nargs="+", choices=EXAMPLES, default=list(EXAMPLES), metavar="NAME")
    parser.add_argument("--pairs", type=int, default=3, help=f"at most; no more after {ENOUGH} s of an example")
    parser.add_argument("--truth", action="store_true")
    parser.add_argument("--markdown", action="store_true")
    options = parser.parse_args(arguments)
    root = options.checkout / ROOT
    if not root.is_dir():
        parser.error(f"{root} is not there; needed: a work tree of github.com/jgerstmayr/EXUDYN")
    columns, table = (TRUTH if options.truth else COLUMNS), []
    if options.markdown:
        printed(columns, [columns, ["---"] * len(columns)], True)
    with tempfile.TemporaryDirectory() as folder:
        for name in options.only:
            made = example_rows(name, root, Path(folder), options)
            printed(columns, made, options.markdown)
            table += made
    if not options.truth:
        print("\n" + noted(options.only))
    return table


def noted(names: list[str]) -> str:
    """Return the notes of examples as a paragraph, each note once."""
    notes: dict[str, list[str]] = {}
    for name in names:
        notes.setdefault(EXAMPLES[name].note, []).append(name)
    return textwrap.fill(" ".join(f"*{', '.join(of)}:* {note}." for note, of in notes.items() if note), 128)


def example_rows(name: str, root: Path, folder: Path, options: argparse.Namespace) -> list[list[str]]:
    """Return the rows of one example."""
    example = EXAMPLES[name]
    try:
        if options.truth:
            return truths(name, example, root, folder)
        cases = run_cases(name, example, root, folder, options.pairs)
    except (RuntimeError, subprocess.TimeoutExpired) as error:
        empty = [""] * (len(TRUTH if options.truth else COLUMNS) - 3)
        return [[name, "", f"not run: {error}", *empty]]  # the others still can be
    return [row for case in cases for row in rows(case)]


if __name__ == "__main__":
    main()
