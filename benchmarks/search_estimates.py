"""The largest deviation of an estimate that all checks of its half width together miss: a search for bad cases.

First random mechanisms (sweep_estimates.py, whose truths are taken where they are stored), then a directed search:
of those whose estimates are off by most half widths one feature is changed at a time - how loads act, how large they
are, steps, spectral radius, damping, joints to the ground, modes and their kind, vectors - and kept if that is worse.

Deviation: largest |truth - computed - estimate| over time, less what the truth is not known to, over the largest half
width, of one component of an output; only of errors above twenty times what the truth is not known to. The truth has
all modes and steps h/4 and h/8, extrapolated. Pulses are at least a step long: of shorter ones docs/limits.md tells.

    python benchmarks/search_estimates.py FOLDER [--count 200] [--rounds 40] [--seed 0] [--table docs/limits.md]
"""

import argparse
import os
import sys
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import exudyn_romerr as romerr
from benchmarks import page, sweep_estimates, sweep_mechanisms
from benchmarks.random_mechanisms import BASES, DAMPINGS, LOADS, Mechanism, drawn
from benchmarks.sweep_estimates import FACTOR, FINER, FLOORS, RESOLVED, WHY_NOT, finer_motion, pencil, scene_of

MARK = "search"
BEST = 5  # seeds that the directed search goes on from
SHOWN = 8  # rows of the table
FEW_STEPS, MANY_STEPS = 30, 240
LABEL = 66  # characters
HEAD = f"{'error':>10}{'estimate':>10}{'off by':>10}{'half width':>12}{'deviation':>11}{'resolved':>10}"


@dataclass(frozen=True)
class Case:
    """A mechanism, what was changed of its seed, and its component that is off by most half widths."""

    mechanism: Mechanism
    changed: str
    output: str = "none"
    error: float = 0.0
    estimate: float = 0.0
    off: float = 0.0
    half_width: float = np.inf

    @property
    def deviation(self) -> float:
        """In half widths."""
        return self.off / self.half_width

    @property
    def resolved(self) -> bool:
        """Whether the half width is small beside the estimate."""
        return self.half_width <= RESOLVED * self.estimate

    def __str__(self) -> str:
        sizes = "".join(f"{x:10.1e}" for x in (self.error, self.estimate, self.off))
        label = f"{self.mechanism.seed}{self.changed}: {self.output}"
        said = "yes" if self.resolved else "no"
        return f"{label:<{LABEL}}{sizes}{self.half_width:12.1e}{self.deviation:11.2g}{said:>10}"


