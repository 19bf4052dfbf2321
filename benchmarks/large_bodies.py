"""Offline work of large bodies by what factorises: SuperLU, PARDISO (pip install .[large]).

Bars 4 : 1 : 1 of hexahedra (models/hex_block.py). First the factorisation alone: of K, clamped at one end; the count
of eigenvalues (K - sigma M); 100 half solves. Then all that attach does to a pendulum of it, Craig-Bampton modes
(RBE2, 20 eigenmodes): scope coupled, vectors "auto", one output, and the first step. "Craig-Bampton": Exudyn's own
computation of these modes. Every task has a process of its own. N: coordinates less those of the clamped end. MB:
peak of resident memory, of the factor above that before, of attach and Craig-Bampton of the whole process, with
Exudyn, fem and modes.

    python benchmarks/large_bodies.py [--coordinates 13000 55000] [--tasks factor attach Craig-Bampton]      2 min
    python benchmarks/large_bodies.py --coordinates 107000 285000 --only pardiso                    15 min, 13 GB
"""

import argparse
import importlib.util
import os
import sys
from pathlib import Path
from time import process_time
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import numpy as np
from exudyn.FEM import FEMinterface, HCBstaticModeSelection
from scipy.sparse.linalg import LinearOperator, eigsh

import exudyn_romerr as romerr
from benchmarks import floating_cost, pairs
from benchmarks.child import child, resident, tell
from exudyn_romerr.linalg import symmetric_factor
from exudyn_romerr.linalg.symmetric_factor import SymmetricFactor, negative_eigenvalues
from exudyn_romerr.model.admissible_space import rigid_modes
from models import floating
from models.hex_block import hex_block

EIGENMODES, HALF_SOLVES = 20, 100
SIZES = (13_000, 55_000)  # coordinates
KINDS = ("superlu", *(["pardiso"] if importlib.util.find_spec("pymklpardiso") else []))
FIGURES = ("factor", "half solves", "count", "MB", "attach", "before, MB", "attach, MB")
FIGURES += ("Craig-Bampton", "Craig-Bampton, MB")
LIMITS = (3000.0, 18.0)  # s, GB of a process
SHIFT = 2 * np.pi * 3000.0  # rad/s; some modes are below


def block(coordinates: int) -> tuple[FEMinterface, list[np.ndarray], list[np.ndarray]]:
    """Return the bar nearest in size, its end faces and their weights."""
    counts = np.arange(2, 200)
    m = int(counts[np.argmin(np.abs(3 * (4 * counts + 1) * (counts + 1) ** 2 - coordinates))])
    fem = hex_block((4 * m, m, m))
    return fem, *(list(x) for x in zip(*(floating.interface(fem, name) for name in ("left", "right")), strict=True))


def reduced(fem: FEMinterface, faces: list[np.ndarray]) -> None:
    """Put the modes into fem that ComputeHurtyCraigBamptonModes makes (RBE2), faster."""
    M, K, place = fem.massMatrix, fem.stiffnessMatrix, fem.GetNodePositionsAsArray()
    held, moved = ((3 * nodes[:, None] + np.arange(3)).ravel() for nodes in faces)
    inner, V = np.setdiff1d(np.arange(place.size), [*held, *moved]), np.zeros((place.size, 6 + EIGENMODES))
    V[moved, :6] = rigid_modes(place[faces[1]] - place[faces[1]].mean(axis=0))
    own = K[inner][:, inner].tocsc()
    factor = SymmetricFactor(own)
    V[inner, :6] = -factor.solve((K @ V[:, :6])[inner])
    inverse = LinearOperator(own.shape, matvec=factor.solve, dtype=float)
    found = eigsh(own, EIGENMODES, M[inner][:, inner], sigma=0.0, OPinv=inverse, v0=np.ones(len(inner)))
    fem.eigenValues, V[inner, 6:] = found
    fem.modeBasis = {"matrix": V, "type": "HCBmodes"}


