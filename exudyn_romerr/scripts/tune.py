"""romerr tune: the cheapest number of modes and step of a script that meet a tolerance, found with few runs."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline

from .._version import __version__
from ..checks import check_choice
from ..errors import RunError
from ..mode_selection.pairs import Expected, Pair, PairRun, PairSearch, order_of
from ..mode_selection.search import cheapest, search
from ..report.answers import SHARE, Answer, Limit, Tolerances, tolerances_of
from ..report.verdict_text import TITLES, aligned
from ..report.verdicts import CAUSES
from ..report.wording import digits, rounded_up
from .child_run import Request, Result, run_child
from .execute import check_script
from .files import Answered

if TYPE_CHECKING:
    from ..report.verdicts import Row

RUNS = 6  # at most, the script's own one with them
FURTHER = 8  # modes beyond those of a run, of which it forecasts errors
ONLY = ("modes", "step")
STRIDES = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
TIMES = (1 / 8, 1 / 4, 1 / 2, 1, 2, 4, 8)  # the tolerance: what else a run time buys
NO_CALL = "no call of the script's that makes modes of its bodies has a number to vary: the step alone is looked at"
NO_STEP = "no dynamic solve with fixed steps: modes alone are looked at"
STILL = "not looked at, for they show 0 throughout: {}"
CURES = {
    "modes": "too few modes, or too few kinds of them",
    "interfaces": "rigid interfaces alone, which no number of modes and no step cures: RBE3 modes do",
    "step": "the step, or what it leaves unresolved",
    "start": "a sudden start: let loads begin smoothly",
}


@dataclass
class Tuning(Answered):
    """What `tune` found; print it.

    Attributes
    ----------
    runs : that were made, the script's own one first
    calls : of the script that make modes: file, line, call, argument, number
    failed : what ended the search early, ""; notes : what else is to be said
    """

    script: str
    tolerances: Tolerances
    runs: list[PairRun]
    calls: list[dict[str, Any]]
    logic: PairSearch
    failed: str = ""
    misspelt: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def found(self) -> PairRun | None:
        """The cheapest run that is enough; None: none is."""
        return cheapest(self.runs)

    @property
    def closest(self) -> PairRun:
        """What was found, or the run whose largest error is the least beside its tolerance."""
        return self.found or min(self.runs, key=lambda run: run.worst.ratio if run.rows else float("inf"))

    @property
    def answer(self) -> Answer:
        """That of the run found, or of the closest."""
        return self.closest.answer

    _overall = answer

    @property
    def all_seconds(self) -> float:
        """CPU time of all runs, and of what was told of them."""
        return sum(run.all_seconds for run in self.runs)

    @cached_property
    def table(self) -> list[dict[str, Any]]:
        """A dict for each run, and each forecast of what other tolerances need, the fastest first."""
        found = [self._line(run.pair, run.worst, run.seconds, run.answer) for run in self.runs if run.rows]
        found += [
            self._line(pair, self._base.expected(pair, order_of(self.runs)), self.logic.seconds(pair, self.runs))
            for pair in self._forecasts()
        ]
        return sorted(found, key=lambda line: line["cpu_s"])

    @property
    def _base(self) -> PairRun:
        """The run that forecasts others: that with what was found, else the last."""
        return self.found or self.runs[-1]

    def _forecasts(self) -> list[Pair]:
        """The cheapest pair for each of several tolerances that was not run."""
        if not self._base.is_covered:
            return []
        fronts = [self.logic.front(self.runs, self._base, times) for times in TIMES]
        pairs = [self.logic.cheapest(x, self.runs) for x in fronts if x]
        return [pair for pair in dict.fromkeys(pairs) if all(pair != run.pair for run in self.runs)]

    def _line(self, pair: Pair, of: Expected, seconds: float, answer: Answer | None = None) -> dict[str, Any]:
        row = of.row
        return {
            "numbers": [*pair.numbers],
            "steps": pair.steps,
            "cpu_s": seconds,
            "how": "forecast" if answer is None else "run",
            "answer": answer and answer.value,
            **{name: getattr(row, name) for name in ("name", "solve", "unit", "tolerance")},
            "axis": row.axis or None,
            **{cause: _finite(of.of.get(cause)) for cause in (*CAUSES, "sum")},
            "ratio": _finite(of.ratio),
            "is_found": self.found is not None and pair == self.found.pair,
        }

    def as_json(self) -> dict[str, Any]:
        """Return what --json writes: sizes with half widths, in the sensors' units; ratio : to the tolerance."""
        found = self.found and {"numbers": [*self.found.pair.numbers], "steps": self.found.pair.steps}
        known = {"answer": self.answer.value, "found": found, "table": self.table, "calls": self.calls}
        said = {"misspelt": self.misspelt, "notes": self.notes, "failed": self.failed or None}
        return {"script": self.script, **known, **said, "cpu_s": self.all_seconds, "version": __version__}

    def plot(self, path: str | os.PathLike) -> Any:
        """Draw errors beside their tolerances against CPU time, the pair found marked; return the figure."""
        from ..report.plots.comparisons import plot_pairs

        return plot_pairs(self.table, path, f"{os.path.basename(self.script)}: error against run time")

    def __str__(self) -> str:
        lines = [*self.misspelt, self._said(), *self._to_write(), *self.notes]
        lines += [f"not tried further, for a run failed: {self.failed}"] if self.failed else []
        assumed = [] if self.tolerances.is_given else [f"{100 * SHARE:g} % assumed; --tolerance X"]
        return "\n".join([*lines, *assumed, "", *self._printed_table()])

    def _said(self) -> str:
        own, best, closest = self.runs[0], self.found, self.closest
        answer, measured = closest.answer.value.capitalize(), f"romerr verify {self.script} measures"
        if best is own:
            return f"Enough: {self._named(own)}, as the script has it; no pair that is cheaper is expected to be."
        if best is not None:
            times = best.seconds / own.seconds
            share = f"{times:.2g} times the CPU time" if times > 1 else f"{100 * times:.0f} % of the CPU time"
            return (
                f"Enough, by its run: {self._named(best)}; the script has {self._named(own)}: {own.answer.value}. "
                f"Solves take {share}."
            )
        if not closest.is_covered:
            why = next((why for row in closest.rows if (why := row.of["sum"].reason)), "there is no sensor to judge")
            return f"{answer}: {why}; {measured} the error."
        worst = closest.worst
        cause = max((c for c in CAUSES if c in worst.of), key=lambda c: worst.of[c])
        return (
            f"{answer}: no pair was found that is enough. Closest: {self._named(closest)}; what is left at "
            f"{worst.row.name} is mostly {CURES[cause]}. {measured} it."
        )

    def _named(self, run: PairRun) -> str:
        numbers = run.counts(run.pair.numbers)
        modes = "1 mode" if numbers == "1" else f"{numbers} modes"
        return f"{numbers and f'{modes} and '}{run.pair.steps} steps"

    def _to_write(self) -> list[str]:
        """Lines for the script."""
        best, own = self.found, self.runs[0]
        if best is None or best is own:
            return []
        lines = [
            f"  {call['file']}, line {call['line']}: {call['call']}(..., {call['argument']}={n})  # {call['number']}"
            for call, n in zip(self.calls, best.pair.numbers, strict=True)
            if n != call["number"]
        ]
        steps = best.pair.steps
        changed = f"  simulationSettings.timeIntegration.numberOfSteps = {steps}  # {own.pair.steps}"
        return lines + [changed] * (steps != own.pair.steps)

    def _printed_table(self) -> list[str]:
        causes = [cause for cause in CAUSES if any(line[cause] is not None for line in self.table)]
        sizes = [f"{TITLES[cause]} about" for cause in causes]
        lines = [("modes", "steps", "CPU s", *sizes, "whole about", "of its tolerance", "at", "how")]
        for line in self.table:
            counts = self.runs[0].counts(line["numbers"]) or "-"
            sizes = ("not known" if line[x] is None else rounded_up(line[x], 2) for x in (*causes, "sum"))
            ratio = "not known" if line["ratio"] is None else f"{digits(100 * line['ratio'], 2)} %"
            at = f"{line['name']} {line['axis'] or ''}".rstrip()
            how = f"run: {line['answer']}{', found' * line['is_found']}" if line["answer"] else "forecast"
            lines.append((counts, str(line["steps"]), digits(line["cpu_s"], 2), *sizes, ratio, at, how))
        return aligned(lines) if self.table else []


