"""All estimators side by side on the stabiliser linkage and on a solid body; tables for docs/measured.md, a figure.

Over one minute with everything; --quick takes ten seconds and prints only:

    python benchmarks/estimators.py [--quick]
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

# One thread: small matrices, and CPU times that can be compared. Read when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from time import process_time

import numpy as np

import exudyn_romerr as romerr
from benchmarks import page
from benchmarks.estimator_pages import Measured, Refined, all_tables, draw
from exudyn_romerr.linear.estimators import ESTIMATORS
from exudyn_romerr.linear.run.prepare import BoundOptions, prepare
from exudyn_romerr.linear.run.run import BLOCK, Run
from models import exact, linkage, solid_bar
from models.solid_exact import full_outputs, reduced_motion

ONCE = ("state-space", "fast", "convolution", "energy")
CASES = [(e, 20) for e in ONCE if e in ESTIMATORS] + [("auxiliary", 20), ("auxiliary", 40)]
TIMES = ("sampled", "reconstructed")
SOLID_W = 2 * np.pi * 100.0  # rad/s; the first mode is at 174 Hz


@dataclass(frozen=True)
class Scene:
    """A body, how to make it anew, its basis, and exact motions.

    dense: samples at which the reduced motion is exact; steps: those of the trapezoidal rule.
    """

    title: str
    make_body: Callable
    basis: romerr.Basis
    inputs: np.ndarray
    output: romerr.Output
    load: Callable
    reduced: exact.ForcedModes
    truth: Callable
    dense: np.ndarray
    steps: np.ndarray

    def options(self, e: str, m: int, time: str) -> dict:
        """Return the keyword arguments of evaluate and BoundOptions."""
        return {
            "inputs": self.inputs,
            "input_function": self.load,
            "outputs": [self.output],
            "estimators": e,
            "auxiliary_modes": m,
            "time": time,
        }

    def exact_trajectory(self) -> romerr.Trajectory:
        """Return the exact reduced motion at the dense samples."""
        return romerr.Trajectory(self.dense, *self.reduced.motion(self.dense), self.load(self.dense))


def linkage_scene(quick: bool) -> Scene:
    """Return the paper's example, Krylov basis of 12."""
    body, inputs, output = linkage.build()
    basis = romerr.krylov_basis(body, inputs, 12)
    W, force = 2 * np.pi * linkage.FREQUENCY, linkage.AMPLITUDE
    full = exact.full_solution(body, inputs, force, W)
    rows, end = output.resolve(body), 0.1 if quick else 2.0
    return Scene(
        f"Stabiliser linkage, {body.N} coordinates, Krylov basis n = 12, 100 N at 1 Hz",
        lambda: linkage.build()[0],
        basis,
        inputs,
        output,
        linkage.force,
        exact.reduced_solution(body, basis, inputs, force, W),
        lambda t: full.output(rows, t),
        # 0.3 rad of the fastest reduced mode: twice as long steps make the sampled residual miss 2 % of its bound
        dense=grid(end / 4, 2e-5),
        steps=grid(end, 1e-3),
    )


def solid_scene(quick: bool) -> Scene:
    """Return the notched bar, Craig-Bampton basis of 6 + 6."""
    body, inputs, outputs = solid_bar.build()
    basis = solid_bar.craig_bampton(body, 6)
    end = 0.01 if quick else 0.04
    return Scene(
        f"Solid bar, {body.N} coordinates, Craig-Bampton basis n = 6 + 6, 1 N at 100 Hz",
        lambda: solid_bar.build()[0],
        basis,
        inputs,
        outputs[0],
        solid_load,
        reduced_motion(body, basis, inputs, SOLID_W),
        full_outputs(body, inputs, outputs[0].resolve(body), SOLID_W),
        dense=grid(end / 2, 2e-6),
        steps=grid(end, 5e-5),
    )


def grid(end: float, h: float) -> np.ndarray:
    """Return equal steps of h (s) from 0 to end."""
    return np.linspace(0, end, round(end / h) + 1)


def solid_load(t):
    """Return the tip force in N."""
    return np.sin(SOLID_W * t)


def trapezoidal(scene: Scene) -> romerr.Trajectory:
    """Return the reduced motion by the trapezoidal rule (Newmark's with average acceleration), from rest."""
    body, V, t = scene.make_body(), scene.basis.V, scene.steps
    full = (body.mass, body.rayleigh[0] * body.mass + body.rayleigh[1] * body.stiffness, body.stiffness)
    M, D, K = (V.T @ (matrix @ V) for matrix in full)
    h, force = t[1] - t[0], scene.load(t)[:, None] * (V.T @ scene.inputs)[:, 0]
    step = np.linalg.inv(M + h / 2 * D + h**2 / 4 * K)
    q, v, a = np.zeros((3, *force.shape))
    a[0] = np.linalg.solve(M, force[0])
    for k in range(len(t) - 1):
        q_ahead, v_ahead = q[k] + h * v[k] + h**2 / 4 * a[k], v[k] + h / 2 * a[k]
        a[k + 1] = step @ (force[k + 1] - D @ v_ahead - K @ q_ahead)
        q[k + 1], v[k + 1] = q_ahead + h**2 / 4 * a[k + 1], v_ahead + h / 2 * a[k + 1]
    return romerr.Trajectory(t, q, v, a, scene.load(t))


