"""Seeded combinations of body, basis, load, damping, steps and integrator: no true error may exceed its bound.

The truth is the exact solution of the full model in continuous time: forced plus free motion, each rounded, as are
the factorisations behind the bounds. Rounding is a share of the largest output (of an output that hardly moves: of
|C| times the mass norm of the solution or of its static deflection; for position and velocity: of that norm): FLOOR,
and PENCIL times the squared ratio of the highest to the lowest frequency, since M and K are stored with 16 digits,
which is that much of the lowest mode. What exceeds a bound by more is a violation; raw excesses are printed too.

    python benchmarks/sweep.py [--count 1000] [--seed 0]
"""

import argparse
import os
import sys
import warnings
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks.scenes import Choice, scene

FLOOR = 1e-10
PENCIL = 1e-15
STILL = 1e-3  # of |C| times the mass norm of the solution: an output smaller than this is measured against that
MEANINGFUL = 1e3  # true errors this many times above the floor have an effectivity
ESTIMATORS = ("best", "energy", "auxiliary", "fast", "convolution")


@dataclass(frozen=True)
class Found:
    """One quantity of one scene: largest |error| - bound over time by estimator, and effectivities, over `scale`."""

    what: str
    scale: float
    floor: float
    excess: dict[str, float]
    effectivity: dict[str, float]

    @property
    def violated(self):
        """Excesses above the floor."""
        return {e: x for e, x in self.excess.items() if not x <= self.floor}


@dataclass(frozen=True)
class Result:
    """A scene's choice, what was found, the exception that ended it (or None), the report's messages."""

    pick: Choice
    found: list[Found]
    error: Exception | None = None
    messages: tuple[str, ...] = ()

    @property
    def violations(self):
        """(what, estimator, excess over scale) of every violation."""
        return [(f.what, e, x) for f in self.found for e, x in f.violated.items()]


def measure(case):
    """Run a Scene and compare every bound with the exact solution."""
    report, qr, qr_t = case.run()
    q, q_t = case.exact.motion(case.B, case.u, case.q0, case.q0_t, report.t)
    e, e_t = q - qr @ case.basis.V.T, q_t - qr_t @ case.basis.V.T
    omega = case.exact.omega
    floor = FLOOR + PENCIL * (omega[-1] / omega[0]) ** 2
    loads = np.vstack([case.u.at(report.t), case.u.start])
    static = np.linalg.solve(case.model.K, case.B @ loads.T).T
    energy = max(omega[0] * np.max(mass_norm(case, np.vstack([q, static]))), np.max(mass_norm(case, q_t)))
    found = [
        compared("position", mass_norm(case, e), report.position_bound, energy / omega[0], floor),
        compared("velocity", mass_norm(case, e_t), report.velocity_bound, energy, floor),
    ]
    dual = np.sqrt(np.max(np.einsum("ri,ri->r", case.C, np.linalg.solve(case.model.M, case.C.T).T)))
    for name, x, error, size in (("y", q, e, energy / omega[0]), ("v", q_t, e_t, energy)):
        out = report.output(name)
        truth = np.abs(error @ case.C.T)
        scale = max(np.max(np.abs(x @ case.C.T)), STILL * dual * size)
        found.append(compared(name, truth, out.bound, scale, floor))
        if out.corrected is not None:
            left = np.abs(out.corrected - x @ case.C.T)
            found.append(compared(f"{name} corrected", left, {"auxiliary": out.corrected_bound}, scale, floor))
    return Result(case.pick, found, messages=tuple(report.messages))


def compared(what, truth, bounds, scale, floor):
    """Return Found for truth (T, ...) and bounds of the same shape."""
    scale = max(scale, np.finfo(float).tiny)
    excess = {e: float(np.max(truth - bound) / scale) for e, bound in bounds.items()}
    effectivity = {}
    if np.max(truth) > MEANINGFUL * floor * scale:
        effectivity = {e: float(np.max(bound) / np.max(truth)) for e, bound in bounds.items()}
    return Found(what, scale, floor, excess, effectivity)


def mass_norm(case, x):
    """|x_k|_M of every row."""
    return np.sqrt(np.einsum("ti,ti->t", x @ case.model.M, x))


def measure_seed(seed):
    """Return the Result of a seed; exceptions are part of it."""
    pick = Choice(seed, *["?"] * 6)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            case = scene(seed)
            pick = case.pick
            return measure(case)
    except Exception as error:
        return Result(pick, [], error)


def print_table(results):
    """Violations and effectivities of the displacement output, by body, damping, basis, load and integrator."""
    head = "".join(f"{e:>20}" for e in ESTIMATORS)
    print("effectivity of displacement outputs, max bound / max true total error: median and largest")
    print(f"{'':<34}{head}")
    for kind in ("body", "damping", "basis", "load", "initial", "integrator"):
        groups = defaultdict(list)
        for result in results:
            groups[getattr(result.pick, kind)].append(result)
        for name, group in sorted(groups.items()):
            bad = sum(bool(result.violations) for result in group)
            print(f"{name:<20}{len(group):>6}{bad:>4} bad  " + "".join(_column(e, group) for e in ESTIMATORS))
        print()


def _column(e, group):
    ratios = [f.effectivity[e] for r in group for f in r.found if f.what == "y" and e in f.effectivity]
    return f"{np.median(ratios):>9.3g} {np.max(ratios):>10.3g}" if ratios else f"{'-':>9} {'-':>10}"


def print_verdict(results):
    """Every violation and exception with its seed; the largest raw excess of all."""
    for result in results:
        if result.error is not None:
            print(f"exception: {result.pick}: {type(result.error).__name__}: {result.error}")
        for what, e, excess in result.violations:
            print(f"VIOLATION: {result.pick}: {what} by {e}: {excess:.2e} of its scale; {list(result.messages)}")
    every = [(x, f.what, e, r.pick) for r in results for f in r.found for e, x in f.excess.items()]
    if every:
        x, what, e, pick = max(every, key=lambda entry: entry[0])
        print(f"largest raw excess, over the scale: {x:.2e} ({what} by {e}, {pick})")
    bad, failed = (sum(map(bool, xs)) for xs in ([r.violations for r in results], [r.error for r in results]))
    print(f"{len(results)} combinations: {bad} with a violation, {failed} with an exception")


def main(arguments=None):
    """Measure and print; return the results."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    options = parser.parse_args(arguments)
    begin = perf_counter()
    results = [measure_seed(seed) for seed in range(options.seed, options.seed + options.count)]
    print_table(results)
    print_verdict(results)
    print(f"{perf_counter() - begin:.0f} s", file=sys.stderr)
    return results


if __name__ == "__main__":
    main()
