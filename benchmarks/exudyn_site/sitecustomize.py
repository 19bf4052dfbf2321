"""What stands around Exudyn's own scripts in exudyn_examples.py, bare and watched alike; Python imports it at start.

Names that older scripts take from exudyn.utilities and Exudyn 1.13 no longer has there; a start vector for scipy's
eigenvalue solver, which begins with random numbers, so that two runs can be compared bit by bit; and states and
sensors after each solve, written to the file that ROMERR_STATES names when the process ends.
"""

import atexit
import os
import sys
from contextlib import ExitStack
from functools import wraps
from importlib import import_module
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[2]))
from exudyn_romerr.scripts.after_import import after_import

NAMES = {
    "math": ("sin", "cos", "tan", "pi", "sqrt"),
    "exudyn.basicUtilities": ("VSum", "VAdd", "VSub", "VMult", "ScalarMult", "NormL2", "Normalize", "Vec2Tilde"),
}
STATES = ("ODE2Coordinates", "ODE2Coordinates_t", "ODE1Coordinates", "AECoordinates", "DataCoordinates")
SOLVERS = ("MainSolverImplicitSecondOrder", "MainSolverExplicit", "MainSolverStatic")
OWN = {
    "VSum": sum,
    "VAdd": lambda a, b: [x + y for x, y in zip(a, b, strict=True)],
    "VSub": lambda a, b: [x - y for x, y in zip(a, b, strict=True)],
}
kept = {}


def with_names(utilities):
    """Give a module the names that it once had."""
    for module, names in NAMES.items():
        source = import_module(module)
        for name in names:
            if not hasattr(utilities, name):
                found = getattr(source, name, OWN.get(name))
                if found is not None:
                    setattr(utilities, name, found)
                    if hasattr(utilities, "__all__"):
                        utilities.__all__.append(name)


def with_start(linalg):
    """Let eigsh begin with the same vector each time."""
    linalg.eigsh = started(linalg.eigsh)


def started(eigsh):
    """Return scipy's eigsh with a start vector that is the same each time."""

    @wraps(eigsh)
    def call(A, *arguments, **options):
        import numpy as np

        options.setdefault("v0", np.random.default_rng(0).standard_normal(A.shape[0]))
        return eigsh(A, *arguments, **options)

    return call


def keeping(exudyn):
    """Keep states and sensors after each solve."""
    for name in SOLVERS:
        solver = getattr(exudyn, name)
        solver.SolveSystem = _kept(solver.SolveSystem)


def _kept(solve):
    @wraps(solve)
    def call(solver, mbs, *arguments, **options):
        try:
            return solve(solver, mbs, *arguments, **options)
        finally:
            keep(mbs)

    return call


def keep(mbs):
    """Copy states and sensors of an mbs."""
    import numpy as np

    number = kept["solves"] = kept.get("solves", 0) + 1
    for name in STATES:
        kept[f"{number} {name}"] = np.array(getattr(mbs.systemData, f"Get{name}")())
    for i in range(mbs.systemData.NumberOfSensors()):
        stored = mbs.GetSensor(i).get("storeInternal")
        kept[f"{number} sensor {i}"] = np.array(mbs.GetSensorStoredData(i) if stored else mbs.GetSensorValues(i))


def write(process, path):
    """Write what was kept; not in processes that a script has forked."""
    if kept and os.getpid() == process:
        import numpy as np

        np.savez(path, **kept)


if path := os.environ.get("ROMERR_STATES"):
    stack = ExitStack()
    for module, function in (
        ("exudyn.utilities", with_names),
        ("scipy.sparse.linalg", with_start),
        ("exudyn", keeping),
    ):
        stack.enter_context(after_import(module, function))
    atexit.register(write, os.getpid(), path)