def _finite(x: float | None) -> float | None:
    return x if x is not None and x < float("inf") else None


def tune(
    script: str | os.PathLike,
    arguments: Sequence[str] = (),
    *,
    tolerance: Sequence[str] | str | float | None = None,
    only: str | None = None,
    timeout: float | None = None,
    progress: Callable[[str], None] | None = None,
) -> Tuning:
    """Find the cheapest number of modes and step of a script that meet a tolerance, in at most six runs.

    Each run, in a process of its own, is watched as by romerr.run. What its modes leave is shared among further
    modes, or fewer, and errors of steps fall with their order: both forecast other pairs. A pair counts once its own
    run, watched, says that it is enough. Steps stay so short that a cubic curve through what sensors show at them is
    within the tolerance of what the script's own run shows between them.

    Parameters
    ----------
    script, arguments, tolerance : as of romerr.run
    only : "modes" or "step", optional
        What may vary.
    timeout : float, optional
        s, for each run.
    progress : function(text), optional
        Is told what is done.

    Returns
    -------
    Tuning
        print() it; .table, .found, .plot(path), .save(path).

    Raises
    ------
    InputError
        No such script; a tolerance that is none; an unknown `only`.
    RunError
        The script's own run failed.

    Notes
    -----
    Does not cover: what estimates of romerr.run do not; bodies added with other modes than their call has made.
    """
    tolerances, path = tolerances_of(tolerance), os.path.abspath(check_script(script))
    if only is not None:
        check_choice("only", only, ONLY)
    texts = tuple(str(x) for x in ([tolerance] if isinstance(tolerance, str | float | int) else tolerance or ()))
    further = 0 if only == "step" else FURTHER
    plain = Request(
        "tune", path, os.getcwd(), tuple(arguments), watch=True, further=further, tolerance=texts, timeout=timeout
    )
    runs = _Runs(plain, progress or (lambda said: None))
    first = runs.first()
    rows = runs.own.facts["rows"]
    varies_modes, varies_steps = only != "step" and bool(first.most), only != "modes" and runs.is_fixed
    notes = [NO_CALL] * (only != "step" and not first.most and first.is_covered)
    notes += [NO_STEP] * (only != "modes" and not runs.is_fixed)
    still = dict.fromkeys(row.name for row in rows if row.shows_nothing)
    notes += [STILL.format(", ".join(still))] if still else []
    static = sum(runs.own.facts["modes"]) - sum(first.pair.numbers)
    logic = PairSearch(
        varies_modes, varies_steps, max(static, 1), first.pair.steps / _most_apart(runs.own, first.rows)
    )
    tried, failed = search(lambda pair: first if pair is None else runs.made(pair), [None], logic.wanted, RUNS)
    wrong = tolerances.misspelt(row.name for row in rows)
    said = f"{failed[0].numbers} modes, {failed[0].steps} steps: {failed[1]}" if failed else ""
    calls = runs.own.facts["calls"]
    return Tuning(os.fspath(script), tolerances, tried, calls, logic, said, wrong, notes)


