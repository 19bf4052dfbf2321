"""Bad outputs and runs: the right type of error, and a message that names the argument and what to do."""

import numpy as np
import pytest

from exudyn_romerr import (
    AssumptionError,
    Basis,
    InputError,
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
    check_error,
    offline,
    run,
    trajectory,
    with_nodes,
)

OUTPUTS = {
    "rows too short": (
        lambda: run(outputs=[Output("y", np.ones(9))]),
        InputError,
        r"rows of output 'y' has shape \(1, 9\)",
    ),
    "rows nan": (
        lambda: run(outputs=[Output("y", changed(np.ones(N), 3, np.nan))]),
        InputError,
        "rows of output 'y'.*nan",
    ),
    "no name": (lambda: Output("", np.ones(N)), InputError, "name='' of an Output"),
    "unknown kind": (
        lambda: Output("y", np.ones(N), of="speed"),
        InputError,
        "of .*'speed'.*'displacement', 'velocity'",
    ),
    "node out of range": (
        lambda: node_displacement("y", node=2).resolve(with_nodes()),
        InputError,
        r"node 2; allowed:.*0\.\.1",
    ),
    "component": (
        lambda: node_displacement("y", node=0, component="r"),
        InputError,
        "component='r'; allowed:.*'xyz'",
    ),
    "rotation of a solid": (
        lambda: node_rotation("y", node=0).resolve(with_nodes(3)),
        InputError,
        "node_rotation needs",
    ),
    "weights": (
        lambda: mean_displacement("y", nodes=[0, 1], weights=[1.0, -1.0]).resolve(with_nodes()),
        InputError,
        "weights must have a positive sum",
    ),
    "no nodes": (lambda: mean_displacement("y", nodes=[]).resolve(with_nodes()), InputError, "node list is empty"),
    **{
        f"{maker.__name__} without positions": (
            lambda maker=maker, arguments=arguments: run(outputs=[maker("y", **arguments)]),
            InputError,
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
    "unknown estimator": (
        lambda: run(estimators="slow"),
        InputError,
        "estimators='slow' is unknown; allowed:.*'fast'",
    ),
    "unknown among known": (lambda: run(estimators=("fast", "slow")), InputError, "estimators='slow' is unknown"),
    "no estimator": (lambda: run(estimators=()), InputError, r"estimators=\(\); allowed"),
    "unknown kernel": (lambda: run(kernels="exact"), InputError, "kernels='exact' is unknown; allowed: 'certified'"),
    "unknown residual": (
        lambda: run(residual="exact"),
        InputError,
        "residual='exact' is unknown; allowed: 'orthonormal'",
    ),
    "unknown time": (lambda: run(time="exact"), InputError, "time='exact' is unknown; allowed"),
    "time stands still": (lambda: trajectory(t=[0, 1, 1, 2, 3]), InputError, "t does not increase at entry 2"),
    "time runs back": (lambda: trajectory(t=[0, 1, 0.5, 2, 3]), InputError, "t does not increase at entry 2"),
    "no time": (lambda: Trajectory([], ZERO[:0], ZERO[:0], ZERO[:0]), InputError, "t is empty"),
    "time nan": (lambda: trajectory(t=[0, 1, np.nan, 2, 3]), InputError, "t has a nan or inf"),
    **{
        f"{name} nan": (
            lambda name=name: trajectory(**{name: changed(ZERO, (1, 1), np.nan)}),
            InputError,
            f"{name} has a nan",
        )
        for name in ("q", "q_t", "q_tt", "u")
    },
    **{
        f"{name} of another shape": (
            lambda name=name: trajectory(**{name: ZERO[:, :2]}),
            InputError,
            f"{name} has shape",
        )
        for name in ("q_t", "q_tt")
    },
    "u too short": (lambda: trajectory(u=np.ones(4)), InputError, r"u has shape \(4, 1\)"),
    "u of another width": (lambda: run(traj=trajectory(u=np.ones((5, 2)))), InputError, r"u has shape \(\d, 2\)"),
    "trajectory of another basis": (lambda: run(basis=Basis(V[:, :2])), InputError, r"needed: \(\d, 2\)"),
    "inputs of another body": (lambda: run(inputs=B[:3]), InputError, "inputs has shape"),
    "inputs inf": (lambda: run(inputs=changed(B, (0, 0), np.inf)), InputError, "inputs has a nan or inf"),
    "initial a word": (lambda: run(initial="rest"), InputError, "initial is 'rest'; allowed: None, 'equilibrium' or"),
    "initial too short": (
        lambda: run(initial=(np.zeros(3), np.zeros(N))),
        InputError,
        r"initial\[0\] has shape \(3,\)",
    ),
    "initial nan": (lambda: run(initial=(np.zeros(N), np.full(N, np.nan))), InputError, r"initial\[1\] has a nan"),
    "jumps without function": (lambda: run(jumps=[0.5]), InputError, "jumps need input_function"),
    "jumps nan": (lambda: run(jumps=[np.nan], input_function=np.sin), InputError, "jumps has a nan"),
    "input function no function": (
        lambda: run(input_function=3.0),
        InputError,
        "input_function=3.0; needed: a function",
    ),
    "input function nan": (
        lambda: run(input_function=lambda t: np.nan),
        InputError,
        "input_function's values has a nan",
    ),
    "input function of two": (
        lambda: run(input_function=lambda t: [1, 2]),
        InputError,
        "input_function's values has shape",
    ),
    "spectrum of general damping": (
        lambda: run(GENERAL, kernels="spectrum"),
        AssumptionError,
        "kernels='spectrum'.*Rayleigh",
    ),
    "envelope of general damping": (
        lambda: run(GENERAL, kernels="envelope"),
        AssumptionError,
        "kernels='envelope'.*Rayleigh",
    ),
    "state-space of general damping": (
        lambda: run(GENERAL, estimators="state-space"),
        AssumptionError,
        "Rayleigh.*certified",
    ),
    "projected state too short": (
        lambda: initial_coordinates(BODY, Basis(V), np.zeros(3), np.zeros(N)),
        InputError,
        "q0",
    ),
    "G not symmetric": (
        lambda: fundamental_matrix_norms(BODY, T, changed(M, (0, 1), 9.0)),
        InputError,
        "G is not symmetric",
    ),
    "G indefinite": (lambda: fundamental_matrix_norms(BODY, T, -M), InputError, "G is not positive definite"),
    "G of another size": (lambda: fundamental_matrix_norms(BODY, T, M[:3, :3]), InputError, "G has shape"),
    "negative times": (lambda: fundamental_matrix_norms(BODY, [-1.0]), InputError, "t contains -1; allowed: t >= 0"),
    "report before a run": (lambda: Run(offline()).report(), RunError, "report was asked before the first sample"),
    "steps before the start": (
        lambda: Run(offline()).extend(T, ZERO, ZERO, ZERO),
        RunError,
        "give the first sample to start",
    ),
}


@pytest.mark.parametrize("name", OUTPUTS)
def test_outputs(name):
    """Rows, names, and what the makers of outputs take."""
    check_error(*OUTPUTS[name])


@pytest.mark.parametrize("name", RUNS)
def test_runs(name):
    """Trajectories, loads, initial states, names of estimators, kernels and residuals."""
    check_error(*RUNS[name])


def test_nothing_is_wrong_without_the_mistake():
    """The frame of the cases above is valid: the errors come from the one thing changed."""
    report = run(outputs=[Output("y", np.ones(N))], initial=(np.zeros(N), np.zeros(N)))
    assert np.all(np.isfinite(report.position_bound["fast"]))
    assert np.all(np.isfinite(run(GENERAL).position_bound["fast"]))
    assert run(input_function=np.sin, jumps=[0.5]).t.size == 5
