"""Bad outputs and runs: the right type of error, and a message that names the argument and what to do."""

import numpy as np
import pytest

from exudyn_romerr import (
    AssumptionError,
    Basis,
    Output,
    RunError,
    Trajectory,
    initial_coordinates,
    mean_displacement,
    node_displacement,
    node_rotation,
    node_velocity,
    relative_displacement,
)
from exudyn_romerr.linear.run.run import Run
from models.matrix_exponential import fundamental_matrix_norms
from tests.helpers.bad_input import (
    BODY,
    GENERAL,
    ZERO,
    B,
    M,
    N,
    T,
    V,
    changed,
    check_refused,
    offline,
    run,
    trajectory,
    with_nodes,
)

OUTPUTS = {
    "rows too short": (lambda: run(outputs=[Output("y", np.ones(9))]), r"rows of output 'y' has shape \(1, 9\)"),
    "rows nan": (lambda: run(outputs=[Output("y", changed(np.ones(N), 3, np.nan))]), "rows of output 'y'.*nan"),
    "no name": (lambda: Output("", np.ones(N)), "name='' of an Output"),
    "unknown kind": (lambda: Output("y", np.ones(N), of="speed"), "of .*'speed'.*'displacement', 'velocity'"),
    "node out of range": (lambda: node_displacement("y", node=2).resolve(with_nodes()), r"node 2; allowed:.*0\.\.1"),
    "component": (lambda: node_displacement("y", node=0, component="r"), "component='r'; allowed:.*'xyz'"),
    "rotation of a solid": (lambda: node_rotation("y", node=0).resolve(with_nodes(3)), "node_rotation needs"),
    "weights": (
        lambda: mean_displacement("y", nodes=[0, 1], weights=[1.0, -1.0]).resolve(with_nodes()),
        "weights must have a positive sum",
    ),
    "no nodes": (lambda: mean_displacement("y", nodes=[]).resolve(with_nodes()), "node list is empty"),
    **{
        f"{maker.__name__} without positions": (
            lambda maker=maker, arguments=arguments: run(outputs=[maker("y", **arguments)]),
            r"no node positions; pass positions=",
        )
        for maker, arguments in (
            (node_displacement, {"node": 0}),
            (node_velocity, {"node": 0}),
            (node_rotation, {"node": 0}),
            (mean_displacement, {"nodes": [0]}),
            (relative_displacement, {"node": 0, "other": 1}),
        )
    },
}

