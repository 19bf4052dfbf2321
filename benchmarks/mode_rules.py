"""How good are habits for choosing the number of modes? Rules judged on bodies whose exact response is known.

    python benchmarks/mode_rules.py [--docs] [--bodies 6]

Asked of every rule: so few eigenmodes that the largest error of an output is 1 % of its largest value. A number is
one output of one load of one body. "enough": numbers within 1 %. "modes": eigenmodes that the rule takes; "too many":
more than the fewest that are enough. "off by": errors that are not enough, over the largest value. "runs": reduced
runs that the rule needs before it is done. A rule that names no number in a case counts as not enough there.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn_romerr as romerr
from benchmarks import page
from benchmarks.mode_rule_cases import MOST, Case, Reduced, bodies, cases
from benchmarks.mode_rules_figure import draw

ALLOWED = 0.01
DOUBLED = (1, 2, 4, 8, 16, 32)
SIZES = (8, 14, 22)  # columns of bases that are compared
BAND = 20  # times the lowest frequency: of Gramian bases, which hold no more directions than respond in it
VECTORS = 40  # auxiliary modes of the bound
PAGE = page.ROOT / "docs" / "mode_rules.md"


class Family:
    """Bases of one kind with 0 .. MOST eigenmodes, and the errors that they make in a case; made once."""

    def __init__(self, case: Case, vectors: Callable[[int], np.ndarray], frequencies: np.ndarray):
        self.case, self.vectors, self.frequencies = case, vectors, frequencies
        self._reduced: dict[int, Reduced] = {}
        self._errors: dict[int, dict[str, float]] = {}

    def reduced(self, n: int) -> Reduced:
        """With n eigenmodes."""
        if n not in self._reduced:
            self._reduced[n] = self.case.held.reduced(self.vectors(n))
        return self._reduced[n]

    def errors(self, n: int) -> dict[str, float]:
        """Of outputs, with n eigenmodes."""
        if n not in self._errors:
            self._errors[n] = self.case.errors(self.reduced(n))
        return self._errors[n]

    def fewest(self, output: str) -> int | None:
        """So many eigenmodes are enough; None: MOST are not."""
        return next((n for n in range(MOST + 1) if self.errors(n)[output] <= ALLOWED), None)


def craig_bampton(case: Case) -> Family:
    """Exudyn's, with RBE3 interfaces: 6 static modes beside the eigenmodes."""
    held = case.held
    return Family(case, lambda n: held.craig_bampton[:, : 6 + n], held.fixed_frequencies)


def eigenmodes(case: Case) -> Family:
    """Eigenmodes of the held body."""
    held = case.held
    return Family(case, lambda n: held.modes[:, : max(n, 1)], held.omega[:MOST])


def with_attachment(case: Case) -> Family:
    """The same with the static shape under the load."""
    held = case.held
    static = held.modes @ ((held.modes.T @ held.loads[case.load]) / held.omega**2)
    return Family(case, lambda n: np.column_stack([static, held.modes[:, :n]]), held.omega[:MOST])


class Choice(NamedTuple):
    """What a rule says: a number of eigenmodes, None: it names none; reduced runs that it needed."""

    n: int | None
    runs: int = 0


def cut_off(times: float) -> Callable[[Family], Choice]:
    """All eigenmodes below so many times the load's highest frequency; it has none where loads are sudden."""

    def rule(of: Family) -> Choice:
        limit = times * of.case.highest
        return Choice(None if np.isinf(limit) else int(np.sum(of.frequencies < limit)))

    return rule


def effective_mass(share: float) -> Callable[[Family], Choice]:
    """So many held eigenmodes that they have that share of the effective mass along z."""

    def rule(of: Family) -> Choice:
        held = of.case.held
        masses = (held.modes.T @ held.loads["shaken"]) ** 2
        reached = np.flatnonzero(np.cumsum(masses) >= share * masses.sum())
        return Choice(int(reached[0]) + 1 if reached[0] < MOST else None)

    return rule


def doubling(of: Family) -> Choice:
    """Twice as many until no output changes by more than is allowed; the last number counts."""
    before = of.case.shown(of.reduced(DOUBLED[0]))
    for runs, n in enumerate(DOUBLED[1:], 2):
        now = of.case.shown(of.reduced(n))
        if all(np.abs(now[x] - before[x]).max() <= ALLOWED * np.abs(now[x]).max() for x in now):
            return Choice(n, runs)
        before = now
    return Choice(None, len(DOUBLED))