def child_factor(kind: str, coordinates: int) -> None:
    """Tell CPU seconds of factor, half solves and count, and memory."""
    fem, faces, _ = block(coordinates)
    free = np.setdiff1d(np.arange(3 * fem.NumberOfNodes()), (3 * faces[0][:, None] + np.arange(3)).ravel())
    M, K = (A[free][:, free].tocsc() for A in (fem.massMatrix, fem.stiffnessMatrix))
    symmetric_factor.solver = lambda n: kind
    tell("N", len(free))
    before = anew()
    begin = process_time()
    factor = SymmetricFactor(K)
    tell("factor", process_time() - begin)
    begin = process_time()
    factor.half_solve(np.ones((len(free), HALF_SOLVES)))
    tell("half solves", process_time() - begin)
    tell("MB", resident("VmHWM") - before)
    begin = process_time()
    negative_eigenvalues(K - SHIFT**2 * M)
    tell("count", process_time() - begin)


def child_attach(kind: str, coordinates: int) -> None:
    """Tell CPU seconds of attach and of the first step, and memory: before, and the peak of all."""
    fem, faces, weights = block(coordinates)
    tell("N", 3 * (fem.NumberOfNodes() - len(faces[0])))
    reduced(fem, faces)
    mbs, items = floating_cost.pendulum(fem, faces, weights)
    symmetric_factor.solver = lambda n: kind
    tell("before, MB", anew())
    begin = process_time()
    output = romerr.node_displacement("tip", node=int(faces[1][0]), component="z")
    monitor = romerr.attach(mbs, romerr.floating_body(fem, items), outputs=[output])
    mbs.Assemble()
    mbs.SolveDynamic(floating_cost.settings(1, 1e-4))
    monitor.report()
    tell("attach", process_time() - begin)
    tell("attach, MB", resident("VmHWM"))


def child_exudyn(_: str, coordinates: int) -> None:
    """Tell CPU seconds of Exudyn's own modes, and the peak of memory."""
    fem, faces, weights = block(coordinates)
    tell("N", 3 * (fem.NumberOfNodes() - len(faces[0])))
    kind, _, begin = HCBstaticModeSelection.RBE2, anew(), process_time()
    fem.ComputeHurtyCraigBamptonModes(faces, EIGENMODES, computationMode=kind, boundaryNodesWeights=weights)
    tell("Craig-Bampton", process_time() - begin)
    tell("Craig-Bampton, MB", resident("VmHWM"))


def anew() -> float:
    """Let the peak of resident memory start here; return MB."""
    Path("/proc/self/clear_refs").write_text("5")
    return resident("VmRSS")


def measured(kind: str, coordinates: int, tasks: tuple[str, ...]) -> dict[str, Any]:
    """Measure one body and kind."""
    found: dict[str, Any] = {"kind": kind}
    for task in tasks:
        found |= child(__file__, task, kind, str(coordinates), limits=LIMITS)
    return found


def text(found: list[dict[str, Any]]) -> str:
    """Return a table."""
    lines = [f"{'CPU seconds':>9}{'N':>9}" + "".join(f"{name:>{len(name) + 3}}" for name in FIGURES)]
    for row in found:
        values = "".join(
            f"{row[name]:{len(name) + 3}.{0 if 'MB' in name else 1}f}" if name in row else f"{'-':>{len(name) + 3}}"
            for name in FIGURES
        )
        lines.append(f"{row['kind']:<11}{row.get('N', 0):9d}{values}   {row.get('ended', '')}")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> list[dict[str, Any]] | None:
    """Measure and print; or be a child process."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--coordinates", type=int, nargs="+", default=SIZES)
    parser.add_argument("--only", nargs="+", choices=KINDS, default=KINDS, help="what factorises")
    parser.add_argument("--tasks", nargs="+", choices=TASKS, default=("factor", "attach"))
    parser.add_argument("--child", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.child:
        task, kind, coordinates = options.child
        return TASKS[task](kind, int(coordinates))
    found = [measured(kind, n, tuple(options.tasks)) for n in options.coordinates for kind in options.only]
    print(pairs.threads())
    print(text(found))
    return found


TASKS = {"factor": child_factor, "attach": child_attach, "Craig-Bampton": child_exudyn}

if __name__ == "__main__":
    main()
