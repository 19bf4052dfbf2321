"""Offline work by phases, beside Exudyn's own computation of modes of the same body.

Counted: attach, reading the assembled mbs, the first solve of one step. The mbs is read again whenever a solve begins
("a second solve begins in"). Phases do not overlap: what one calls of another is taken off.

    python benchmarks/offline.py [--quick | --large]     default 1 min; --quick: the stored arm only; needs ngsolve
    python benchmarks/offline.py --profile NAME          cProfile of one case: arm, frozen or coupled
"""

import argparse
import cProfile
import importlib.util
import os
import pstats
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cache, wraps
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple
from unittest.mock import patch
from weakref import WeakKeyDictionary

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import numpy as np
import scipy.linalg as la
from exudyn.FEM import FEMinterface, HCBstaticModeSelection

import exudyn_romerr as romerr
from benchmarks import floating_cost, large_bodies, pairs
from examples import wishbone_suspension
from exudyn_romerr.linalg import eigenmodes as modes
from exudyn_romerr.linalg.symmetric_factor import SymmetricFactor
from exudyn_romerr.model import shared_body
from exudyn_romerr.model.body import ElasticBody
from models import floating, wishbone

PROMISED = 2.0  # offline time over that of Exudyn's Craig-Bampton modes, 45,000 coordinates and 20 modes
MESH, LARGE = 10_000, 45_000  # coordinates
EIGENMODES = 20  # of Exudyn's, for comparison
FACTORS = {"factor K": "stiffness_factor", "factor M": "mass_factor"}  # of ElasticBody
FUNCTIONS = {
    "matrices checked, conditions put in": [(ElasticBody, "__init__")],
    "eigenmodes (Lanczos, K factored)": [(modes, "eigsh")],
    "no mode missed (K - sigma M factored)": [(modes, "count_below")],
    "solves with K and M": [(SymmetricFactor, "solve")],
    "half solves, for norms in K^-1, M^-1": [(SymmetricFactor, "half_solve")],
    "products, for norms in K and M": [(SymmetricFactor, "half_multiply")],
    "orthonormalisation": [(np.linalg, "qr"), (la, "qr")],
}
WHOLE = ("eigenmodes (Lanczos, K factored)", "no mode missed (K - sigma M factored)")  # with the solves they call
PHASES = (*FACTORS, *FUNCTIONS)


class Stopwatch:
    """Seconds by phase, without those of phases within."""

    def __init__(self) -> None:
        self.spent: Counter = Counter()
        self._open: list[str] = []

    @contextmanager
    def running(self) -> Iterator[None]:
        """Time all PHASES of the package within the block."""
        with ExitStack() as patches:
            for label, name in FACTORS.items():
                prop = vars(ElasticBody)[name]  # a cached_property
                patches.enter_context(patch.object(prop, "func", self._timed(label, prop.func)))
            for label, places in FUNCTIONS.items():
                for owner, name in places:
                    patches.enter_context(patch.object(owner, name, self._timed(label, getattr(owner, name))))
            yield

    def _timed(self, label: str, function: Callable) -> Callable:
        @wraps(function)
        def wrapped(*args: Any, **options: Any) -> Any:
            if self._open and self._open[-1] in WHOLE:
                return function(*args, **options)
            self._open.append(label)
            begin = perf_counter()
            try:
                return function(*args, **options)
            finally:
                seconds = perf_counter() - begin
                self._open.pop()
                self.spent[label] += seconds
                if self._open:
                    self.spent[self._open[-1]] -= seconds

        return wrapped


class Case(NamedTuple):
    """A scene before attach: its fem with modes, mbs, items of the body, output, options of attach, settings."""

    fem: FEMinterface
    mbs: Any
    items: dict[str, int]
    output: romerr.Output
    options: dict
    settings: Any
    faces: tuple[list, list]


class Offline(NamedTuple):
    """Seconds: by phase, in all, of the begin of a second solve, of Exudyn's two mode computations."""

    name: str
    dof: int
    phases: dict[str, float]
    total: float
    again: float
    craig_bampton: float
    eigenmodes: float


def arm() -> Case:
    """Return the quarter car, default bounds of its ball joint."""
    basis, n = wishbone_suspension.SHOWN
    scene = wishbone.quarter_car(n, "RBE3", wishbone_suspension.BASES[basis][1], h=5e-4, t_end=5e-4)
    nodes, weights = floating.interface(scene.fem, "ball")
    output = romerr.mean_displacement("ball joint", nodes=nodes, weights=weights)
    faces = tuple(zip(*(floating.interface(scene.fem, name) for name in ("front", "rear")), strict=True))
    return Case(scene.fem, scene.mbs, scene.bodies[0], output, {}, scene.settings, faces)


@cache
def mesh(dof: int) -> FEMinterface:
    """Return a mesh of floating_cost.py, made once."""
    return floating_cost.meshed(dof)


