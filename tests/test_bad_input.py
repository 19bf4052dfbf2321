"""Bad input: the right type of error, a message that names the argument and says what is allowed or what to do."""

import re

import numpy as np
import pytest
from bodies import model

from exudyn_romerr import (
    AssumptionError,
    Basis,
    ElasticBody,
    InputError,
    Output,
    RomErrError,
    RunError,
    Trajectory,
    evaluate,
    gramian_basis,
    initial_coordinates,
    krylov_basis,
    mean_displacement,
    modal_basis,
    node_displacement,
    node_rotation,
    node_velocity,
    relative_displacement,
)
from exudyn_romerr.matrix_exponential import fundamental_matrix_norms
from exudyn_romerr.offline import prepare
from exudyn_romerr.online import Run

N = 10
FULL = model("chain", "under", 0)
M, K, BODY = FULL.M, FULL.K, FULL.body
GENERAL = model("chain", "matrix", 0).body
V = np.random.default_rng(0).standard_normal((N, 3))
B = np.ones((N, 1))
FREE = 2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)  # springs in a row that nothing holds
FREE[0, 0] = FREE[-1, -1] = 1.0
T = np.linspace(0, 1, 5)
ZERO = np.zeros((5, 3))


def changed(matrix, at, value):
    """A copy with one entry replaced."""
    matrix = np.array(matrix, dtype=float)
    matrix[at] = value
    return matrix


def with_nodes(per_node=6):
    """A body of two nodes."""
    return ElasticBody(np.eye(2 * per_node), np.eye(2 * per_node), positions=np.zeros((2, 3)))


def trajectory(**arrays):
    return Trajectory(**{"t": T, "q": ZERO, "q_t": ZERO, "q_tt": ZERO, "u": np.ones(5), **arrays})


def run(body=BODY, basis=None, **options):
    """Evaluate with one thing wrong; estimators and time are given, as defaults may change."""
    common = {"inputs": B, "estimators": "fast", "time": "sampled"}
    return evaluate(
        body, Basis(V) if basis is None else basis, options.pop("traj", trajectory()), **{**common, **options}
    )


BODIES = {
    "mass unsymmetric": (lambda: ElasticBody(changed(M, (0, 1), 9.0), K), InputError, "mass is not symmetric"),
    "stiffness unsymmetric": (
        lambda: ElasticBody(M, changed(K, (0, 1), 9.0)),
        InputError,
        "stiffness is not symmetric",
    ),
    "mass indefinite": (lambda: ElasticBody(M - 2 * M[0, 0] * np.ones((N, N)), K), InputError, "mass"),
    "mass indefinite inside": (
        lambda: ElasticBody(np.eye(N) + 3 * (np.eye(N, k=1) + np.eye(N, k=-1)), K),
        InputError,
        "mass is not positive definite; every free coordinate needs inertia",
    ),
    "massless": (
        lambda: ElasticBody(np.diag([0.0] + [1.0] * (N - 1)), K),
        InputError,
        r"coordinates \[0\].*condense or fix",
    ),
    "stiffness singular": (lambda: ElasticBody(M, FREE), AssumptionError, r"stiffness.*1 rigid-body.*fixed=\.\.\."),
    "stiffness indefinite": (lambda: ElasticBody(M, -K), AssumptionError, "stiffness is not positive definite"),
    "mass not square": (lambda: ElasticBody(M[:5], K), InputError, r"mass has shape \(5, 10\); needed: square"),
    "stiffness of another size": (
        lambda: ElasticBody(M, K[:5, :5]),
        InputError,
        r"stiffness has shape \(5, 5\).*10 rows",
    ),
    "no coordinates": (lambda: ElasticBody(np.zeros((0, 0)), np.zeros((0, 0))), InputError, "mass"),
    "mass nan": (lambda: ElasticBody(changed(M, (1, 1), np.nan), K), InputError, "mass has a nan or inf"),
    "stiffness inf": (lambda: ElasticBody(M, changed(K, (1, 1), np.inf)), InputError, "stiffness has a nan or inf"),
    "damping nan": (lambda: ElasticBody(M, K, damping=changed(M, (1, 1), np.nan)), InputError, "damping has a nan"),
    "mass is text": (lambda: ElasticBody("mass", K), InputError, "mass is not a real matrix"),
    "both dampings": (
        lambda: ElasticBody(M, K, rayleigh=(0, 1), damping=M),
        InputError,
        "rayleigh and damping.*one of them",
    ),
    "rayleigh nan": (lambda: ElasticBody(M, K, rayleigh=(np.nan, 0)), InputError, "rayleigh"),
    "rayleigh of three": (lambda: ElasticBody(M, K, rayleigh=(0, 0, 0)), InputError, r"rayleigh has shape \(3,\)"),
    "negative alpha": (lambda: ElasticBody(M, K, rayleigh=(-1, 0)), AssumptionError, "rayleigh.*must be >= 0"),
    "negative beta": (lambda: ElasticBody(M, K, rayleigh=(0, -1)), AssumptionError, "rayleigh.*must be >= 0"),
    "negative damping": (lambda: ElasticBody(M, K, damping=-M), AssumptionError, "damping feeds energy in.*need"),
    "indefinite damping": (
        lambda: ElasticBody(M, K, damping=np.diag([1.0, -1e-3] + [0.0] * 8)),
        AssumptionError,
        "damping feeds energy in",
    ),
    "damping of a coordinate without diagonal": (
        lambda: ElasticBody(M, K, damping=np.diag([1.0] * 9, 1) + np.diag([1.0] * 9, -1)),
        AssumptionError,
        "damping feeds energy in",
    ),
    "damping of another size": (lambda: ElasticBody(M, K, damping=M[:3, :3]), InputError, "damping has shape"),
    "fixed out of range": (lambda: ElasticBody(M, K, fixed=[N]), InputError, r"fixed contains 10; allowed:.*0\.\.9"),
    "fixed negative": (lambda: ElasticBody(M, K, fixed=[-1]), InputError, "fixed contains -1"),
    "fixed not whole": (lambda: ElasticBody(M, K, fixed=[0.5]), InputError, "fixed contains 0.5"),
    "everything fixed": (lambda: ElasticBody(M, K, fixed=range(N)), InputError, "fixed lists all 10.*at least one"),
    "positions of another body": (
        lambda: ElasticBody(M, K, positions=np.zeros((4, 3))),
        InputError,
        "positions lists 4",
    ),
    "positions nan": (lambda: ElasticBody(np.eye(6), np.eye(6), positions=[[0, 0, np.nan]]), InputError, "positions"),
    "too many modes": (lambda: BODY.modes(N + 1), InputError, r"m=11 modes asked; allowed: 1\.\.10"),
    "constants without modal damping": (lambda: GENERAL.constants(), AssumptionError, "C1, C11, C12 need Rayleigh"),
}

