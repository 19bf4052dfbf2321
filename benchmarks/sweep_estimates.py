"""Random mechanisms of sweep_mechanisms.py: how good the estimate of the whole error is, and its uncertainty.

The truth has all modes and steps h/4 and h/8, with Richardson's extrapolation, (4 y_{h/8} - y_{h/4})/3; a quarter of
what that changes y_{h/8} by is the floor that it adds to the one of sweep_mechanisms.py (Newton's tolerance, rounding
of modes). Outputs: those in the frames of the bars, and displacements of their tips in global axes. Compared are
outputs whose largest error is twenty times the floor; how many are not is said.

    python benchmarks/sweep_estimates.py FOLDER [--count 200] [--seed 0] [--table docs/estimates_measured.md]

Truths are stored in the folder, one file a mechanism, and not computed again; reduced runs are.
"""

import argparse
import os
import sys
import warnings
from pathlib import Path
from time import process_time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from exudyn import itemInterface

import exudyn_romerr as romerr
from benchmarks import page, sweep_mechanisms
from benchmarks.mechanism_builder import all_modes, built
from benchmarks.random_mechanisms import drawn
from benchmarks.sweep import PENCIL
from models.floating import interface

FINER = (4, 8)
FLOORS = 20.0  # floors that an error is to exceed
RIGHT = 0.1  # of the largest error: an estimate that is off by less is right
RESOLVED = 0.3  # of the estimate: a larger uncertainty makes it "not resolved"
TIMES = 2.0  # uncertainties that errors are to lie within
MARK = "sweep"
FACTOR, WHY_NOT = "factor of tolerances", "why not"


def scene_of(mechanism, *options):
    """Build a mechanism, with a sensor of every tip's displacement in global axes beside its own."""
    scene = built(mechanism, *options)
    for number, (fem, items) in enumerate(zip(scene.fems, scene.bodies, strict=True)):
        name = f"tip {number + 1} global"
        sensor = itemInterface.SensorSuperElement(
            name=name,
            bodyNumber=items["oFFRFreducedOrder"],
            meshNodeNumber=interface(fem, "tip")[0][0],
            outputVariableType=exu.OutputVariableType.Displacement,
            storeInternal=True,
        )
        scene.sensors[number][name] = scene.mbs.AddSensor(sensor)
    return scene


def truth_of(mechanism):
    """Return, by sensor, truth, full motion at h and floor, (3, T, 3), and the factor of Newton's tolerances."""
    factor, full, noise = sweep_mechanisms.truths(mechanism, scene_of)
    coarse, fine = (finer_motion(mechanism, factor, finer) for finer in FINER)
    found = {}
    for key, y in fine.items():
        value = (4 * y - coarse[key]) / 3
        rounding = 0.0 if "global" in key else pencil(mechanism, key) * np.abs(value).max()
        found[key] = np.array([value, full[key], np.abs(value - y) / 4 + noise[key] + rounding])
    return found | {FACTOR: np.array(factor)}


def finer_motion(mechanism, factor, finer):
    """Return what sensors show at every h, solved with all modes and steps h/finer, tolerances as tight as can be."""
    for iterate in (factor * sweep_mechanisms.TIGHTER[-1], factor):
        scene = scene_of(mechanism, True, iterate)
        scene.settings.timeIntegration.numberOfSteps *= finer
        found = sweep_mechanisms.motion(mechanism, scene)
        if found is not None:
            return found
    raise sweep_mechanisms.NotSolvedError(f"Newton's iteration does not reach its tolerance with h/{finer}")


def pencil(mechanism, key):
    """Return the rounding of stored modes of a sensor's bar, a share of its largest value."""
    omega = all_modes(mechanism.bars[int(key.split()[1]) - 1])
    return PENCIL * (omega[-1] / omega[0]) ** 2


def stored(folder, seed):
    """Return the truth of a seed, from its file if there is one; where there is none, a text that says why."""
    path = folder / f"{seed:04d}.npz"
    if not path.exists():
        try:
            found = truth_of(drawn(seed))
        except sweep_mechanisms.NotSolvedError as error:
            found = {WHY_NOT: np.array(str(error))}
        part = path.with_suffix(".part.npz")
        np.savez_compressed(part, **found)
        part.replace(path)
    with np.load(path, allow_pickle=False) as file:
        return dict(file)