def bar(dof: int, options: dict) -> Case:
    """Return the pendulum of floating_cost.py of about so many coordinates."""
    fem = mesh(dof)
    faces = [fem.GetNodesInPlane([x, 0, 0], [1, 0, 0]) for x in (0.0, floating_cost.BAR[0])]
    weights = [fem.GetNodeWeightsFromSurfaceAreas(nodes) for nodes in faces]
    craig_bampton(fem, (faces, weights), floating_cost.MODES)
    mbs, items = floating_cost.pendulum(fem, faces, weights)
    output = romerr.node_displacement("tip", node=int(faces[1][0]), component="z")
    return Case(fem, mbs, items, output, options, floating_cost.settings(1, 1e-4), (faces, weights))


def craig_bampton(fem: FEMinterface, faces: tuple, n: int) -> float:
    """Compute Exudyn's modes into fem; return seconds."""
    begin = perf_counter()
    kind = HCBstaticModeSelection.RBE3
    fem.ComputeHurtyCraigBamptonModes(faces[0], n, computationMode=kind, boundaryNodesWeights=faces[1])
    return perf_counter() - begin


def cases(quick: bool, large: bool) -> dict[str, Callable[[], Case]]:
    """Return what is measured; without ngsolve the stored arm only."""
    frozen = {"scope": "inputs frozen", "auxiliary_modes": floating_cost.AUXILIARY}
    chosen = {"arm": arm}
    if not quick and importlib.util.find_spec("ngsolve"):
        chosen |= {"frozen": lambda: bar(MESH, frozen), "coupled": lambda: bar(MESH, {})}
        chosen |= {"large": lambda: bar(LARGE, frozen)} if large else {}
    return chosen


def begun(case: Case) -> None:
    """Attach, assemble, and make one step."""
    flex = romerr.floating_body(case.fem, case.items)
    monitor = romerr.attach(case.mbs, flex, outputs=[case.output], **case.options)
    case.mbs.Assemble()
    case.mbs.SolveDynamic(case.settings)
    monitor.report()


@contextmanager
def nothing_kept() -> Iterator[None]:
    """Find nothing of what was made of the same fem before."""
    with (
        patch.object(shared_body, "_MADE", WeakKeyDictionary()),
        patch.object(shared_body, "_RESULTS", WeakKeyDictionary()),
    ):
        yield


def measured(name: str, case: Case) -> Offline:
    """Measure one case; Exudyn's modes come last, for they replace those of the fem."""
    watch = Stopwatch()
    with nothing_kept():
        with watch.running():
            begin = perf_counter()
            begun(case)
            total = perf_counter() - begin
        begin = perf_counter()
        case.mbs.SolveDynamic(case.settings)
        again = perf_counter() - begin
    seconds = craig_bampton(case.fem, case.faces, EIGENMODES)
    begin = perf_counter()
    case.fem.ComputeEigenmodes(EIGENMODES, excludeRigidBodyModes=6)
    return Offline(
        name,
        3 * case.fem.NumberOfNodes(),
        {phase: watch.spent[phase] for phase in PHASES} | {"all else": total - sum(watch.spent.values())},
        total,
        again,
        seconds,
        perf_counter() - begin,
    )


def text(found: list[Offline]) -> str:
    """Return a table, one column a case."""
    lines = [f"{'seconds':<42}" + "".join(f"{f'{case.name}, {case.dof}':>16}" for case in found)]
    rows = {phase: [case.phases[phase] for case in found] for phase in (*PHASES, "all else")}
    rows["in all"] = [case.total for case in found]
    rows["a second solve begins in"] = [case.again for case in found]
    rows[f"Exudyn's Craig-Bampton, {EIGENMODES} eigenmodes"] = [case.craig_bampton for case in found]
    rows[f"Exudyn's {EIGENMODES} free eigenmodes"] = [case.eigenmodes for case in found]
    rows["in all / Craig-Bampton"] = [case.total / case.craig_bampton for case in found]
    return "\n".join([*lines, *(f"{name:<42}" + "".join(f"{x:16.2f}" for x in row) for name, row in rows.items())])


def main(arguments: list[str] | None = None) -> list[Offline]:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--quick", action="store_true", help="the stored arm only")
    parser.add_argument("--large", action="store_true", help=f"a mesh of {LARGE} coordinates, large_bodies.py")
    parser.add_argument("--profile", metavar="NAME", help="profile one case instead")
    options = parser.parse_args(arguments)
    chosen = cases(options.quick, options.large)
    if options.profile:
        case, profile = chosen[options.profile](), cProfile.Profile()
        profile.runcall(begun, case)
        pstats.Stats(profile).sort_stats("cumulative").print_stats(60)
        return []
    found = [measured(name, make()) for name, make in chosen.items()]
    print(pairs.threads())
    print(text(found))
    if options.large:
        large_bodies.main([])
    return found


if __name__ == "__main__":
    main()
