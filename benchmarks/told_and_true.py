"""What a run says of its errors beside what they are, by component and cause: records for half_widths.py, bounds.py.

Random mechanisms (random_mechanisms.py), made smooth, sudden and undamped, or sudden with dampers. True of the modes
is what all modes at the same steps show less what the run shows, which includes interfaces that modes make rigid; how
far that is uncertain is converged.py's. True of the steps is what shorter steps of the reduced mechanism
tend to: they are halved until two halvings differ by a quarter (order 2), Richardson's value counts, and the
difference to the one before is its uncertainty. Where no order shows, as far as LAST halvings go, the last difference
is.

These truths are in random_truths.npz, of as many seeds as 2 MB hold; those of others are made anew each time (20 s):

    python benchmarks/told_and_true.py FOLDER [--count 160] [--processes 2]      half an hour on two cores

FOLDER keeps one file a seed until all are there. Scenes of models/estimate_scenes.py: stored truths with no mode left
out, see models/estimate_truths.py; with RBE3 and with RBE2 interfaces.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks import page
from benchmarks.by_run import told_by_run
from benchmarks.converged import truths
from benchmarks.estimates import attached, bodies_of
from benchmarks.mechanism_builder import all_modes, built
from benchmarks.random_mechanisms import Mechanism, Shape, damped, drawn, started
from benchmarks.sweep import PENCIL
from exudyn_romerr.report.assessment import OF_INTERFACES
from exudyn_romerr.report.scope import COMPLETE, FROZEN
from exudyn_romerr.report.verdicts import CAUSES as OF_REPORT
from exudyn_romerr.report.wording import estimate_scope
from models import estimate_truths
from models.estimate_scenes import SCENES, EstimateScene, LinearScene

SAME = 10.0  # times what is uncertain of a truth: a run whose end is farther off is another one
KINDS = ("smooth", "sudden, undamped", "sudden, undamped", "sudden, dampers")  # of seed % 4
LAST = 6  # halvings of the step
ORDER_2 = 3.5, 4.5  # ratio of the differences of two halvings
ITERATED = 1e-7  # of the largest value: what Newton's tolerances leave of the difference of two runs of models/
AGAIN = 2.0  # times what one repetition shows of Newton's noise: another, as the run at hand, has its own
TIMES = 2.0  # half widths that the truth is to lie within
TRUTHS = Path(__file__).resolve().parent / "random_truths.npz"  # as many seeds as 2 MB hold
CAUSES = ("modes", "interfaces", "step", "whole")
STATIC = ("basis", "interfaces")  # told together, for the truth tells them together


def kind_of(seed: int) -> str:
    """Return what a seed is made: a quarter smooth, half sudden and undamped, a quarter sudden with dampers."""
    return KINDS[seed % len(KINDS)]


def mechanism_of(seed: int) -> Mechanism:
    """Return the mechanism of a seed, made what its kind says."""
    mechanism = drawn(seed)
    if kind_of(seed) == "smooth":
        loads = tuple(replace(load, shape=_smooth(load.shape, "smooth")) for load in mechanism.loads)
        vector, shape = mechanism.gravity
        return replace(mechanism, loads=loads, gravity=(vector, _smooth(shape, "ramp")))
    if kind_of(seed).endswith("dampers"):
        return replace(started(damped(mechanism, True), True), end="springs")
    bars = tuple(replace(bar, damping=(0.0, 0.0), ratios=None) for bar in mechanism.bars)
    return replace(started(damped(mechanism, False), True), bars=bars)


def _smooth(shape: Shape, instead: str) -> Shape:
    return replace(shape, kind=instead) if shape.kind in ("at once", "late suddenly", "off") else shape


def truth_of(seed: int) -> dict[str, np.ndarray]:
    """Return the truth of a random mechanism by names: "factor" of Newton's tolerances, or "failed", why it is not.

    Of every sensor "KEY/modes", "KEY/step" (T, r) : errors; "KEY/floor", "KEY/unsure" (r,) : how far these are
    uncertain; "KEY/end" (r,) : what it shows in the last row, by which another run is told.
    """
    mechanism = mechanism_of(seed)
    try:
        factor, full, noise = truths(mechanism)
        few, h, steps = values(mechanism, factor), mechanism.h, mechanism.steps
        of_steps = limits(lambda k: values(replace(mechanism, h=h / 2**k, steps=steps * 2**k), factor, 2**k))
    except Exception as error:
        return {"failed": np.array(f"{type(error).__name__}: {error}")}
    omega = [all_modes(bar) for bar in mechanism.bars]
    rounding = PENCIL * max(w[-1] / w[0] for w in omega) ** 2
    found = {"factor": np.array(factor)}
    for key, y in few.items():
        found[f"{key}/modes"], (found[f"{key}/step"], unsure) = full[key] - y, of_steps[key]
        found[f"{key}/floor"] = np.full(y.shape[1], noise[key] + rounding * np.abs(y).max())
        found[f"{key}/unsure"] = unsure + found[f"{key}/floor"]
        found[f"{key}/end"] = y[-1]
    return found


def kept_truth(seed: int, truth: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return a truth as the file has it: errors of modes in single, of steps in half precision.

    Their rounding counts as uncertain.
    """
    found = {}
    for name, x in truth.items():
        key, _, part = name.partition("/")
        if part == "step":
            scale = np.maximum(np.abs(x).max(axis=0), np.finfo(float).tiny)
            found[f"{seed}/{name}"] = (x / scale).astype(np.float16)
            found[f"{seed}/{key}/scale"] = scale
        elif part in ("floor", "unsure"):
            of_step, of_modes = (np.abs(truth[f"{key}/{of}"]).max(axis=0) for of in ("step", "modes"))
            x = x + np.finfo(np.float32).eps / 2 * of_modes
            found[f"{seed}/{name}"] = x + (part == "unsure") * np.finfo(np.float16).eps / 2 * of_step
        else:
            found[f"{seed}/{name}"] = x.astype(np.float32) if part == "modes" else x
    return found


