"""What bounds cost, in one table: run time of every scene with and without them, growth, offline work, and promises.

    python benchmarks/speed.py             everything, under 6 min on a quiet machine; needs ngsolve for large meshes
    python benchmarks/speed.py --exudyn CHECKOUT     short runs of Exudyn's own examples, too: see short_runs.py
    python benchmarks/speed.py --quick     20 s, one pair: to see that it works
    python benchmarks/speed.py --large     N up to 3e5, Craig-Bampton at 45,000 coordinates: many minutes, 8 GB
    python benchmarks/speed.py --only ratios offline          some parts
    python benchmarks/speed.py --docs      writes the ratios into docs/measured.md, and docs/figures/speed.png

Parts are the scripts online_linkage.py, floating_cost.py, short_runs.py, growth.py, offline.py and kernel_offline.py,
which run alone as well. Ratios are of CPU time, paired runs in turn: see pairs.py. In runs of --quick what begins a
solve weighs more: their verdicts mean nothing.
"""

import argparse
import importlib.util
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import numpy as np

from benchmarks import (
    floating_cost,
    growth,
    kernel_offline,
    offline,
    online_linkage,
    page,
    pairs,
    short_runs,
)
from benchmarks.speed_figure import draw
from examples.fundamental_matrix_norms import build_times, exponential_seconds

PARTS = ("ratios", "growth", "offline", "promises")
WIDE = 62  # of the first column
MESHES = (1000, 10_000)  # coordinates of the floating body whose online cost is compared; --large: 45,000


class Scene(NamedTuple):
    """A scene of the table; steps, and pairs of runs, in full and with --quick."""

    title: str
    make: Callable[[int], list[pairs.Variant]]
    steps: tuple[int, int]
    rounds: tuple[int, int]


def _linkage(steps: int) -> list[pairs.Variant]:
    return [kind(steps * online_linkage.STEP) for kind in online_linkage.VARIANTS]


def _floating(complete: bool, h: float) -> Callable[[int], list[pairs.Variant]]:
    return lambda steps: [kind(steps, h, complete) for kind in floating_cost.VARIANTS]


SCENES = (
    Scene("linkage, 12 modes", _linkage, (4000, 200), (11, 1)),
    Scene("floating body, 14 modes, complete", _floating(True, 1e-4), (3000, 50), (7, 1)),
    Scene("floating body, 14 modes, inputs frozen", _floating(False, 1e-3), (3000, 50), (7, 1)),
)


class Promise(NamedTuple):
    """A limit: the issue of this project that asks for it, what of, and what was found."""

    issue: int
    what: str
    limit: float
    found: float

    def __str__(self) -> str:
        return f"{self.issue:5d}  {self.what:<88}{self.limit:10g}{self.found:12.4g}  {self.verdict}"

    @property
    def verdict(self) -> str:
        """Whether it is kept."""
        return pairs.kept(self.found, self.limit)


def ratios(quick: bool, checkout: Path | None = None) -> dict[str, list[pairs.Ratio]]:
    """Measure all scenes; checkout: of Exudyn's repository."""
    found = {}
    for scene in SCENES:
        variants = scene.make(scene.steps[quick])
        found[scene.title] = pairs.ratios(variants, pairs.measure(variants, scene.rounds[quick]))
    return found | short_runs.table(checkout, 1 if quick else 7)


def ratio_text(found: dict[str, list[pairs.Ratio]]) -> str:
    """Return the table of ratios."""
    lines = [f"{'':<{WIDE}}{'CPU us a step':>14}{'ratio':>8}{'quartiles':>15}{'at most':>9}  verdict"]
    for title, rows in found.items():
        lines.append(f"{title:<{WIDE}}{rows[0].step:14.1f}")
        for variant, step, low, middle, high in rows[1:]:
            limit = _limit(variant.limit, middle)
            lines.append(
                f"  {variant.label:<{WIDE - 2}}{step:14.1f}{middle:8.3f}{low:9.3f}..{high:.3f}{limit}".rstrip()
            )
    return "\n".join(lines)


def _limit(limit: float | None, found: float) -> str:
    return "" if limit is None else f"{limit:9g}  {pairs.kept(found, limit)}"


def ratio_promises(found: dict[str, list[pairs.Ratio]]) -> list[Promise]:
    """Return the limits of the ratios."""
    return [
        Promise(20, f"{title}: {row.variant.label}", row.variant.limit, row.middle)
        for title, rows in found.items()
        for row in rows
        if row.variant.limit is not None
    ]