def measured(scene: Scene, e: str, m: int, repeats: int) -> Measured:
    """Return one line of a table."""
    body, stepped = scene.make_body(), trapezoidal(scene)
    reduction = compared(scene, body, scene.exact_trajectory(), e, m, "sampled")
    total = compared(scene, body, stepped, e, m, "reconstructed")
    return Measured(
        name=f"{e}, {m} modes" if e == "auxiliary" else e,
        reduction=float(reduction.effectivity[e][0]),
        total=float(total.effectivity[e][0]),
        reduction_error=float(np.max(np.abs(reduction.error))),
        total_error=float(np.max(np.abs(total.error))),
        violation=max(excess(reduction, e), excess(total, e)),
        offline=median(offline_seconds(scene, e, m) for _ in range(repeats)),
        online=tuple(online_seconds(scene, body, stepped, e, m, time, repeats) for time in TIMES),
        curve=(total.error[:, 0], total.bound[e][:, 0]),
    )


def compared(scene: Scene, body, traj: romerr.Trajectory, e: str, m: int, time: str) -> romerr.OutputReport:
    """Return the output's bound beside its true error."""
    report = romerr.evaluate(body, scene.basis, traj, **scene.options(e, m, time))
    return report.compare(scene.output.name, traj.t, scene.truth(traj.t))


def excess(out: romerr.OutputReport, e: str) -> float:
    """Return how far the true error exceeds the bound, as a share of the output (rounding of the truth: 1e-10)."""
    return float(np.max(np.abs(out.error) - out.bound[e]) / np.max(np.abs(out.value)))


def offline_seconds(scene: Scene, e: str, m: int) -> float:
    """Return the CPU time of the offline part on a body that knows no modes yet."""
    body = scene.make_body()
    before = process_time()
    prepare(body, scene.basis, BoundOptions(**scene.options(e, m, "reconstructed")))
    return process_time() - before


def online_seconds(scene: Scene, body, traj: romerr.Trajectory, e: str, m: int, time: str, repeats: int) -> float:
    """Return the CPU time per step of the online part, median."""
    offline = prepare(body, scene.basis, BoundOptions(**scene.options(e, m, time)))
    times = []
    for _ in range(2 * repeats + 1):
        before = process_time()
        feed(Run(offline), traj)
        times.append((process_time() - before) / (len(traj.t) - 1))
    return median(times)


def feed(run: Run, traj: romerr.Trajectory) -> None:
    """Give a trajectory to a run in blocks, as the hook does."""
    states = (traj.t, traj.q, traj.q_t, traj.q_tt)
    run.start(*(x[0] for x in states))
    for first in range(1, len(traj.t), BLOCK):
        run.extend(*(x[first : first + BLOCK] for x in states))


def refined(level: int, end: float = 0.01) -> Refined:
    """Return the effectivities of a modal basis of 12 on one mesh."""
    body, inputs, outputs = solid_bar.build(level)
    basis, t = romerr.modal_basis(body, 12), grid(end, 1e-5)
    truth = full_outputs(body, inputs, outputs[0].resolve(body), SOLID_W, modes=None if level == 0 else 100)
    traj = romerr.Trajectory(t, *reduced_motion(body, basis, inputs, SOLID_W).motion(t), solid_load(t))
    names = ("fast", "convolution", "energy", "auxiliary")
    options = {"inputs": inputs, "input_function": solid_load, "outputs": outputs[:1]}
    report = romerr.evaluate(body, basis, traj, estimators=names, auxiliary_modes=40, **options)
    out = report.compare("tip z", t, truth(t)[:, 0])
    return Refined(body.N, float(np.max(np.abs(out.error))), {e: float(out.effectivity[e][0]) for e in names})


def heading(scene: Scene) -> str:
    """Return the title with the samples of both runs."""
    dense, steps = (f"{t[-1]:g} s in steps of {t[1] - t[0]:.2g} s" for t in (scene.dense, scene.steps))
    return f"{scene.title} (reduction: {dense}; total: {steps})"


def main(arguments: list[str] | None = None) -> None:
    """Measure, print, and write unless --quick."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="short runs, two meshes; nothing is written")
    quick = parser.parse_args(arguments).quick
    tables = {}
    for scene in (linkage_scene(quick), solid_scene(quick)):
        tables[heading(scene)] = [measured(scene, e, m, 1 if quick else 5) for e, m in CASES]
    meshes = [refined(level) for level in solid_bar.LEVELS[: 2 if quick else 3]]
    text = all_tables(tables, meshes)
    print(text)
    if not quick:
        page.put("estimators", text)
        draw(scene.steps, tables[heading(scene)], meshes, page.FIGURES / "estimators.png")


if __name__ == "__main__":
    main()
