"""A second-order model that pyMOR reduces: our bound beside pyMOR's own norms and the true error.

    pip install -e '.[pymor]' && python examples/pymor_second_order.py       3 s

A chain of masses, balanced truncation of its positions (W and V differ), and pyMOR's implicit midpoint rule. The H2
norm of the error system is a bound, too: |error at any time| <= H2 norm * |u|_L2, of the modes alone. What the steps
do, only our bound has.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
import scipy.sparse as sp
from pymor.algorithms.timestepping import ImplicitMidpointTimeStepper
from pymor.algorithms.to_matrix import to_matrix
from pymor.core.logger import set_log_levels
from pymor.models.iosys import SecondOrderModel
from pymor.reductors.sobt import SOBTpReductor

import exudyn_romerr as romerr
from models import exact

FORCE, W = 20.0, 50.0  # N, rad/s


def chain(masses: int = 30) -> SecondOrderModel:
    """Return masses of 0.1 kg between springs, the first one held; a load on the last, whose motion is shown."""
    K = 1e6 * sp.diags([2 * np.ones(masses), -np.ones(masses - 1), -np.ones(masses - 1)], [0, 1, -1], format="csc")
    M, B = 0.1 * sp.identity(masses, format="csc"), np.eye(masses)[:, -1:]
    return SecondOrderModel.from_matrices(M, 0.5 * M + 1e-5 * K, K, B, B.T)


def solved(rom: SecondOrderModel, steps: int, end: float) -> romerr.Trajectory:
    """Return the motion of a reduced model, by pyMOR's implicit midpoint rule."""
    t = np.linspace(0, end, steps + 1)
    lti = rom.to_lti().with_(T=end, time_stepper=ImplicitMidpointTimeStepper(steps))
    state = lti.solve(input=f"[{FORCE} * sin({W} * t[0])]").to_numpy()
    q, q_t = state[: rom.order].T, state[rom.order :].T
    M, E, K, B = (to_matrix(x, format="dense") for x in (rom.M, rom.E, rom.K, rom.B))
    u = FORCE * np.sin(W * t)[:, None]
    return romerr.Trajectory(t, q, q_t, np.linalg.solve(M, B @ u.T - E @ q_t.T - K @ q.T).T, u)


def main(n: int = 12, steps: int = 400, end: float = 0.1) -> tuple[float, float, float, float]:
    """Print and return the true error, our estimate, our bound and that by the H2 norm, largest values in m."""
    set_log_levels({"pymor": "ERROR"})
    fom = chain()
    reductor = SOBTpReductor(fom)
    rom = reductor.reduce(n)
    traj = solved(rom, steps, end)
    report = romerr.evaluate(fom, reductor, traj, input_function=lambda t: FORCE * np.sin(W * t))
    y = report.output("y")

    body, basis, B, (shown,) = romerr.from_pymor(fom, reductor)  # what evaluate has made of them
    error = exact.full_solution(body, B, FORCE, W).output(shown.rows, traj.t) - y.value
    of_load = FORCE * np.sqrt(end / 2 - np.sin(2 * W * end) / (4 * W))  # L2 norm of the load
    by_norm = (fom - rom).h2_norm() * of_load
    true, about, most = (float(np.abs(x).max()) for x in (error, y.estimate, y.bound["best"]))
    print(report)
    print(f"true error {true:.4g} m, ours about {about:.4g} m, at most {most:.4g} m")
    print(f"by pyMOR's H2 norm at most {by_norm:.3g} m, without the steps")

    frequencies = np.linspace(0, 2 * body.modes(n).omega[-1], 60)
    found = romerr.frequency_response(body, basis, B, shown, frequencies)
    theirs = np.abs((fom - rom).transfer_function.freq_resp(frequencies)[:, 0, 0])
    print(f"transfer function, largest error: pyMOR {theirs.max():.4g} m/N, ours at most {found.bound.max():.4g} m/N")
    return true, about, most, by_norm


if __name__ == "__main__":
    main()
