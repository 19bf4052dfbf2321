"""How the cost of bounds grows: with n, the number of outputs, the size N of the mesh, and the steps.

n and outputs: the clamped solid bar of models/solid_bar.py (1113 coordinates) in Exudyn, steps of 0.1 ms, paired runs
(pairs.py). N: the same bar meshed finer; the three coarsest meshes are stored, others need ngsolve (pip install
.[mesh]). Every mesh and every long run has a process of its own, for its peak of resident memory (VmHWM, Linux), with
limits of time and memory. Steps: the linkage of online_linkage.py.

    python benchmarks/growth.py [--quick | --large]     default 3 min; --large: N up to 3e5, many minutes
"""

import argparse
import os
import sys
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import exudyn as exu
import numpy as np

import exudyn_romerr as romerr
from benchmarks import online_linkage, pairs
from benchmarks.child import child, resident, tell
from models import solid_bar

BASIS, STEP, W = 12, 1e-4, 2 * np.pi * 100.0  # columns, s, rad/s
COUNTS, OUTPUTS = (6, 12, 25, 50, 100, 200), (1, 3, 10, 30, 100)
LENGTHS = (100, 1000, 1024, 10_000)  # steps; blocks have 1024
STORED = {1113: 0, 3231: 1, 9885: 2}  # coordinates: level of models/solid_bar.py
SIZES, LARGE = (*STORED, 30_000), (100_000, 300_000)
STEPS = (100_000, 1_000_000)
MEMORY = 300.0  # MB above the bare run, for 1e6 steps: what issue 7 asks for
PAPER = {"time": "sampled", "estimators": ("fast", "convolution")}
SHARP = {"estimators": ("energy", "auxiliary"), "auxiliary_modes": 20}
KINDS = ("fast + convolution, sampled", "energy + auxiliary 20, reconstructed")


class Solid(NamedTuple):
    """What an engineer has: matrices, positions, clamped coordinates, nodes and weights of the tip face."""

    mass: Any
    stiffness: Any
    positions: np.ndarray
    fixed: np.ndarray
    tip: np.ndarray
    weights: np.ndarray

    def body(self) -> romerr.ElasticBody:
        """Return the body, checked."""
        return romerr.ElasticBody(
            self.mass, self.stiffness, rayleigh=solid_bar.RAYLEIGH, fixed=self.fixed, positions=self.positions
        )

    def inputs(self) -> np.ndarray:
        """Return 1 N in z, spread over the tip face."""
        B = np.zeros((self.mass.shape[0], 1))
        B[3 * self.tip + 2, 0] = self.weights / self.weights.sum()
        return B


def solid(dof: int) -> Solid:
    """Return the bar with about so many coordinates: a stored mesh, or one by ngsolve."""
    if dof in STORED:
        mesh = solid_bar.read_mesh(STORED[dof])
        matrices, weights = solid_bar.matrices(mesh.nodes, mesh.tets), solid_bar.face_weights(mesh, mesh.tip)
        return Solid(*matrices, mesh.nodes, _coordinates(mesh.clamped), mesh.tip, weights)
    from models import make_solid_bar

    size = make_solid_bar.MESH_SIZES[-1] * (max(STORED) / dof) ** (1 / 3)
    fem = make_solid_bar.imported(make_solid_bar.geometry().GenerateMesh(maxh=size))
    clamped, tip = (np.array(fem.GetNodesInPlane([x, 0, 0], [1, 0, 0])) for x in (0.0, solid_bar.SIZE[0]))
    matrices = fem.GetMassMatrix(sparse=True), fem.GetStiffnessMatrix(sparse=True)
    weights = np.asarray(fem.GetNodeWeightsFromSurfaceAreas(tip))
    return Solid(*matrices, fem.GetNodePositionsAsArray(), _coordinates(clamped), tip, weights)


def _coordinates(nodes: np.ndarray) -> np.ndarray:
    return (3 * np.asarray(nodes)[:, None] + np.arange(3)).ravel()


@cache
def _coarse() -> tuple[Solid, romerr.ElasticBody]:
    bar = solid(min(STORED))
    return bar, bar.body()


class Linear(pairs.Variant):
    """The bar with `n` modes, `outputs` nodes observed; options of attach, or None: without bounds."""

    def __init__(self, bar: Solid, basis: tuple, outputs: int, steps: int, options: dict | None):
        self.body, self.basis = basis
        self.bar, self.outputs, self.options = bar, outputs, options
        self.settings = pairs.quiet(exu.SimulationSettings(), steps, STEP)
        self.mbs = exu.SystemContainer().AddSystem()
        self.timed_prepare()
        self.mbs.Assemble()

    def prepare(self) -> None:
        """Add the body, attach the monitor."""
        load = {"inputs": self.bar.inputs(), "input_function": lambda t: np.sin(W * t)}
        flex = romerr.add_reduced_body(self.mbs, self.body, self.basis, **load)
        if self.options is None:
            self.finish = lambda: None
            return
        nodes = np.linspace(0, len(self.bar.positions) - 1, self.outputs).astype(int)
        seen = [romerr.node_displacement(f"{i}", node=int(node), component="z") for i, node in enumerate(nodes)]
        self.monitor = romerr.attach(self.mbs, flex, outputs=seen, **self.options)
        self.finish = self.monitor.report


