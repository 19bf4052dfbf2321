"""How many runs of mechanisms are certified, why the others are not, and how far bounds are above errors.

Random mechanisms (random_mechanisms.py), changed such that about half have dampers in joints, half start suddenly,
spectral radii are 0.3 to 1, and in a tenth the solver repeats steps with smaller ones. Truth and floors are those of
sweep_mechanisms.py.

    python benchmarks/certified.py results [--count 200] [--seed 0] [--limit 600] [--before other]

One file of results a mechanism; those that are there are not computed again. --limit: begin none after so many
seconds. --before: results of another version, whose certified runs are compared apart.
"""

import argparse
import json
import os
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from unittest import mock

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import benchmarks.sweep_mechanisms as sweep
import exudyn_romerr as romerr
from benchmarks.mechanism_builder import built
from benchmarks.random_mechanisms import drawn
from benchmarks.sweep import MEANINGFUL

RADII = 0.3, 0.5, 0.7, 0.9, 0.9, 1.0
PATIENCE = 10.0  # s of one solve that repeats steps
REFUSED = 20.5, 40.5  # samples between which no step above 0.3 of the first size is accepted


def changed(seed):
    """Return a mechanism, whether steps are repeated, whether it has dampers, whether it starts suddenly."""
    rng, mechanism = np.random.default_rng([seed, 35]), drawn(seed)
    is_damped, is_sudden, is_repeated = rng.random() < 0.5, rng.random() < 0.5, rng.random() < 0.1
    mechanism = replace(mechanism, rho=float(rng.choice(RADII)))
    return started(damped(mechanism, is_damped), is_sudden), is_repeated, is_damped, is_sudden


def damped(mechanism, is_damped):
    """With a damper at least, or without any beside those of the bars."""
    if is_damped:
        links = tuple(tuple(replace(link, damped=True) for link in of) for of in mechanism.links)
        kinds = [link.kind for of in links for link in of]
        has_one = "hinge" in kinds or "bushing" in kinds or mechanism.end in ("springs", "rope")
        return replace(mechanism, links=links, end=mechanism.end if has_one else "springs")
    links = tuple(
        tuple(replace(link, damped=False, kind="spherical" if link.kind == "bushing" else link.kind) for link in of)
        for of in mechanism.links
    )
    return replace(mechanism, links=links, end="guide" if mechanism.end in ("springs", "rope") else mechanism.end)


def started(mechanism, is_sudden):
    """With a load that is there at once, or without any."""
    first, *others = mechanism.loads
    if is_sudden:
        return replace(mechanism, loads=(replace(first, shape=replace(first.shape, kind="at once")), *others))
    loads = tuple(
        replace(load, shape=replace(load.shape, kind="smooth")) if load.shape.kind in ("at once", "off") else load
        for load in mechanism.loads
    )
    vector, shape = mechanism.gravity
    shape = replace(shape, kind="ramp") if shape.kind in ("at once", "off") else shape
    return replace(mechanism, loads=loads, gravity=(vector, shape))


def repeating(mechanism, *arguments, **options):
    """Build a mechanism whose solver repeats steps amid the run."""
    scene, h = built(mechanism, *arguments, **options), mechanism.h
    mbs, settings = scene.mbs, scene.settings.timeIntegration

    begun = time.monotonic()

    def refuse(mbs, t):
        if time.monotonic() > begun + PATIENCE:
            raise TimeoutError("Newton's iteration fails again and again")
        is_long = mbs.sys["dynamicSolver"].it.currentStepSize > 0.3 * h
        return [1e3 * (REFUSED[0] * h < t < REFUSED[1] * h and is_long), -1.0]

    mbs.SetPostNewtonUserFunction(refuse)
    settings.adaptiveStep, settings.adaptiveStepRecoverySteps, settings.minimumStepSize = True, 2, 0.05 * h
    settings.discontinuous.maxIterations, settings.discontinuous.iterationTolerance = 2, 1.0
    settings.discontinuous.ignoreMaxIterations, settings.adaptiveStepRecoveryIterations = False, 50
    scene.settings.solution.sensors.writePeriod = 1e-9
    return scene


