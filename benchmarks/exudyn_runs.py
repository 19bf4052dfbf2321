"""Run Exudyn's own examples for exudyn_examples.py: with our lines and without, in turn, and with many more modes."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
# no windows; threads on small matrices only wait for one another
os.environ.update({"EXUDYN_SUPPRESS_UI_WINDOW_OPEN": "1", "MPLBACKEND": "Agg", "OPENBLAS_NUM_THREADS": "1"})

import numpy as np

from benchmarks import exudyn_recorder
from benchmarks.exudyn_patches import Example, edited, inserted

LIMIT = 1200  # s, for one script
ENOUGH = 30  # s, for one example: no further pairs after that
BARE = "without our lines"
# with all modes other bounds take long, and nobody asks for them
FROZEN = "scope='inputs frozen', estimators=['energy'], time='sampled'"


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
    """One view of an example, its script: a run without our lines, one with them, and costs of all pairs."""

    name: str
    view: str
    source: str
    bare: Outcome
    ours: Outcome
    ratio: float
    offline: float


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
    for view, text in texts.items():
        ratios, offline = np.median([cost(found[BARE], found[view]) for found in rounds], axis=0)
        cases.append(Case(name, view, text, rounds[0][BARE], rounds[0][view], float(ratios), float(offline)))
    return cases


def cost(bare: Outcome, ours: Outcome) -> tuple[float, float]:
    """Return the ratio of CPU times of the solves, offline work left out, and the seconds of that."""
    without, seconds = bare.told["seconds"]["solve"], ours.told["seconds"]
    steps = seconds["solve"] - seconds["begin"] + seconds["report"]
    return steps / max(without, 1e-9), seconds["attach"] + seconds["begin"]


class Comparison(NamedTuple):
    """A run of an example with our lines, and the same with so many more modes that it can be called the truth."""

    name: str
    truth: str
    coarse: Outcome
    fine: Outcome


def run_truths(name: str, example: Example, root: Path, folder: Path, cases: Sequence[Case] = ()) -> list[Comparison]:
    """Run the script with its modes and with many; RuntimeError where outputs are not the same, or none.

    cases : have run it with its modes already, where their lines are the same.
    """
    script, made = root / example.file, []
    known = {case.source: case.ours for case in cases}
    for i, truth in enumerate(example.truth):
        source = edited(name, script.read_text(encoding="utf-8"), (*example.repairs, *example.shorter, *truth.both))
        place, quick = folder / f"{name} {i}", truth.lines.replace("outputs=", f"{FROZEN}, outputs=")
        text = inserted(name, source, truth.lines, example.before)
        coarse = known[text] if text in known else ran(text, script, place / "coarse")
        fine = ran(inserted(name, edited(name, source, truth.more), quick, example.before), script, place / "fine")
        if {key for key in coarse.series if " value " in key} ^ {key for key in fine.series if " value " in key}:
            raise RuntimeError(f"{truth.text}: outputs differ: {coarse.told} {fine.told}")
        if not coarse.series:
            raise RuntimeError(f"{truth.text}: no outputs: {coarse.told} {fine.told}")
        made.append(Comparison(name, truth.text, coarse, fine))
    return made
