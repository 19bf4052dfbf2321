"""Random mechanisms against the same simulation with all modes: no error may exceed its coupled bound.

The truth has a complete basis, the same steps and the same solver. Compared at every instant: |truth - value| with
every estimator's bound, |truth - corrected| with corrected_bound, of displacements at the tip and in the middle of
every bar in its frame, and of one velocity.

Floor of an output: what Newton and rounding leave of the reduced run and of the truth, each solved a second time
somewhere else in space, which is the same motion in the frames (the largest difference of all components and instants
counts); and rounding of the stored modes, PENCIL times the squared ratio of the highest to the lowest frequency, of
the largest value. Tolerances of the reduced run are the tightest that all runs reach: 1e-10 relative and 1e-12
absolute, or 10, 100, 1000 times that. Those of the others are 1000 times smaller, or as small as each of them
reaches: with a tenth they often took the same iterations, and what these leave was in no difference (seeds 122, 158).
Violations are counted with and without the floor.

    python benchmarks/sweep_mechanisms.py results [--count 200] [--seed 0] [--processes 2] [--table docs/sweep.md]

With --ratios all bars have damping ratios of their lowest modes, or of all, in place of Rayleigh's factors.

One file of results a mechanism; those that are there are not computed again.
"""

import argparse
import json
import multiprocessing
import os
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from time import process_time
from unittest import mock

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import exudyn_romerr as romerr
from benchmarks.mechanism_builder import all_modes, built
from benchmarks.random_mechanisms import drawn, with_ratios
from benchmarks.sweep import PENCIL
from benchmarks.sweep_mechanisms_table import report
from exudyn_romerr.mbs.derivatives.linearisation import Tangents

ESTIMATORS = ("energy", "auxiliary")
COUPLED = "coupled (linearised)"
TOLERANCES = (1.0, 10.0, 100.0, 1000.0)
TIGHTER = (1e-3, 1e-2, 0.1)
ELSEWHERE = (0.31, -0.47, 0.23)  # m


class NotSolvedError(Exception):
    """Newton reaches none of the tolerances."""


def measure(seed, ratios=False):
    """Return the results of a seed: what was compared, or why nothing was; ratios: with damping by mode."""
    return {"seed": seed, **measured(with_ratios(drawn(seed)) if ratios else drawn(seed))}


def measured(mechanism):
    """Return what was compared of a mechanism, or why nothing was."""
    begin, result = process_time(), {"classes": mechanism.classes}
    try:
        factor, truth, noise = truths(mechanism)
        result |= {"newton": factor, **compared(mechanism, factor, truth, noise)}
    except NotSolvedError as error:
        result["not solved"] = str(error)
    except Exception as error:
        result["refused"] = f"{type(error).__name__}: {error}"
    return result | {"seconds": process_time() - begin}


def truths(mechanism, build=built):
    """Return the factor of the tolerances, values of all sensors with all modes, and what is left of errors."""
    for factor in TOLERANCES:
        few = motion(mechanism, build(mechanism, False, factor))
        cases = ((True, ()), (True, (ELSEWHERE,)), (False, (ELSEWHERE,))) if few is not None else ()
        others = [tightest(mechanism, build, factor, *case) for case in cases]
        if others and None not in others:
            full, full_again, few_again = others
            left = {y: np.abs(few[y] - few_again[y]) + np.abs(full[y] - full_again[y]) for y in full}
            return factor, full, {y: float(x.max()) for y, x in left.items()}
    raise NotSolvedError("Newton's iteration reaches none of the tolerances")


def tightest(mechanism, build, factor, complete, at):
    """Return what all sensors show with the tightest tolerances that Newton reaches, or None if it reaches none."""
    found = (motion(mechanism, build(mechanism, complete, factor * x, *at)) for x in TIGHTER)
    return next((values for values in found if values is not None), None)


def motion(mechanism, scene):
    """Return what all sensors of a scene of the mechanism show, or None if Newton does not reach its tolerance."""
    try:
        scene.solve()
    except Exception as error:
        if "SolveDynamic" not in str(error):
            raise
        return None
    values = scene.motion()
    finite = all(len(y) == mechanism.steps + 1 and np.isfinite(y).all() for y in values.values())
    return values if finite else None


