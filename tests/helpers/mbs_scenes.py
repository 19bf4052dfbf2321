"""A random chain of masses as an elastic body, and what every test of mbs/ needs around it."""

import exudyn as exu
import numpy as np

from exudyn_romerr import add_reduced_body, attach
from exudyn_romerr.basis.basis import Basis
from exudyn_romerr.model.body import ElasticBody
from exudyn_romerr.model.outputs import Output

N = 8


def chain_body(seed=0):
    rng = np.random.default_rng(seed)
    K = np.diag(rng.uniform(500, 1000, N))
    for i, k in enumerate(rng.uniform(300, 900, N - 1)):
        K[i : i + 2, i : i + 2] += k * np.array([[1, -1], [-1, 1]])
    return ElasticBody(np.diag(rng.uniform(0.5, 2, N)), K, rayleigh=(0.1, 0.01))


def random_basis(n=3, seed=1, galerkin=True):
    rng = np.random.default_rng(seed)
    V = np.linalg.qr(rng.standard_normal((N, n)))[0]
    return Basis(V, None if galerkin else V + 0.3 * rng.standard_normal(V.shape))


def force(t):
    return np.cos(5 * t)


INPUTS = np.eye(N)[:, [5]]
TIP = Output("tip", np.eye(N)[7], unit="m")


def new_mbs():
    return exu.SystemContainer().AddSystem()


def added(mbs=None, basis=None, input_function=force, initial=None):
    """Return (mbs, flex): the chain in an mbs, which is not assembled yet."""
    mbs, basis = new_mbs() if mbs is None else mbs, random_basis() if basis is None else basis
    options = {"inputs": INPUTS, "input_function": input_function, "initial": initial}
    return mbs, add_reduced_body(mbs, chain_body(), basis, **options)


def scene(basis=None, mbs=None, input_function=force, initial=None, **options):
    """Return (mbs, flex, monitor), assembled."""
    mbs, flex = added(mbs, basis, input_function, initial)
    monitor = attach(mbs, flex, **{"outputs": [TIP], **options})
    mbs.Assemble()
    return mbs, flex, monitor


def settings(steps=20, end=0.1, start=0.0):
    ss = exu.SimulationSettings()
    ss.timeIntegration.numberOfSteps = steps
    ss.timeIntegration.startTime = start
    ss.timeIntegration.endTime = end
    ss.timeIntegration.verboseMode = 0
    ss.staticSolver.verboseMode = 0
    ss.staticSolver.numberOfLoadSteps = 4
    ss.solution.file.write = False
    return ss


SOLVERS = {
    "generalised-alpha": lambda mbs, ss: mbs.SolveDynamic(ss),
    "trapezoidal": lambda mbs, ss: mbs.SolveDynamic(ss, solverType=exu.DynamicSolverType.TrapezoidalIndex2),
    "DOPRI5": lambda mbs, ss: mbs.SolveDynamic(ss, solverType=exu.DynamicSolverType.DOPRI5),
    "RK44": lambda mbs, ss: mbs.SolveDynamic(ss, solverType=exu.DynamicSolverType.RK44),
    "static": lambda mbs, ss: mbs.SolveStatic(ss),
}


class Recorder:
    """A PostStep function that notes every call."""

    def __init__(self, result=True, stop_at=np.inf, error=None):
        self.t, self.states = [], []
        self.result, self.stop_at, self.error = result, stop_at, error

    def __call__(self, mbs, t):
        system = mbs.systemData
        self.t.append(t)
        self.states.append(
            (system.GetODE2Coordinates(), system.GetODE2Coordinates_t(), system.GetODE2Coordinates_tt())
        )
        if t < self.stop_at - 1e-12:
            return True
        if self.error is not None:
            raise self.error
        return self.result

    def rows(self, k):
        """q, q_t or q_tt (k = 0, 1, 2) of all calls, (calls, coordinates)."""
        return np.array([state[k] for state in self.states])