def online(n: int, outputs: int, steps: int, rounds: int) -> tuple[float, float, float]:
    """Return CPU us a step: of the simulation, added by the paper's bounds, added by the sharp ones."""
    bar, body = _coarse()
    basis = body, romerr.modal_basis(body, n)
    variants = [Linear(bar, basis, outputs, steps, options) for options in (None, PAPER, SHARP)]
    times = pairs.measure(variants, rounds)
    return 1e6 * float(np.median(times[:, 0])) / steps, *map(float, pairs.added(variants, times)[1:])


def child_mesh(dof: int) -> None:
    """Do the offline work of one mesh, phase by phase, and 500 steps."""
    bar = solid(dof)
    tell("N", bar.mass.shape[0])
    Path("/proc/self/clear_refs").write_text("5")  # VmHWM starts anew
    before, begin = resident("VmRSS"), perf_counter()
    body = bar.body()
    tell("body", perf_counter() - begin)
    begin = perf_counter()
    basis = body, romerr.modal_basis(body, BASIS)
    tell("modes", perf_counter() - begin)
    sharp = Linear(bar, basis, 1, 500, {"auxiliary_modes": SHARP["auxiliary_modes"]})
    tell("attach", sharp.offline)
    tell("memory", resident("VmHWM") - before)
    variants = [Linear(bar, basis, 1, 500, None), sharp]
    tell("online", float(pairs.added(variants, pairs.measure(variants, 5))[1]))


def child_steps(kind: str, steps: int) -> None:
    """Run the linkage for so many steps and ask for the report."""
    variant = getattr(online_linkage, kind)(steps * online_linkage.STEP)
    variant.seconds()
    tell("memory", resident("VmHWM"))


class Growth(NamedTuple):
    """counts, outputs, lengths, steps: by their number; sizes: as child_mesh tells."""

    counts: dict[int, tuple]
    outputs: dict[int, tuple]
    lengths: dict[int, tuple]
    sizes: list[dict]
    steps: dict[int, dict[str, dict]]


def measured(quick: bool = False, large: bool = False) -> Growth:
    """Measure all four."""
    steps, rounds = (200, 1) if quick else (2000, 5)
    few = slice(None, None, 3) if quick else slice(None)
    sizes = (min(STORED),) if quick else (*SIZES, *(LARGE if large else ()))
    return Growth(
        counts={n: online(n, 1, steps, rounds) for n in COUNTS[few]},
        outputs={r: online(BASIS, r, steps, rounds) for r in OUTPUTS[few]},
        lengths={length: online(BASIS, 1, length, rounds) for length in LENGTHS[few]},
        sizes=[{"asked": dof, **child(__file__, "mesh", str(dof))} for dof in sizes],
        steps={
            count: {kind: child(__file__, "steps", kind, str(count)) for kind in ("Bare", "Bounds", "SharpBounds")}
            for count in ((2000,) if quick else STEPS)
        },
    )


def above(runs: dict[str, dict]) -> dict[str, float]:
    """Return MB of resident memory above the bare run, of each kind of bounds."""
    return {kind: run.get("memory", np.inf) - runs["Bare"]["memory"] for kind, run in runs.items() if kind != "Bare"}


def text(found: Growth) -> str:
    """Return four tables."""
    lines = [f"{'CPU us a step, medians':<24}{'simulation':>12}{KINDS[0]:>32}{KINDS[1]:>40}"]
    rows = {f"n = {n}": row for n, row in found.counts.items()}
    rows |= {f"{r} outputs, n = {BASIS}": row for r, row in found.outputs.items()}
    rows |= {f"{length} steps, n = {BASIS}": row for length, row in found.lengths.items()}
    lines += [f"{name:<24}{a:12.1f}{b:+32.1f}{c:+40.1f}" for name, (a, b, c) in rows.items()]
    heads = f"{'N':>8}{'body / s':>10}{'modes / s':>11}{'attach / s':>12}{'peak / MB':>11}{'online / us a step':>20}"
    lines += ["", heads, *map(_size_line, found.sizes)]
    lines += [
        "",
        f"{'resident MB, steps':>20}{'bare run':>10}{'+ fast, convolution':>22}{'+ energy, auxiliary 40':>25}",
    ]
    for count, runs in found.steps.items():
        more = above(runs)
        lines.append(f"{count:20d}{runs['Bare']['memory']:10.0f}{more['Bounds']:+22.0f}{more['SharpBounds']:+25.0f}")
    return "\n".join(lines)


def _size_line(size: dict) -> str:
    widths = {"body": (10, 2), "modes": (11, 2), "attach": (12, 2), "memory": (11, 0), "online": (20, 1)}
    told = "".join(f"{size[name]:{w}.{d}f}" for name, (w, d) in widths.items() if name in size)
    return f"{size.get('N', size['asked']):8.0f}{told}  {size.get('ended', '')}".rstrip()


def main(arguments: list[str] | None = None) -> Growth | None:
    """Measure and print; or be a child process."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--quick", action="store_true", help="seconds")
    parser.add_argument("--large", action="store_true", help=f"N up to {max(LARGE)}")
    parser.add_argument("--child", nargs="+", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.child:
        kind, *rest = options.child
        return {"mesh": child_mesh, "steps": child_steps}[kind](*(int(x) if x.isdigit() else x for x in rest))
    found = measured(options.quick, options.large)
    print(pairs.threads())
    print(text(found))
    return found


if __name__ == "__main__":
    main()