def compared(mechanism, factor, truth, noise):
    """Run the mechanism with monitors; return what their reports say against the truth."""
    scene, readings = built(mechanism, iterate=factor), []
    monitors = [
        romerr.attach(
            scene.mbs,
            flex,
            outputs=list(sensors.values()),
            estimators=ESTIMATORS,
            auxiliary_modes=mechanism.vectors,
        )
        for flex, sensors in zip(scene.flexible(), scene.sensors, strict=True)
    ]
    with mock.patch.object(Tangents, "read", counted(Tangents.read, readings)), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene.solve()
    reports = [monitor.report() for monitor in monitors]
    scopes = sorted({scope for report in reports for scope in report.scope.values()})
    result = {
        "scopes": scopes,
        "tangents": len(readings),
        "messages": sorted({message for report in reports for message in report.messages}),
    }
    if scopes != [COUPLED]:
        return result | {"refused": " / ".join(sorted({report.scope_reason for report in reports}))}
    outputs = {}
    for bar, bounded in zip(mechanism.bars, reports, strict=True):
        omega = all_modes(bar)
        rounding = PENCIL * (omega[-1] / omega[0]) ** 2
        for name, out in bounded.outputs.items():
            floor = noise[name] + rounding * np.abs(truth[name]).max()
            outputs[name] = of_output(out, truth[name], floor, bar)
    return result | {"outputs": outputs}


def counted(read, readings):
    """A function that does what `read` does and notes the time."""

    def function(self, mbs, t):
        readings.append(t)
        return read(self, mbs, t)

    return function


def of_output(out, truth, floor, bar):
    """Sizes of an output, and how each of its bounds compares with the error that it bounds."""
    error = np.abs(truth - out.value)
    found = {e: against(error, bound, floor) for e, bound in out.bound.items()}
    if out.corrected is not None:
        found["corrected"] = against(np.abs(truth - out.corrected), out.corrected_bound, floor)
    size = float(np.abs(truth).max())
    bend = {"bend": size / bar.size[0]} if out.of == "displacement" else {}
    return {"size": size, **bend, "of": out.of, "round off": float(out.round_off.max()), "bounds": found}


def against(error, bound, floor):
    """Largest values (T, 3) over time and components; how many errors are above their bound, and how far."""
    above, raw = error > bound + floor, error > bound
    worst = np.max(error[above] / np.maximum(bound + floor, np.finfo(float).tiny)[above], initial=0.0)
    return {
        "error": float(error.max()),
        "bound": float(bound.max()),
        "floor": floor,
        "violations": int(above.sum()),
        "worst": float(worst),
        "first": int(np.argmax(above.any(axis=1))) if above.any() else None,
        "last": int(np.flatnonzero(above.any(axis=1))[-1]) if above.any() else None,
        "raw violations": int(raw.sum()),
        "values": int(error.size),
    }


def stored(folder, ratios, seed):
    """Return the results of a seed, from its file if there is one."""
    path = folder / f"{seed:04d}.json"
    if not path.exists():
        result = measure(seed, ratios)
        part = path.with_suffix(".part")
        part.write_text(json.dumps(result, indent=1, default=str), encoding="utf-8")
        part.replace(path)
    return json.loads(path.read_text(encoding="utf-8"))


def main(arguments=None):
    """Measure what is not stored yet; print what was found, or put its table into a page; return the results."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path, help="where results are stored")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    parser.add_argument("--ratios", action="store_true", help="bars are damped by ratios of their modes")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--table", type=Path, help="page whose block 'mechanisms' the table is put into")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    seeds, one = range(options.seed, options.seed + options.count), partial(stored, options.folder, options.ratios)
    if options.processes == 1:
        results = [one(seed) for seed in seeds]
    else:
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(options.processes, mp_context=context) as pool:
            results = list(pool.map(one, seeds))
    report(results, options.table)
    return results


if __name__ == "__main__":
    main()