def measured(seed, truth):
    """Run the reduced mechanism of a seed; return what its estimates say, a dict an output."""
    mechanism = drawn(seed)
    if WHY_NOT in truth:
        return {"seed": seed, "refused": str(truth[WHY_NOT])}
    scene = scene_of(mechanism, False, float(truth[FACTOR]))
    monitors = [
        romerr.attach(scene.mbs, romerr.floating_body(fem, items), auxiliary_modes=mechanism.vectors)
        for fem, items in zip(scene.fems, scene.bodies, strict=True)
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            scene.solve()
            reports = [monitor.report() for monitor in monitors]
        except Exception as error:
            return {"seed": seed, "refused": f"{type(error).__name__}: {error}"}
    shown, outputs = scene.motion(), {}
    for key, y in shown.items():
        report = next((report for report in reports if key in report.outputs), None)
        if report is None or report.output(key).estimate is None:
            outputs[key] = None
        else:
            outputs[key] = of_output(report.output(key), y, *truth[key])
    return {"seed": seed, "outputs": outputs}


def of_output(out, shown, truth, full, floor):
    """Largest values over time and components, and how many errors lie inside."""
    error, size = truth - shown, np.abs
    off, wide = size(out.estimate - error), out.uncertainty
    return {
        "error": float(size(error).max()),
        "steps": float(size(truth - full).max()),
        "estimate": float(size(out.estimate).max()),
        "off": float(off.max()),
        "uncertainty": float(wide.max()),
        "floor": float(floor.max()),
        "inside": int((off <= TIMES * wide + floor)[1:].sum()),
        "values": int(off[1:].size),
        "checks": {check: float(x.max()) for check, x in out.uncertainty_parts.items()},
    }


def table(results):
    """Return what was found, for outputs in the frames and in global axes."""
    lines = [
        f"{'outputs':<12}{'number':>7}{'compared':>9}{'inside':>8}{'unc./off':>9}{'off/error':>10}{'unc./error':>11}"
    ]
    lines[0] += f"{'resolved':>9}{'right, not resolved':>21}"
    for axes in ("frames", "global"):
        outputs = [
            out
            for result in results
            for key, out in result.get("outputs", {}).items()
            if ("global" in key) == (axes == "global")
        ]
        lines.append(_line(axes, outputs))
    refused = [result for result in results if "refused" in result]
    return "\n".join([*lines, *(f"seed {result['seed']}: {result['refused']}" for result in refused)])


def _line(axes, outputs):
    found = [out for out in outputs if out and out["error"] > FLOORS * out["floor"]]
    line = f"{axes:<12}{len(outputs):7d}{len(found):9d}"
    if not found:
        return line
    error, off, wide, estimate, inside, values = (
        np.array([out[key] for out in found])
        for key in ("error", "off", "uncertainty", "estimate", "inside", "values")
    )
    resolved, right = wide <= RESOLVED * estimate, off <= RIGHT * error
    silent = np.sum(right & ~resolved) / max(right.sum(), 1)
    line += f"{100 * inside.sum() / values.sum():7.1f}%{np.median(off / error):10.2g}{np.median(wide / off):9.2g}"
    of_resolved = [
        np.median(x[resolved]) if resolved.any() else np.nan for x in (off / error, wide / off, wide / error)
    ]
    columns = (f"{x:{width}.2g}" for x, width in zip(of_resolved, (10, 9, 11), strict=True))
    return f"{line}{resolved.sum():9d}{''.join(columns)}{100 * silent:20.0f}%"


def main(arguments=None):
    """Measure, print what was found, or put its table into a page; return the results."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path, help="where truths are stored")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    parser.add_argument("--table", type=Path, help="page whose block 'sweep' the table is put into")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    results = []
    for seed in range(options.seed, options.seed + options.count):
        begin = process_time()
        truth = stored(options.folder, seed)
        solved, begin = process_time() - begin, process_time()
        results.append(measured(seed, truth))
        print(f"seed {seed}: truth {solved:.0f} s, {process_time() - begin:.1f} s", file=sys.stderr, flush=True)
    print(table(results))
    if options.table:
        page.put(MARK, table(results), options.table)
    return results


if __name__ == "__main__":
    main()
