"""SecondOrderModels of pyMOR: bounds against exact motions, transfer functions against pyMOR's, and refusals."""

import sys

import numpy as np
import pytest
import scipy.sparse as sp

import exudyn_romerr as romerr
from models import exact

N, COLUMNS = 20, 6
M = sp.diags(np.linspace(1.0, 2.0, N), format="csc")
K = 1e4 * sp.diags([2 * np.ones(N), -np.ones(N - 1), -np.ones(N - 1)], [0, 1, -1], format="csc")
RAYLEIGH = 0.3, 2e-4
E = RAYLEIGH[0] * M + RAYLEIGH[1] * K
B = np.eye(N)[:, -1:]
CP = np.eye(N)[[-1, N // 2]]
FORCE, W = 3.0, 5.0
SHARP = 1.05  # bound over error: no auxiliary mode is left out


@pytest.fixture
def pymor():
    found = pytest.importorskip("pymor.models.iosys")
    pytest.importorskip("pymor.core.logger").set_log_levels({"pymor": "ERROR"})
    return found


def second_order(pymor, E=E, Cp=CP, **more):
    return pymor.SecondOrderModel.from_matrices(M, E, K, B, Cp, **more)


def reduced_by(kind, fom):
    """A reductor, after its reduce(), with the reduced model; V alone is its own reductor."""
    from pymor.reductors import basic, interpolation, sobt

    if kind == "V alone":
        V = fom.solution_space.from_numpy(np.linalg.eigh((K @ sp.diags(1 / M.diagonal())).toarray())[1][:, :COLUMNS])
        return V, basic.SOLTIPGReductor(fom, V, V).reduce()
    if kind == "SOBHIReductor":
        reductor = interpolation.SOBHIReductor(fom)
        at = np.linspace(5.0, 60.0, COLUMNS)
        return reductor, reductor.reduce(at, np.ones((COLUMNS, 1)), np.ones((COLUMNS, fom.dim_output)))
    reductor = getattr(sobt, kind)(fom)
    return reductor, reductor.reduce(COLUMNS)


def harmonic(fom, reductor):
    """The exact motion of a reduced model from the span of V, in steady state, as a trajectory."""
    _, basis, B, _ = romerr.from_pymor(fom, reductor)
    t = np.linspace(0, 2.0, 801)
    V, D = basis.V, RAYLEIGH[0] * M + RAYLEIGH[1] * K
    q = FORCE * np.linalg.solve(basis.W.T @ ((K + 1j * W * D - W**2 * M) @ V), basis.W.T @ B)[:, 0]
    wave = np.exp(1j * W * t)[:, None] * q
    u = FORCE * np.sin(W * t)
    return romerr.Trajectory(t, wave.imag, (1j * W * wave).imag, (-(W**2) * wave).imag, u), V


@pytest.mark.parametrize("kind", ["SOBTpReductor", "SOBTfvReductor", "SOBTpvReductor", "SOBHIReductor", "V alone"])
def test_bound_is_above_the_exact_error_and_near_it(pymor, kind):
    """In one call; W = V and not. The full body starts where the reduced one does."""
    fom = second_order(pymor)
    reductor, _ = reduced_by(kind, fom)
    traj, V = harmonic(fom, reductor)
    report = romerr.evaluate(fom, reductor, traj, input_function=lambda t: FORCE * np.sin(W * t))
    y = report.output("y")
    body = romerr.from_pymor(fom, reductor).body
    assert body.rayleigh == pytest.approx(RAYLEIGH)
    start = V @ traj.q[0], V @ traj.q_t[0]
    error = exact.full_solution(body, B, FORCE, W, start).output(CP, traj.t) - y.value
    assert np.all(np.abs(error) <= y.bound["best"] + 1e-12 * np.abs(y.value).max())
    assert np.all(y.bound["best"].max(axis=0) <= SHARP * np.abs(error).max(axis=0))
    assert np.all(np.abs(error - y.estimate) <= y.uncertainty + 1e-12 * np.abs(y.value).max())


@pytest.mark.parametrize("kind", ["SOBTpReductor", "SOBHIReductor", "V alone"])
def test_frequency_response_is_pymors(pymor, kind):
    """Of the reduced model; the bound is above pyMOR's error of the transfer function, and near it."""
    fom = second_order(pymor)
    reductor, rom = reduced_by(kind, fom)
    body, basis, inputs, (y,) = romerr.from_pymor(fom, reductor)
    w = np.linspace(0, 1.2 * body.modes(N).omega[-1], 101)
    found = romerr.frequency_response(body, basis, inputs, y, w)
    small, full, error = (x.transfer_function.freq_resp(w) for x in (rom, fom, fom - rom))
    scale = np.abs(full).max()
    np.testing.assert_allclose(found.value, small, atol=1e-9 * scale)
    np.testing.assert_allclose(found.value + found.estimate, full, atol=1e-9 * scale)
    assert np.all(np.abs(error) <= found.bound + 1e-12 * scale)
    assert np.all(found.bound <= np.abs(error) + 1e-9 * scale)


def test_rows_of_displacements_and_of_velocities_are_two_outputs(pymor):
    Cv = np.zeros((3, N))
    Cv[1, 4] = 2.0
    Cp = np.array([CP[0], np.zeros(N), CP[1]])
    fom = second_order(pymor, Cp=Cp, Cv=Cv)
    y, y_t = romerr.from_pymor(fom, romerr.Basis(np.eye(N)[:, :3])).outputs
    assert (y.of, y.labels, y_t.of, y_t.labels) == ("displacement", ("row 0", "row 2"), "velocity", ("row 1",))
    np.testing.assert_array_equal(y.rows, CP)
    np.testing.assert_array_equal(y_t.rows, Cv[1:2])


@pytest.mark.parametrize(
    ("matrix", "alpha", "beta"),
    [(0 * K, 0.0, 0.0), (0.3 * M, 0.3, 0.0), (1e-9 * K, 0.0, 1e-9), (7.0 * M + 1e-7 * K, 7.0, 1e-7)],
)
def test_rayleigh_damping_is_found(pymor, matrix, alpha, beta):
    body = romerr.from_pymor(second_order(pymor, matrix), romerr.Basis(np.eye(N)[:, :3])).body
    assert (body.rayleigh or (0, 0)) == pytest.approx((alpha, beta), rel=1e-9)
    assert body.damping is None


def test_other_damping_stays_a_matrix(pymor):
    """One entry differs in the eleventh digit: bounds for a matrix, and no frequency response."""
    other = E.copy()
    other[3, 3] *= 1 + 1e-11
    body, basis, inputs, (y,) = romerr.from_pymor(second_order(pymor, other), romerr.Basis(np.eye(N)[:, :3]))
    assert body.rayleigh is None
    np.testing.assert_array_equal(body.damping.toarray(), other.toarray())
    with pytest.raises(romerr.AssumptionError, match="found a damping matrix"):
        romerr.frequency_response(body, basis, inputs, y, 1.0)


UNSYMMETRIC = sp.csc_matrix(K + sp.csc_matrix(([1e3], ([0], [1])), shape=K.shape))


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"sampling_time": 0.1}, romerr.AssumptionError, "sampling_time=0.1; needed: 0"),
        ({"D": np.ones((2, 1))}, romerr.AssumptionError, "a feedthrough D"),
        ({"Cv": CP}, romerr.AssumptionError, "row 0 of the output has entries in Cp and Cv"),
        ({"K": UNSYMMETRIC}, romerr.InputError, "stiffness is not symmetric"),
        ({"K": 0 * K}, romerr.AssumptionError, "stiffness"),
        ({"E": -E}, romerr.AssumptionError, "damping"),
    ],
)
def test_models_that_are_not_covered_are_refused(pymor, change, error, message):
    given = {"M": M, "E": E, "K": K, "B": B, "Cp": CP, **change}
    fom = pymor.SecondOrderModel.from_matrices(**given)
    with pytest.raises(error, match=message):
        romerr.from_pymor(fom, romerr.Basis(np.eye(N)[:, :3]))