def frequencies_right(of: Family) -> Choice:
    """So many that no frequency below the load's highest one is off by more than is allowed.

    True frequencies are known here: no estimator of eigenvalues, such as Kim and Lee's (2014), can do better.
    """
    true = of.case.held.omega[of.case.held.omega < of.case.highest]
    if np.isinf(of.case.highest):
        return Choice(None)
    for n in range(MOST + 1):
        found = of.reduced(n).omega[: len(true)]
        if len(found) == len(true) and np.all(np.abs(found / true - 1) <= ALLOWED):
            return Choice(n)
    return Choice(None)


def bounded(of: Family) -> Choice:
    """The fewest whose bound, of this package, is within what is allowed: doubled, then halved in between."""
    tried: dict[int, bool] = {}

    def is_enough(n: int) -> bool:
        if n not in tried:
            tried[n] = largest_bound(of.case, of.reduced(n)) <= ALLOWED
        return tried[n]

    high = next((n for n in DOUBLED if is_enough(n)), None)
    if high is None:
        return Choice(None, len(tried))
    low = high // 2
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_enough(middle) else (middle, high)
    return Choice(high, len(tried))


def largest_bound(case: Case, reduced: Reduced) -> float:
    """The largest bound over the largest value that the reduced body itself shows, of all outputs."""
    held, force = case.held, case.force
    q, q_t = case.motion(reduced), case.motion(reduced, 1)
    alpha, beta = held.rayleigh
    q_tt = np.outer(force, case.gains(reduced)) - (alpha + beta * reduced.omega**2) * q_t - reduced.omega**2 * q
    outputs = [romerr.Output(name, row) for name, row in held.outputs.items()]
    report = romerr.evaluate(
        held.body,
        romerr.Basis(held.modes @ reduced.shapes),
        romerr.Trajectory(case.t, q, q_t, q_tt, force),
        inputs=held.loads[case.load][:, None],
        outputs=outputs,
        estimators=("auxiliary",),
        time="sampled",
        auxiliary_modes=min(VECTORS, held.body.free.size),
    )
    shares = (np.max(out.bound["best"]) / np.abs(out.value).max() for out in report.outputs.values())
    return float(max(shares))


RULES = {  # name: kind of bases, rule
    "Craig-Bampton: 1.5 x highest frequency": (craig_bampton, cut_off(1.5)),
    "Craig-Bampton: 2 x highest frequency": (craig_bampton, cut_off(2.0)),
    "Craig-Bampton: 4 x highest frequency": (craig_bampton, cut_off(4.0)),
    "Craig-Bampton: frequencies right to 1 %": (craig_bampton, frequencies_right),
    "Craig-Bampton: doubled until 1 %": (craig_bampton, doubling),
    "Craig-Bampton: bound within 1 %": (craig_bampton, bounded),
    "eigenmodes: 1.5 x highest frequency": (eigenmodes, cut_off(1.5)),
    "eigenmodes: 2 x highest frequency": (eigenmodes, cut_off(2.0)),
    "eigenmodes: 90 % effective mass": (eigenmodes, effective_mass(0.90)),
    "eigenmodes: 95 % effective mass": (eigenmodes, effective_mass(0.95)),
    "eigenmodes: doubled until 1 %": (eigenmodes, doubling),
    "eigenmodes: bound within 1 %": (eigenmodes, bounded),
    "with attachment: 1.5 x highest frequency": (with_attachment, cut_off(1.5)),
    "with attachment: bound within 1 %": (with_attachment, bounded),
}


class Number(NamedTuple):
    """One output of one case under one rule; n, fewest : None, there is none. error : over the largest value."""

    n: int | None
    fewest: int | None
    error: float
    runs: int


def judged(families: dict[Callable, Family]) -> Iterator[tuple[str, Number]]:
    """Yield the rule's name and what it makes of every output of a case."""
    for name, (kind, rule) in RULES.items():
        of = families[kind]
        n, runs = rule(of)
        for output in of.case.held.outputs:
            error = np.inf if n is None else of.errors(min(n, MOST))[output]
            yield name, Number(n, of.fewest(output), error, runs)