def worst(mechanism, changed, truth, factor):
    """Run the reduced mechanism; return the Cases that are off by most, resolved or not, and resolved."""
    scene = scene_of(mechanism, False, factor)
    monitors = [
        romerr.attach(scene.mbs, romerr.floating_body(fem, items), auxiliary_modes=mechanism.vectors)
        for fem, items in zip(scene.fems, scene.bodies, strict=True)
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene.solve()
        outputs = {key: out for monitor in monitors for key, out in monitor.report().outputs.items()}
    found = [Case(mechanism, changed)]
    for key, y in scene.motion().items():
        if key in outputs and outputs[key].estimate is not None:
            found += components(mechanism, changed, key, outputs[key], y, *truth[key])
    return found


def components(mechanism, changed, key, out, shown, value, floor):
    """Cases of the components of an output that are compared."""
    for row in range(shown.shape[1]):
        error, unknown = np.abs(value - shown)[:, row], floor[:, row]
        off = np.abs(out.estimate + shown - value)[:, row] - unknown
        if error.max() > FLOORS * unknown.max():
            estimate, half_width = (np.abs(x[:, row]).max() for x in (out.estimate, out.uncertainty))
            yield Case(mechanism, changed, f"{key} {'xyz'[row]}", error.max(), estimate, off.max(), half_width)


def truth_of(mechanism):
    """Return truth and floor by sensor, (2, T, 3), and the factor of Newton's tolerances."""
    for factor in sweep_mechanisms.TOLERANCES:
        try:
            coarse, fine = (finer_motion(mechanism, factor, finer) for finer in FINER)
        except sweep_mechanisms.NotSolvedError:
            continue
        found = {}
        for key, y in fine.items():
            value = (4 * y - coarse[key]) / 3
            rounding = 0.0 if "global" in key else pencil(mechanism, key) * np.abs(value).max()
            found[key] = np.array([value, np.abs(value - y) / 4 + rounding])
        return found, factor
    raise sweep_mechanisms.NotSolvedError("Newton's iteration reaches none of the tolerances")


def of_seed(folder, seed):
    """Cases of a random mechanism."""
    stored = sweep_estimates.stored(folder, seed)
    if WHY_NOT in stored:
        return []
    truth = {key: x[[0, 2]] for key, x in stored.items() if key != FACTOR}
    return tried(drawn(seed), "", truth, float(stored[FACTOR]))


def tried(mechanism, changed, truth=None, factor=None):
    """Cases of a mechanism; none where it is not solved, or refused."""
    try:
        if truth is None:
            truth, factor = truth_of(mechanism)
        return worst(mechanism, changed, truth, factor)
    except Exception as error:
        print(f"{mechanism.seed}{changed}: {type(error).__name__}: {error}", file=sys.stderr)
        return []


def changes(mechanism, rng):
    """Return another mechanism, and what was changed."""
    name = str(rng.choice(["load", "size", "steps", "rho", "damping", "base", "modes", "vectors", "gravity"]))
    if name == "load":
        return _with_load(mechanism, rng), " load"
    if name == "size":
        factor = float(rng.choice([0.2, 3.0, 10.0]))
        loads = tuple(replace(load, vector=factor * load.vector) for load in mechanism.loads)
        return replace(mechanism, loads=loads), f" load x {factor:g}"
    if name == "steps":
        factor = float(rng.choice([0.5, 2.0, 4.0]))
        steps = int(np.clip(mechanism.steps / factor, FEW_STEPS, MANY_STEPS))
        return replace(mechanism, h=factor * mechanism.h, steps=steps), f" h x {factor:g}"
    if name == "gravity":
        kind = str(rng.choice(["at once", "late suddenly", "off"]))
        direction, shape = mechanism.gravity
        begin = mechanism.h * (int(0.5 * mechanism.steps) + rng.uniform())
        return replace(mechanism, gravity=(direction, replace(shape, kind=kind, begin=begin))), f" gravity {kind}"
    if name == "modes":
        n, kind = int(rng.choice([0, 1, 4, 8])), str(rng.choice(["RBE2", "RBE3"]))
        return replace(
            mechanism, bars=tuple(replace(bar, n=n, kind=kind) for bar in mechanism.bars)
        ), f" {kind} n={n}"
    if name == "damping":
        damping = DAMPINGS[rng.integers(len(DAMPINGS))]
        bars = tuple(replace(bar, damping=damping) for bar in mechanism.bars)
        return replace(mechanism, bars=bars), f" damping {damping}"
    if name == "rho":
        rho = float(rng.choice([0.3, 0.6, 0.9, 1.0]))
        return replace(mechanism, rho=rho), f" rho {rho:g}"
    if name == "vectors":
        m = int(rng.choice([3, 6, 9, 15]))
        return replace(mechanism, vectors=m), f" m={m}"
    base = str(rng.choice([base for base in BASES if base != "driven" or len(mechanism.bars) > 1]))
    first = replace(mechanism.links[0][0], kind=base)
    return replace(mechanism, base=base, links=((first,), *mechanism.links[1:])), f" {base}"


def _with_load(mechanism, rng):
    """The first load acts in another way, from any instant inside a step on."""
    kind, h, steps = str(rng.choice(LOADS)), mechanism.h, mechanism.steps
    shape = replace(
        mechanism.loads[0].shape,
        kind=kind,
        begin=h * (int(rng.uniform(0.1, 0.8) * steps) + rng.uniform()),
        duration=h * rng.uniform(1, 10),
        omega=float(np.exp(rng.uniform(np.log(3 / (h * steps)), np.log(1 / h)))),
    )
    return replace(mechanism, loads=(replace(mechanism.loads[0], shape=shape), *mechanism.loads[1:]))


def one_each(cases, count, changed=True):
    """The worst cases, one of each mechanism; changed: those that come from one seed are several."""
    found = {}
    for case in sorted(cases, key=lambda case: -case.deviation):
        found.setdefault((case.mechanism.seed, case.changed if changed else ""), case)
    return list(found.values())[:count]


def table(random, directed):
    """Return the worst of both searches."""
    compared = [case for case in random if case.half_width < np.inf]
    above = [sum(case.deviation > limit for case in compared) for limit in (1, 2)]
    lines = [
        f"{len(compared)} components of {len({case.mechanism.seed for case in compared})} random mechanisms: "
        f"{above[0]} off by more than a half width, {above[1]} by more than two",
        *_rows([case for case in compared if case.resolved], "resolved"),
        *_rows([case for case in compared if not case.resolved], "not resolved"),
    ]
    tried = len({(case.mechanism.seed, case.changed) for case in directed})
    return "\n".join([*lines, "", f"directed search, {tried} mechanisms", *_rows(directed, "seed, changes")])


def _rows(cases, title):
    return ["", f"{title:<{LABEL}}{HEAD}", *(str(case) for case in one_each(cases, SHOWN))]


def main(arguments=None):
    """Search, print what was found, or put it into a page; return the worst case."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path, help="where truths of random mechanisms are stored")
    parser.add_argument("--count", type=int, default=200, help="random mechanisms")
    parser.add_argument("--rounds", type=int, default=40, help="mechanisms of the directed search")
    parser.add_argument("--seed", type=int, default=0, help="the first of the random mechanisms, and of the search")
    parser.add_argument("--table", type=Path, help=f"page whose block {MARK!r} the table is put into")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    rng, random, directed = np.random.default_rng([options.seed, 41]), [], []
    for seed in range(options.seed, options.seed + options.count):
        random += of_seed(options.folder, seed)
    for number in range(options.rounds):
        begin = process_time()
        of = one_each(random + directed, BEST, changed=False)
        before = of[number % len(of)]
        mechanism, change = changes(before.mechanism, rng)
        found = tried(mechanism, before.changed + change)
        directed += found
        for case in one_each(found, 1):
            print(f"{case}  ({process_time() - begin:.0f} s)", file=sys.stderr, flush=True)
    print(table(random, directed))
    if options.table:
        page.put(MARK, table(random, directed), options.table)
    return max(random + directed, key=lambda case: case.deviation)


if __name__ == "__main__":
    main()