def test_parameters_are_refused(pymor):
    from pymor.parameters.functionals import ProjectionParameterFunctional

    fom = second_order(pymor)
    fom = fom.with_(K=fom.K * ProjectionParameterFunctional("stiff"))
    with pytest.raises(romerr.AssumptionError, match="model has parameters"):
        romerr.from_pymor(fom, romerr.Basis(np.eye(N)[:, :3]))


def test_what_has_no_bases_is_refused(pymor):
    from pymor.reductors.sobt import SOBTpReductor, SOBTReductor

    fom = second_order(pymor)
    of_two, before = SOBTReductor(fom), SOBTpReductor(fom)
    rom = of_two.reduce(COLUMNS)
    for wrong in (of_two, before, rom):
        with pytest.raises(romerr.InputError, match="without bases V and W"):
            romerr.from_pymor(fom, wrong)
    before.reduce(COLUMNS)
    with pytest.raises(romerr.InputError, match="reduced another model"):
        romerr.from_pymor(second_order(pymor), before)
    with pytest.raises(romerr.AssumptionError, match="V has 40 rows, the model 20; needed: bases of its"):
        romerr.from_pymor(fom, fom.to_lti().A.source.zeros(2))
    with pytest.raises(romerr.InputError, match="model is a LTIModel; needed: SecondOrderModel"):
        romerr.from_pymor(fom.to_lti(), before)


def test_pymor_is_not_imported_for_bodies_of_ours(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymor", None)  # importing it raises
    body = romerr.ElasticBody(M, K)
    t = np.linspace(0, 1, 5)
    report = romerr.evaluate(body, romerr.modal_basis(body, 2), romerr.Trajectory(t, *np.zeros((3, 5, 2))))
    assert not any(bound.any() for bound in report.position_bound.values())