RUNS = {
    "unknown estimator": (lambda: run(estimators="slow"), "estimators='slow' is unknown; allowed:.*'fast'"),
    "unknown among known": (lambda: run(estimators=("fast", "slow")), "estimators='slow' is unknown"),
    "no estimator": (lambda: run(estimators=()), r"estimators=\(\); allowed"),
    "unknown kernel": (lambda: run(kernels="exact"), "kernels='exact' is unknown; allowed: 'certified'"),
    "unknown residual": (lambda: run(residual="exact"), "residual='exact' is unknown; allowed: 'orthonormal'"),
    "unknown time": (lambda: run(time="exact"), "time='exact' is unknown; allowed"),
    "time stands still": (lambda: trajectory(t=[0, 1, 1, 2, 3]), "t does not increase at entry 2"),
    "time runs back": (lambda: trajectory(t=[0, 1, 0.5, 2, 3]), "t does not increase at entry 2"),
    "no time": (lambda: Trajectory([], ZERO[:0], ZERO[:0], ZERO[:0]), "t is empty"),
    "time nan": (lambda: trajectory(t=[0, 1, np.nan, 2, 3]), "t has a nan or inf"),
    **{
        f"{name} nan": (
            lambda name=name: trajectory(**{name: changed(ZERO, (1, 1), np.nan)}),
            f"{name} has a nan",
        )
        for name in ("q", "q_t", "q_tt", "u")
    },
    **{
        f"{name} of another shape": (
            lambda name=name: trajectory(**{name: ZERO[:, :2]}),
            f"{name} has shape",
        )
        for name in ("q_t", "q_tt")
    },
    "u too short": (lambda: trajectory(u=np.ones(4)), r"u has shape \(4, 1\)"),
    "u of another width": (lambda: run(traj=trajectory(u=np.ones((5, 2)))), r"u has shape \(\d, 2\)"),
    "trajectory of another basis": (lambda: run(basis=Basis(V[:, :2])), r"needed: \(\d, 2\)"),
    "inputs of another body": (lambda: run(inputs=B[:3]), "inputs has shape"),
    "inputs inf": (lambda: run(inputs=changed(B, (0, 0), np.inf)), "inputs has a nan or inf"),
    "initial a word": (lambda: run(initial="rest"), "initial is 'rest'; allowed: None, 'equilibrium' or"),
    "initial too short": (lambda: run(initial=(np.zeros(3), np.zeros(N))), r"initial\[0\] has shape \(3,\)"),
    "initial nan": (lambda: run(initial=(np.zeros(N), np.full(N, np.nan))), r"initial\[1\] has a nan"),
    "jumps without function": (lambda: run(jumps=[0.5]), "jumps need input_function"),
    "jumps nan": (lambda: run(jumps=[np.nan], input_function=np.sin), "jumps has a nan"),
    "input function no function": (lambda: run(input_function=3.0), "input_function=3.0; needed: a function"),
    "input function nan": (lambda: run(input_function=lambda t: np.nan), "input_function's values has a nan"),
    "input function of two": (lambda: run(input_function=lambda t: [1, 2]), "input_function's values has shape"),
    "spectrum of general damping": (
        lambda: run(GENERAL, kernels="spectrum"),
        "kernels='spectrum'.*Rayleigh",
        AssumptionError,
    ),
    "envelope of general damping": (
        lambda: run(GENERAL, kernels="envelope"),
        "kernels='envelope'.*Rayleigh",
        AssumptionError,
    ),
    "state-space of general damping": (
        lambda: run(GENERAL, estimators="state-space"),
        "Rayleigh.*certified",
        AssumptionError,
    ),
    "projected state too short": (lambda: initial_coordinates(BODY, Basis(V), np.zeros(3), np.zeros(N)), "q0"),
    "G not symmetric": (lambda: fundamental_matrix_norms(BODY, T, changed(M, (0, 1), 9.0)), "G is not symmetric"),
    "G indefinite": (lambda: fundamental_matrix_norms(BODY, T, -M), "G is not positive definite"),
    "G of another size": (lambda: fundamental_matrix_norms(BODY, T, M[:3, :3]), "G has shape"),
    "negative times": (lambda: fundamental_matrix_norms(BODY, [-1.0]), "t contains -1; allowed: t >= 0"),
    "report before a run": (lambda: Run(offline()).report(), "report was asked before the first sample", RunError),
    "steps before the start": (
        lambda: Run(offline()).extend(T, ZERO, ZERO, ZERO),
        "give the first sample to start",
        RunError,
    ),
}


@pytest.mark.parametrize("row", [*OUTPUTS.values(), *RUNS.values()], ids=[*OUTPUTS, *RUNS])
def test_what_is_wrong_is_named(row):
    """Outputs and their makers; trajectories, loads, initial states, names of estimators, kernels and residuals."""
    check_refused(*row)


def test_nothing_is_wrong_without_the_mistake():
    """The frame of the cases above is valid: the errors come from the one thing changed."""
    report = run(outputs=[Output("y", np.ones(N))], initial=(np.zeros(N), np.zeros(N)))
    assert np.all(np.isfinite(report.position_bound["fast"]))
    assert np.all(np.isfinite(run(GENERAL).position_bound["fast"]))
    assert run(input_function=np.sin, jumps=[0.5]).t.size == 5