BASES = {
    "V rank-deficient": (
        lambda: Basis(np.column_stack([V, V[:, 0]])),
        InputError,
        "V has rank 3, but 4 columns; remove",
    ),
    "W rank-deficient": (lambda: Basis(V, V[:, [0, 1, 1]]), InputError, "W has rank 2"),
    "V zero column": (lambda: Basis(changed(V, (slice(None), 1), 0.0)), InputError, r"V has a zero column \(1\)"),
    "V wide": (lambda: Basis(V.T), InputError, "V has shape"),
    "V without columns": (lambda: Basis(V[:, :0]), InputError, "V has shape"),
    "V a vector": (lambda: Basis(V[:, 0]), InputError, "V has shape"),
    "V nan": (lambda: Basis(changed(V, (2, 1), np.nan)), InputError, r"V has a nan or inf at \(2, 1\)"),
    "W of another shape": (lambda: Basis(V, V[:, :2]), InputError, r"W has shape \(10, 2\)"),
    "W inf": (lambda: Basis(V, changed(V, (0, 0), np.inf)), InputError, "W has a nan or inf"),
    "W^T V singular": (
        lambda: Basis(np.eye(N)[:, :2], np.eye(N)[:, 1:3]),
        InputError,
        r"W\^T V is singular.*choose another W",
    ),
    "V of another body": (lambda: run(basis=Basis(V[:8])), InputError, "V has 8 rows.*N = 10"),
    "V moves fixed": (lambda: run(ElasticBody(M, K, fixed=[0])), InputError, "V moves fixed coordinates.*must be 0"),
    "modal n": (lambda: modal_basis(BODY, 11), InputError, r"m=11 modes asked; allowed: 1\.\.10"),
    "krylov n": (lambda: krylov_basis(BODY, B, 0), InputError, r"n=0 columns asked; allowed: 1\.\.10"),
    "krylov shifts": (lambda: krylov_basis(BODY, B, 3, shifts=(-1.0,)), InputError, "shifts=.*>= 0"),
    "krylov no shifts": (lambda: krylov_basis(BODY, B, 3, shifts=()), InputError, "shifts"),
    "krylov inputs": (
        lambda: krylov_basis(BODY, B[:3], 3),
        InputError,
        r"inputs has shape \(3, 1\); needed: \(10, any\)",
    ),
    "krylov no load": (lambda: krylov_basis(BODY, 0 * B, 3), InputError, "inputs do not move"),
    "gramian band": (lambda: gramian_basis(BODY, B, 3, band=(2.0, 1.0)), InputError, "band=.*0 <= w_lo < w_hi"),
    "gramian n": (lambda: gramian_basis(BODY, B, 11, band=(0.0, 1.0)), InputError, "n=11 columns asked"),
}

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
    "no estimator": (lambda: run(estimators=()), InputError, "estimators is empty; allowed"),
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
    "initial a word": (lambda: run(initial="rest"), InputError, "initial='rest'; allowed: None, 'equilibrium' or"),
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


def offline():
    return prepare(BODY, Basis(V), inputs=B, input_function=np.sin, estimators="fast", time="sampled")


ALL = {
    f"{group}: {name}": case
    for group, cases in (("body", BODIES), ("basis", BASES), ("output", OUTPUTS), ("run", RUNS))
    for name, case in cases.items()
}


@pytest.mark.parametrize("name", ALL)
def test_error_type_and_message(name):
    """The wrong argument raises its type of RomErrError with a message that names it."""
    action, kind, message = ALL[name]
    with pytest.raises(RomErrError) as caught:
        action()
    assert type(caught.value) is kind
    assert re.search(message, str(caught.value)), str(caught.value)


def test_nothing_is_wrong_without_the_mistake():
    """The frame of the cases above is valid: the errors come from the one thing changed."""
    report = run(outputs=[Output("y", np.ones(N))], initial=(np.zeros(N), np.zeros(N)))
    assert np.all(np.isfinite(report.position_bound["fast"]))
    assert np.all(np.isfinite(run(GENERAL).position_bound["fast"]))
    assert run(input_function=np.sin, jumps=[0.5]).t.size == 5


def test_types_are_also_the_builtin_ones():
    """Except ValueError and except RuntimeError catch them."""
    assert issubclass(InputError, ValueError)
    assert issubclass(AssumptionError, ValueError)
    assert issubclass(RunError, RuntimeError)