def read_truth(seed: int) -> dict[str, np.ndarray]:
    """Return the truth of a seed from TRUTHS, or made anew where the file has none."""
    if not TRUTHS.exists():
        return truth_of(seed)
    with np.load(TRUTHS, allow_pickle=False) as file:
        names = [name for name in file.files if name.startswith(f"{seed}/")]
        found = {name.partition("/")[2]: file[name] for name in names}
    for name in [name for name in found if name.endswith("/scale")]:
        key = name.removesuffix("/scale")
        found[f"{key}/step"] = found[f"{key}/step"].astype(float) * found.pop(name)
    return found or truth_of(seed)


def is_of(few: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> bool:
    """Whether a truth is that of a run, by what it shows at its end.

    Where truths were stored, on another machine, eigensolvers may have found a few other modes: that is another run.
    """
    return all(np.all(np.abs(y[-1] - truth[f"{key}/end"]) <= SAME * truth[f"{key}/floor"]) for key, y in few.items())


def of_seed(seed: int) -> dict[str, Any]:
    """Return the records of a random mechanism, or why there are none."""
    truth, found = read_truth(seed), {"scene": f"seed {seed}", "kind": kind_of(seed)}
    if "failed" in truth:
        return found | {"no truth": str(truth["failed"])}
    try:
        few, report = told(mechanism_of(seed), float(truth["factor"]))
    except Exception as error:
        return found | {"refused": f"{type(error).__name__}: {error}"}
    if not is_of(few, truth):
        truth = truth_of(seed)
        if "failed" in truth:
            return found | {"no truth": str(truth["failed"])}
    known = {}
    for key in few:
        modes, floor, step, unsure = (truth[f"{key}/{part}"] for part in ("modes", "floor", "step", "unsure"))
        known[key] = modes, floor, step, unsure, modes + step, unsure
    return found | records_of(report, known)


def records_of(report: Any, known: dict[str, tuple[np.ndarray, ...]]) -> dict[str, Any]:
    """Return what a report says beside what is known of its sensors.

    known : by name errors of modes (T, r), how far they are uncertain (r,), the same of steps, and of both together.
    """
    # else its bounds are those of the error that the modes make
    is_whole = COMPLETE in report.scope.values() and report.time != "sampled"
    records, bounds = [], []
    for key, of in known.items():
        true = {"modes": of[:2], "step": of[2:4], "whole": of[4:]}
        out = report.outputs.get(key)
        records += list(of_output(key, out, report.scope, true, of[0].shape[1]))
        bounds += list(of_bound(key, out, report.scope, *true["whole" if is_whole else "modes"]))
    uncertified = {doubt.cause for out in report.outputs.values() for doubt in out.uncertified}
    return {"records": records, "bounds": bounds, "uncertified": sorted(uncertified)}


def told(mechanism: Mechanism, iterate: float) -> tuple[dict[str, np.ndarray], Any]:
    """Return what sensors show in a run, and its report, as `romerr run` makes it; iterate: see mechanism_builder."""
    scene = built(mechanism, iterate=iterate)
    _, report = told_by_run(scene.mbs, scene.flexible(), scene.solve)
    return scene.motion(), report


def values(mechanism: Mechanism, iterate: float, each: int = 1) -> dict[str, np.ndarray]:
    """Return what sensors show (T, r) without us, in each of so many rows."""
    scene = built(mechanism, iterate=iterate)
    scene.solve()
    return {key: y[::each] for key, y in scene.motion().items()}


def limits(solve: Callable[[int], dict[str, np.ndarray]]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return of every sensor what the steps have made wrong (T, r), and how far that is uncertain (r,).

    solve(k) : what sensors show with steps that were halved k times, at the instants of those that were not.
    """
    series = [solve(0)]
    found: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for k in range(1, LAST + 1):
        series.append(solve(k))
        if k >= 3:
            found = {key: _limit([one[key] for one in series]) for key in series[0]}
            if all(np.all(unsure <= 0.01 * np.abs(error).max(axis=0)) for error, unsure in found.values()):
                break
    return found


def _limit(series: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Component by component, for one may ring and another not."""
    *_, a, b, c = series
    one, two = np.abs(b - a).max(axis=0), np.abs(c - b).max(axis=0)
    ratio = np.divide(one, two, out=np.zeros_like(one), where=two > 0)
    is_second = (ratio > ORDER_2[0]) & (ratio < ORDER_2[1])
    best, before = (4 * c - b) / 3, (4 * b - a) / 3
    return best - series[0], np.where(is_second, np.abs(best - before).max(axis=0), two)


def of_output(
    name: str, out: Any, scope: dict[str, str], true: dict[str, tuple[np.ndarray, np.ndarray]], rows: int
) -> Iterator[dict[str, Any]]:
    """Yield a record of every component and cause; true : cause -> error (T, r), its uncertainty (r,)."""
    is_known = out is not None and out.estimate is not None and estimate_scope(out, scope) != FROZEN
    for cause, (error, unsure) in true.items():
        part, half = parts(out, cause) if is_known else (None, None)
        for i in range(rows):
            record = {"name": name, "component": i, "cause": cause}
            record |= {"true": _most(error[:, i]), "unsure": float(unsure[i]), "is known": is_known}
            if is_known:
                off = np.abs(part[:, i] - error[:, i])
                inside = off <= TIMES * half[:, i] + unsure[i]
                record |= {"told": _most(np.abs(part[:, i]) + half[:, i]), "half": _most(half[:, i])}
                record |= {"off": _most(off), "inside": float(np.mean(inside))}
            yield record


def parts(out: Any, cause: str) -> tuple[np.ndarray, np.ndarray]:
    """Return what is told of a cause (T, r), signed, and its half width (T, r), as `romerr run` prints them."""
    if cause == "whole":
        return out.estimate, out.uncertainty
    names, checks = OF_REPORT[cause].parts, OF_REPORT[cause].checks
    if cause == "modes":
        names, checks = STATIC, checks + OF_INTERFACES
    zero = np.zeros_like(out.estimate)
    halves = (out.uncertainty_parts[x] for x in checks if x in out.uncertainty_parts)
    return zero + sum(out.estimate_parts[x] for x in names if x in out.estimate_parts), zero + sum(halves)


def of_bound(
    name: str, out: Any, scope: dict[str, str], error: np.ndarray, floor: np.ndarray
) -> Iterator[dict[str, Any]]:
    """Yield what the bound of every component is beside the error (T, r) that it covers, where there is a bound."""
    if out is None or FROZEN in scope.values() or not np.isfinite(out.bound["best"]).all():
        return
    for i in range(error.shape[1]):
        bound, size = out.bound["best"][:, i], np.abs(error[:, i])
        below = float(np.max(size - bound - AGAIN * floor[i]))
        record = {"name": name, "component": i, "of": out.of, "bound": _most(bound), "true": _most(size)}
        yield record | {"floor": float(floor[i]), "below": below, "certified": not out.uncertified}


def of_scene(name: str, n: int, kind: str) -> dict[str, Any]:
    """Return the records of a scene of models/ with n modes and interfaces of a kind."""
    scene, found = SCENES[name], {"scene": f"{name}, n = {n}, {kind}", "kind": f"models, {kind}"}
    made, flexes = bodies_of(scene, n, kind)
    try:
        if isinstance(made, LinearScene):
            (monitor,) = attached(made, flexes)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                shown = estimate_truths.motion(made, scene.h)
            report = monitor.report()
        else:
            shown, report = told_by_run(made.mbs, flexes, lambda: estimate_truths.motion(made, scene.h))
    except Exception as error:
        return found | {"refused": f"{type(error).__name__}: {error}"}
    steps = limits(lambda k: _finer(scene, n, kind, k))
    known = {}
    for key, truth in estimate_truths.stored(name).items():
        floor = ITERATED * np.abs(truth.value).max() + np.zeros_like(truth.off)
        step, unsure = steps[key]
        of_all = truth.value - shown[key], truth.off + floor
        known[key] = truth.same_steps - shown[key], floor, step, unsure + floor, *of_all
    return found | records_of(report, known)


def _finer(scene: EstimateScene, n: int, kind: str, k: int) -> dict[str, np.ndarray]:
    """What sensors of the reduced scene show where its steps are halved k times, at the instants of those."""
    made, _ = bodies_of(scene, n, kind)
    return estimate_truths.motion(made, scene.h, 2**k)


def scenes() -> list[tuple[str, int, str]]:
    """Return all scenes of models/ with a flexible body: name, n, kind of the interfaces."""
    names = [*SCENES]
    return [(name, n, kind) for name in names for n in SCENES[name].n for kind in ("RBE3", "RBE2")]


def stored(path: Path, make: Callable[..., dict[str, Any]], *arguments: Any, end: float = np.inf) -> dict | None:
    """Return what a file has, made if it is not there; None: it is not, and it is later than `end`."""
    if not path.exists():
        if time.time() > end:
            return None
        part = path.with_suffix(".part")
        part.write_text(json.dumps(make(*arguments)), encoding="utf-8")
        part.replace(path)
    return json.loads(path.read_text(encoding="utf-8"))


def collected(folder: Path, count: int, limit: float = np.inf, processes: int = 1) -> list[dict[str, Any]]:
    """Return the results of all scenes and of seeds 0 to count - 1; none is begun after so many seconds."""
    folder.mkdir(parents=True, exist_ok=True)
    end = time.time() + limit
    tasks = [(folder / f"{name} {n} {kind}.json", of_scene, name, n, kind) for name, n, kind in scenes()]
    tasks += [(folder / f"seed {seed:04d}.json", of_seed, seed) for seed in range(count)]
    if processes == 1:
        found = [stored(*task, end=end) for task in tasks]
    else:
        with ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn")) as pool:
            found = [one.result() for one in [pool.submit(stored, *task, end=end) for task in tasks]]
    return [one for one in found if one is not None]


def options_of(about: str) -> argparse.ArgumentParser:
    """Return the options of what counts these results: about, its docstring."""
    parser = argparse.ArgumentParser(description=about.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path, help="where results are stored")
    parser.add_argument("--count", type=int, default=200, help="seeds")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--limit", type=float, default=np.inf, help="s, after which no scene is begun")
    parser.add_argument("--docs", action="store_true", help=f"write the table into {page.PAGE.name}")
    return parser


def collected_with(options: argparse.Namespace) -> list[dict[str, Any]]:
    """Return what `collected` does, with these options."""
    return collected(options.folder, options.count, options.limit, options.processes)


def _most(x: np.ndarray) -> float:
    return float(np.max(np.abs(x), initial=0.0))


def _saved(path: Path, seed: int) -> Path:
    if not path.exists():
        np.savez_compressed(path.with_suffix(".part.npz"), **kept_truth(seed, truth_of(seed)))
        path.with_suffix(".part.npz").replace(path)
    return path


def main(arguments: list[str] | None = None) -> None:
    """Make the truths of random mechanisms that are not in the folder yet, and put all into TRUTHS."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=160)
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args(arguments)
    options.folder.mkdir(parents=True, exist_ok=True)
    seeds = range(options.count)
    with ProcessPoolExecutor(options.processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        paths = list(pool.map(_saved, [options.folder / f"{i:04d}.npz" for i in seeds], seeds))
    put_together(paths, TRUTHS)


def put_together(paths: list[Path], target: Path) -> None:
    """Write the arrays of all files into one."""
    found = {}
    for path in paths:
        with np.load(path, allow_pickle=False) as file:
            found |= {name: file[name] for name in file.files}
    np.savez_compressed(target, **found)


if __name__ == "__main__":
    main()