def growth_promises(found: growth.Growth) -> list[Promise]:
    """Return the limits of memory."""
    steps = max(found.steps)
    kinds = {"Bounds": "fast + convolution", "SharpBounds": "energy + auxiliary 40, reconstructed"}
    what = f"linkage: MB above the bare run after {steps} steps"
    more = growth.above(found.steps[steps])
    return [Promise(20, f"{what}, {kinds[kind]}", growth.MEMORY, value) for kind, value in more.items()]


def offline_promises(found: list[offline.Offline]) -> list[Promise]:
    """Return the limits of offline work; coupled bounds have none."""
    what = "offline work, inputs frozen, {} coordinates (promised: 45,000) / Exudyn's Craig-Bampton"
    cases = [case for case in found if case.name in ("frozen", "large")]
    return [Promise(4, what.format(case.dof), offline.PROMISED, case.total / case.craig_bampton) for case in cases]


def other_promises(quick: bool, large: bool) -> list[Promise]:
    """Measure what the other parts leave out: the kernel's offline time, and online cost against the mesh."""
    exponential, _ = exponential_seconds(2 if quick else 20)
    times = build_times(repeats=3 if quick else 51)
    what = "certified kernel, {}: share of the matrix exponential's offline time"
    found = [
        Promise(2, what.format(words), 1 / kernel_offline.AIM, times[name][0] / exponential)
        for name, words in (("certified", "omega_1 counted"), ("certified, omega_1 known", "omega_1 known"))
    ]
    if quick or not importlib.util.find_spec("ngsolve"):
        return found
    sizes = (MESHES[0], offline.LARGE) if large else MESHES
    meshes = [floating_cost.reduced(floating_cost.meshed(dof)) for dof in sizes]
    costs = floating_cost.measure_meshes(meshes, 1000, 5, 1e-3)[..., 1]
    middle = np.median(costs / costs[:, :1], axis=0)
    what = (
        f"floating body, {meshes[0].dof} and {meshes[-1].dof} coordinates: what bounds add to a step, largest / least"
    )
    return [*found, Promise(4, what, floating_cost.SPREAD, float(middle.max() / middle.min()))]


def promise_text(promises: list[Promise]) -> str:
    """Return the table of limits."""
    return "\n".join([f"{'issue':>5}  {'what':<88}{'at most':>10}{'found':>12}", *map(str, promises)])


def run(options: Any) -> tuple[dict[str, str], list[Promise], dict[str, Any]]:
    """Measure the parts asked for; return their tables, all limits, and the numbers."""
    tables, promises, found = {}, [], {}
    if "ratios" in options.only:
        found["ratios"] = ratios(options.quick, options.exudyn)
        tables["ratios"] = ratio_text(found["ratios"])
        promises += ratio_promises(found["ratios"])
        print(tables["ratios"], flush=True)
    if "growth" in options.only:
        found["growth"] = growth.measured(options.quick, options.large)
        tables["growth"] = growth.text(found["growth"])
        promises += growth_promises(found["growth"])
        print(f"\n{tables['growth']}", flush=True)
    if "offline" in options.only:
        chosen = offline.cases(options.quick, options.large)
        found["offline"] = [offline.measured(name, make()) for name, make in chosen.items()]
        tables["offline"] = offline.text(found["offline"])
        promises += offline_promises(found["offline"])
        print(f"\n{tables['offline']}", flush=True)
    if "promises" in options.only:
        promises = sorted([*promises, *other_promises(options.quick, options.large)], key=lambda row: row.issue)
        tables["promises"] = promise_text(promises)
        print(f"\n{tables['promises']}", flush=True)
    return tables, promises, found


def main(arguments: list[str] | None = None) -> tuple[dict[str, str], list[Promise]]:
    """Measure and print; write the page and its picture if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--quick", action="store_true", help="few pairs, short runs")
    parser.add_argument("--large", action="store_true", help="large meshes, too")
    parser.add_argument("--exudyn", type=Path, help="work tree of Exudyn's repository, for its two examples")
    parser.add_argument("--only", choices=PARTS, nargs="+", default=PARTS)
    parser.add_argument("--docs", action="store_true", help="write docs/measured.md and its picture")
    options = parser.parse_args(arguments)
    if options.docs and (options.quick or set(options.only) != set(PARTS) or not options.exudyn):
        parser.error("--docs wants all parts in full: leave out --quick and --only, pass --exudyn")
    print(pairs.threads())
    tables, promises, found = run(options)
    if options.docs:
        page.put("ratios", tables["ratios"])
        draw(found["ratios"], found["growth"], page.FIGURES / "speed.png")
    return tables, promises


if __name__ == "__main__":
    main()