def _most_apart(own: Result, rows: Sequence[Row]) -> int:
    """How many times the step may be, if a curve through values at steps is to show those between them."""
    limits = {(row.solve, row.name): row.tolerance for row in rows if row.tolerance}
    most = STRIDES[-1]
    for (i, name), limit in limits.items():
        solve = own.solves[own.with_bodies[i]]
        if solve["kind"] == "dynamic" and name in solve["names"]:
            data = solve["data"][solve["names"].index(name)]
            most = min(most, _strides_shown(data[:, 0], data[:, 1:], limit))
    return most


def _strides_shown(t: np.ndarray, y: np.ndarray, limit: float) -> int:
    shown = 1
    for stride in STRIDES:
        at = [*range(0, len(t) - 1, stride), len(t) - 1]
        if len(at) < 4 or np.abs(CubicSpline(t[at], y[at])(t) - y).max() > limit:
            return shown
        shown = stride
    return shown


class _Runs:
    """Runs of a script with other pairs. own : the script's result."""

    def __init__(self, plain: Request, tell: Callable[[str], None]):
        self._plain, self._tell = plain, tell
        self.own: Result | None = None

    def first(self) -> PairRun:
        """Run the script as it is."""
        self.own = run_child(self._plain)
        if self.own.failure or not self.own.solves:
            raise RunError(
                f"the script's own run has nothing to judge: {self.own.failure or 'no solve of a mechanism'}"
            )
        numbers = tuple(call["number"] for call in self.own.facts["calls"])
        return self._read(self.own, Pair(numbers, self.steps))

    def made(self, pair: Pair) -> PairRun:
        """Run it with a pair."""
        result = run_child(replace(self._plain, numbers=pair.numbers, steps=pair.steps / self.steps))
        if result.failure or result.facts["status"] != self.own.facts["status"]:
            raise RunError(result.failure or result.facts["error"] or f"it ended with {result.facts['status']}")
        return self._read(result, pair)

    def _read(self, result: Result, pair: Pair) -> PairRun:
        facts = result.facts
        seconds = max(facts["solve_seconds"] - facts["our_seconds"], 1e-3)
        rows = [row for row in facts["rows"] if row.answer is not Answer.NO_TOLERANCE and not row.shows_nothing]
        # where nothing was read there is none
        rows = [row if row.tolerance else replace(row, limit=Limit(1.0, row.limit.is_asked)) for row in rows]
        found = PairRun(pair, rows, result.contents, seconds, result.seconds)
        said = found.answer.value if rows else "nothing to judge"
        modes = found.counts(pair.numbers) or "own"
        self._tell(f"{modes} modes, {pair.steps} steps: {said}, {seconds:.2g} s of CPU time in solves")
        return found

    @property
    def steps(self) -> int:
        """Of the first dynamic solve."""
        return next((int(x["count"]) for x in self.own.solves if x["kind"] == "dynamic"), 1)

    @property
    def is_fixed(self) -> bool:
        """Whether there are steps to vary."""
        of = [x for x in self.own.solves if x["kind"] == "dynamic"]
        return bool(of) and all(x["fixed"] for x in of)