def measured(seed):
    """Return what was found of a seed: sweep_mechanisms.measured, and the causes of all doubts."""
    mechanism, is_repeated, is_damped, is_sudden = changed(seed)
    build, doubts, ends, make = repeating if is_repeated else built, set(), [], romerr.attach

    def noted(*arguments, **options):
        monitor = make(*arguments, **options)
        report = monitor.report

        def seen():
            found = report()
            doubts.update(doubt.cause for doubt in found.uncertified)
            ends.append(sum(float(out.bound["best"][-1].max()) for out in found.outputs.values()))
            return found

        return mock.Mock(report=seen)

    with (
        mock.patch.object(sweep, "built", build),
        mock.patch.object(romerr, "attach", noted),
        mock.patch.object(sweep, "truths", lambda m, _=None: truths(m, build)),
        mock.patch.object(sweep, "motion", motion),
    ):
        found = sweep.measured(mechanism)
    kinds = {"repeated": is_repeated, "damped": is_damped, "sudden": is_sudden, "radius": mechanism.rho}
    return {"seed": seed, **kinds, "doubts": sorted(doubts), "finite": bool(np.all(np.isfinite(ends))), **found}


truths, same_steps = sweep.truths, sweep.motion


def motion(mechanism, scene):
    """Values of all sensors as sweep_mechanisms.motion has them, of as many steps as were made."""
    try:
        scene.solve()
    except Exception as error:
        if "SolveDynamic" not in str(error) and "Newton" not in str(error):
            raise
        return None
    values = scene.motion()
    return values if all(len(y) > mechanism.steps and np.isfinite(y).all() for y in values.values()) else None


def table(results, before):
    """Lines of what was found."""
    compared = [result for result in results if "outputs" in result]
    values = sum(b["values"] for r in compared for out in r["outputs"].values() for b in out["bounds"].values())
    above = [(r["seed"], r["doubts"]) for r in compared if sweep_violations(r)]
    certified = [r for r in compared if not r["doubts"]]
    yield f"{len(results)} mechanisms, {len(compared)} compared, {values} values"
    yield f"certified: {len(certified)}, {100 * len(certified) / max(len(compared), 1):.1f} %"
    yield f"above bound and floor: {above}"
    for name in ("damped", "sudden", "repeated"):
        of = [r for r in compared if r[name]]
        yield f"  {name}: {sum(not r['doubts'] for r in of)} of {len(of)} certified"
    yield "reasons, runs:"
    for cause, count in Counter(cause for r in compared for cause in r["doubts"]).most_common():
        yield f"  {count:4d}  {cause}"
    was_certified = {r["seed"] for r in before if "outputs" in r and not r["doubts"]}
    of_s0 = {r["seed"] for r in compared if r["damped"] and r["sudden"] and r["radius"] < 1 and not r["repeated"]}
    groups = {"all": compared, "certified": certified}
    groups |= {"certified before": [r for r in compared if r["seed"] in was_certified]}
    groups |= {"sudden, damped, radius < 1": [r for r in compared if r["seed"] in of_s0]}
    yield "bound / error of displacements, largest over time and components:     outputs   median     90 %    worst"
    for name, group in groups.items():
        yield _line(name, group)


def sweep_violations(result):
    """Number of values above bound and floor."""
    return sum(b["violations"] for out in result["outputs"].values() for b in out["bounds"].values())


def _line(name, group):
    found = []
    for result in group:
        for out in result["outputs"].values():
            best = out["bounds"]["best"]
            if out["of"] == "displacement" and best["error"] > MEANINGFUL * best["floor"]:
                found.append(best["bound"] / best["error"])
    if not found:
        return f"  {name:<68}{0:8d}"
    return f"  {name:<68}{len(found):8d}{np.median(found):9.3g}{np.quantile(found, 0.9):9.3g}{max(found):9.3g}"


def stored(folder, seed, may_compute):
    """Return the results of a seed, from its file if there is one; None: there is none and no time."""
    path = folder / f"{seed:04d}.json"
    if not path.exists():
        if not may_compute:
            return None
        part = path.with_suffix(".part")
        part.write_text(json.dumps(measured(seed), indent=1, default=str), encoding="utf-8")
        part.replace(path)
    return json.loads(path.read_text(encoding="utf-8"))


def main(arguments=None):
    """Measure what is not stored yet, print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path, help="where results are stored")
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0, help="the first of the seeds")
    parser.add_argument("--limit", type=float, default=np.inf, help="seconds after which none is begun")
    parser.add_argument("--before", type=Path, help="results of another version")
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    end, seeds = time.monotonic() + options.limit, range(options.seed, options.seed + options.count)
    results = [stored(options.folder, seed, time.monotonic() < end) for seed in seeds]
    others = [] if options.before is None else [stored(options.before, seed, False) for seed in seeds]
    print("\n".join(table([r for r in results if r], [r for r in others if r])))


if __name__ == "__main__":
    main()
