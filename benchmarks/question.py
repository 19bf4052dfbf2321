"""Is this displacement right within x? Three ways to an answer, each with its run time and the true error.

With bounds: n modes; claims the bound, which is proven for what its scope names. Compared: two runs without bounds,
today's habit; claims their difference, of the larger run. That proves nothing: it cannot see what both runs lack, nor
the time steps they have in common. Full order: claims nothing of its time steps.

Beside each claim stands the true error. Wall time is everything from the FE matrices to the answer: modes, offline
work, runs. Linkage: the total error, against the closed form. Connecting rod and wishbone: reduction errors, against
a run with the same time steps and all modes (rod) or 50 modes (wishbone: all 3363 are not affordable).

    python benchmarks/question.py [FOLDER]         two minutes; writes FOLDER/speed_question.png (examples/results)
    python benchmarks/question.py --quick          short runs, to see that it works; 20 s
    python benchmarks/question.py --docs           the table into docs/measured.md, the picture into docs/figures
    python benchmarks/question.py --full-order     how long one step of Exudyn's ObjectFFRF of the arm takes
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path
from time import perf_counter, process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import exudyn as exu
import numpy as np
from exudyn.FEM import ObjectFFRFinterface

from benchmarks import page, pairs
from benchmarks.question_figure import draw
from benchmarks.question_scenes import Answer, Question, Run, Setting, Table, ball_joint, rod, tip
from models import floating, wishbone

RESULTS = Path(__file__).resolve().parents[1] / "examples" / "results"
LONG = 3.0  # s: such runs are not repeated
PATIENCE = 100.0  # s, for one step of the full-order arm


def timed(question: Question, setting: Setting, bounds: bool) -> tuple[np.ndarray, Run]:
    """Return wall and CPU time in s, medians of repeats, and the run."""
    seconds = []
    for _ in range(question.repeats):
        begin = np.array([perf_counter(), process_time()])
        found = question.run(*setting, bounds)
        seconds.append([perf_counter(), process_time()] - begin)
        if seconds[-1][0] > LONG:
            break
    return np.median(seconds, axis=0), found


def answered(question: Question) -> Table:
    """Try all ways. A run that several comparisons share is made once, and counted in each."""
    bare = {x: timed(question, x, False) for x in dict.fromkeys([*sum(question.compared, ()), *question.full])}
    bounded = {x: timed(question, x, True) for x in question.bounded}
    truths = {}

    def error(run: Run) -> float:
        steps = len(run.t)
        if steps not in truths:
            truths[steps] = question.truth(run)
        return float(np.max(np.abs(run.y - truths[steps])))

    answers = [
        Answer("with bounds", label(question, x), *s, run.bound, error(run)) for x, (s, run) in bounded.items()
    ]
    for few, more in question.compared:
        difference = float(np.max(np.abs(bare[few][1].y - bare[more][1].y)))
        names = f"{few[0]} and {label(question, more)}"
        answers.append(Answer("compared", names, *(bare[few][0] + bare[more][0]), difference, error(bare[more][1])))
    is_truth = "the truth" in question.full_label
    for x in question.full:
        found = None if is_truth else error(bare[x][1])
        answers.append(Answer("full order", f"{question.full_label}, {1e3 * x[1]:g} ms", *bare[x][0], None, found))
    largest = float(max(np.max(np.abs(truth)) for truth in truths.values()))
    return Table(question, question.share * largest, largest, answers)


def label(question: Question, setting: Setting) -> str:
    """Return the setting in words."""
    return f"{setting[0]} {question.columns}, {1e3 * setting[1]:g} ms"


def text(tables: list[Table]) -> str:
    """Return one table of all questions."""
    lines = []
    for table in tables:
        question = table.question
        asked = f"within {100 * question.share:g} % = {table.within:.2g} m? ({question.covers})"
        heads = f"{'wall s':>8}{'CPU s':>8}{'claims / m':>12}{'true / m':>12}{'claim / true':>14}  verdict"
        lines += ["", f"{question.title}: {asked}", f"{'':<49}{heads}"]
        lines += [_line(answer, table.within) for answer in table.answers]
    return "\n".join(lines[1:])


def _line(answer: Answer, within: float) -> str:
    way, settings, seconds, cpu, *errors = answer
    claim, error = (f"{x:.2e}" if x is not None else "-" for x in errors)
    ratio = f"{answer.claim / answer.error:.2g}" if answer.claim is not None and answer.error else "-"
    head = f"{way:<13}{settings:<36}{seconds:8.2f}{cpu:8.2f}{claim:>12}{error:>12}{ratio:>14}"
    return f"{head}  {verdict(answer, within)}"


def verdict(answer: Answer, within: float) -> str:
    """Return what the way answers, and whether that is right."""
    if answer.error is None:
        return "claims nothing"
    true = answer.error <= within
    if answer.claim is None:
        return f"claims nothing; {_is(true)}"
    said = answer.claim <= within
    if answer.way == "with bounds" and answer.claim < answer.error:
        return "BOUND TOO LOW"
    return f"says {'yes' if said else 'no'}; {_is(true)}" + (": WRONG" if said and not true else "")


def _is(true: bool) -> str:
    return f"it is{'' if true else ' not'}"


def arm_alone() -> None:
    """Make one step of the wishbone's arm alone, full order: Exudyn's ObjectFFRF, no joints, turning freely."""
    fem = wishbone.load_fem()
    fem.modeBasis = {"matrix": np.zeros((0, 0)), "type": "NormalModes"}
    mbs = exu.SystemContainer().AddSystem()
    ObjectFFRFinterface(fem).AddObjectFFRF(exu, mbs, initialAngularVelocity=[0, 0, 1.0])
    mbs.Assemble()
    settings = floating.solver_settings(5e-4, 5e-4)
    settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    mbs.SolveDynamic(settings)


def full_order(patience: float = PATIENCE) -> str:
    """Return how long one full-order step takes, without joints: Exudyn refuses their markers on an ObjectFFRF."""
    begin = perf_counter()
    try:
        subprocess.run([sys.executable, __file__, "--arm-alone"], check=True, timeout=patience, capture_output=True)
        seconds = perf_counter() - begin
        return (
            f"one step of the arm alone, 3369 coordinates: {seconds:.0f} s; 400 steps: {400 * seconds / 3600:.1f} h"
        )
    except subprocess.TimeoutExpired:
        hours = 400 * patience / 3600
        return f"one step of the arm alone, 3369 coordinates: over {patience:g} s; 400 steps: over {hours:.0f} h"


def main(arguments: list[str] | None = None) -> list[Table]:
    """Ask all questions; print the table, save the picture."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", nargs="?", type=Path, default=RESULTS)
    parser.add_argument("--quick", action="store_true", help="short runs")
    parser.add_argument("--docs", action="store_true", help="write docs/measured.md and its picture")
    parser.add_argument("--only", choices=("tip", "rod", "ball joint"), nargs="+", help="some questions")
    parser.add_argument("--full-order", action="store_true", help="time a full-order step of the arm instead")
    parser.add_argument("--arm-alone", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.docs and (options.quick or options.only):
        parser.error("--docs wants all questions in full: leave out --quick and --only")
    if options.arm_alone:
        return arm_alone() or []
    if options.full_order:
        print(full_order())
        return []
    scenes = {"tip": (tip, 2.0, 0.02), "rod": (rod, 0.06, 0.0025), "ball joint": (ball_joint, 0.2, 0.002)}
    chosen = [scenes[name] for name in options.only or scenes]
    tables = [answered(make(short if options.quick else end)) for make, end, short in chosen]
    print(pairs.threads())
    print(text(tables))
    draw(tables, (page.FIGURES if options.docs else options.folder) / "speed_question.png")
    if options.docs:
        page.put("question", text(tables))
    return tables


if __name__ == "__main__":
    main()