def line_of(name: str, numbers: list[Number]) -> str:
    """Return the line of a rule."""
    named = [one for one in numbers if one.n is not None]
    wrong = [100 * one.error for one in named if one.error > ALLOWED]
    many = [one.n - one.fewest for one in named if one.fewest is not None and one.error <= ALLOWED]
    enough = np.mean([one.error <= ALLOWED for one in numbers])
    off = f"{np.median(wrong):9.2g} %{np.max(wrong):9.2g} %" if wrong else f"{'':22}"
    modes = f"{np.median([one.n for one in named]):7.0f}{np.median(many) if many else np.nan:10.0f}"
    none = sum(one.n is None for one in numbers)
    return f"{name:<42}{enough:7.0%}{modes}{off}{np.mean([one.runs for one in numbers]):7.1f}{none:9d}"


HEAD = f"{'':<42}{'enough':>7}{'modes':>7}{'too many':>10}{'off by':>11}{'worst':>11}{'runs':>7}{'no number':>10}"


def bases_of_size(case: Case, size: int) -> dict[str, np.ndarray]:
    """Return bases of so many columns, by kind."""
    held, load = case.held, case.held.loads[case.load][:, None]
    return {
        "Craig-Bampton": held.craig_bampton[:, :size],
        "eigenmodes": held.modes[:, :size],
        "with attachment": with_attachment(case).vectors(size - 1),
        "Krylov": romerr.krylov_basis(held.body, load, size).V,
        "Gramian": gramian(held.body, load, size, (0.0, BAND * held.omega[0])),
    }


def gramian(body: romerr.ElasticBody, load: np.ndarray, size: int, band: tuple[float, float]) -> np.ndarray:
    """Return the basis of so many columns, or of as many as respond in the band."""
    for n in range(size, 1, -1):
        with suppress(romerr.InputError):  # fewer directions respond
            return romerr.gramian_basis(body, load, n, band).V
    return romerr.gramian_basis(body, load, 1, band).V


def size_lines(errors: dict[str, dict[int, list[float]]]) -> list[str]:
    """Return head and a line for each kind of bases: share of numbers within what is allowed, by size."""
    lines = [f"{'enough, of bases with so many columns':<42}" + "".join(f"{size:9d}" for size in SIZES)]
    for kind, of in errors.items():
        lines.append(f"{kind:<42}" + "".join(f"{np.mean(np.array(of[size]) <= ALLOWED):9.0%}" for size in SIZES))
    return lines


def rigid_line(errors: dict[str, list[float]]) -> str:
    """Return what rigid interfaces leave wrong with MOST eigenmodes, in words."""
    said = [
        f"{name} {100 * np.median(x):.2g} % in the median, {100 * np.max(x):.2g} % at worst"
        for name, x in errors.items()
    ]
    return f"rigid (RBE2) interfaces, {MOST} eigenmodes: {'; '.join(said)}"


def measured(count: int) -> tuple[str, dict[str, list[Number]]]:
    """Judge all rules on so many bodies; return the table, and all numbers by rule."""
    numbers: dict[str, list[Number]] = {name: [] for name in RULES}
    sizes: dict[str, dict[int, list[float]]] = {}
    rigid: dict[str, list[float]] = {}
    for held in islice(bodies(), count):
        of_rigid = held.reduced(held.hurty_craig_bampton("RBE2"))
        for case in cases(held):
            families = {kind: kind(case) for kind, _ in RULES.values()}
            for name, number in judged(families):
                numbers[name].append(number)
            for size in SIZES:
                for kind, V in bases_of_size(case, size).items():
                    found = case.errors(held.reduced(V)).values()
                    sizes.setdefault(kind, {}).setdefault(size, []).extend(found)
            for output, error in case.errors(of_rigid).items():
                rigid.setdefault(output, []).append(error)
            print(case.name, file=sys.stderr, flush=True)
    total = f"{len(next(iter(numbers.values())))} numbers"
    lines = [f"{total:<42}{HEAD[42:]}", *(line_of(*one) for one in numbers.items()), "", *size_lines(sizes)]
    return "\n".join([*lines, "", rigid_line(rigid)]), numbers


def main(arguments: list[str] | None = None) -> None:
    """Print the table; --docs: write it, and the picture, into docs/mode_rules.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, default=6, help="the first so many only")
    parser.add_argument("--docs", action="store_true", help=f"write {PAGE.name} and its picture")
    given = parser.parse_args(arguments)
    table, numbers = measured(given.bodies)
    print(table)
    if given.docs:
        page.put("mode rules", table, PAGE)
        draw(
            {name: [one.error for one in of] for name, of in numbers.items()},
            ALLOWED,
            page.FIGURES / "mode_rules.png",
        )


if __name__ == "__main__":
    main()
