"""Frequency responses: bounds above exact errors at every frequency, how sharp, what has none, and mutations."""

from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp
from matplotlib.figure import Figure
from scipy.sparse.linalg import splu

import exudyn_romerr as romerr
from exudyn_romerr import AssumptionError, Basis, ElasticBody, InputError, Output, frequency_response
from exudyn_romerr.linear.run import frequency_response as module
from exudyn_romerr.linear.run.frequency_response import ProportionalDamping
from models import solid_bar
from tests.helpers.bodies import BODIES, DAMPINGS, model, pencil

MEDIAN = 1.1  # bound over error: measured 1.00 to 1.05
CORRECTED = 0.15  # of the error may be left by the estimate, in the median: measured 1e-5 to 0.07
ROUNDING = 1e-7  # of static responses, with all modes; measured 2e-8, of the linkage
ATTAINED = 1e-6  # a single mode just above those that are computed: rounding, and the gap of 1e-9


def exact_response(full, B, C, frequencies):
    """C A^-1 B (F, r, p), refined in extended precision: the truth is better than 16 digits."""
    long = np.longdouble
    M, K, B, C = (x.astype(long) for x in (full.M, full.K, B, C))
    alpha, beta = map(long, full.rayleigh)
    D = alpha * M + beta * K
    found = []
    for w in frequencies.astype(long):
        A, x = K + 1j * w * D - w**2 * M, np.zeros(B.shape, dtype=np.clongdouble)
        for _ in range(4):
            x += np.linalg.solve(A.astype(complex), (B - A @ x).astype(complex))
        found.append(C @ x)
    return np.array(found)


def bases(full, B, rng):
    """Modal, Krylov, random with another test space, all modes."""
    yield romerr.modal_basis(full.body, 3)
    yield romerr.krylov_basis(full.body, B, 4)
    yield Basis(rng.standard_normal((full.N, 3)), rng.standard_normal((full.N, 3)))
    yield romerr.modal_basis(full.body, full.N)


@pytest.mark.parametrize("damping", DAMPINGS[:5])
@pytest.mark.parametrize("kind", BODIES)
def test_bound_is_above_the_error(kind, damping):
    """Two loads, two outputs, from zero to above the highest frequency; no tolerance."""
    full, rng = model(kind, damping, 1), np.random.default_rng([BODIES.index(kind), DAMPINGS.index(damping)])
    omega = full.modes[0]
    B, C = rng.standard_normal((full.N, 2)), rng.standard_normal((2, full.N))
    frequencies = np.array([0, *np.geomspace(0.1 * omega[0], 1.5 * omega[-1], 12)])
    truth = exact_response(full, B, C, frequencies)
    for basis in bases(full, B, rng):
        found = frequency_response(full.body, basis, B, Output("y", C), frequencies)
        assert found.value.shape == found.estimate.shape == found.bound.shape == (13, 2, 2)
        assert np.all(np.abs(truth - found.value) <= found.bound), basis.note
        assert [bool(why) for why in found.reasons] == np.isinf(found.bound).any(axis=(1, 2)).tolist()
        assert np.isfinite(found.bound).all()
        if basis.n == full.N and kind != "wide":
            assert np.all(found.bound[0] <= ROUNDING * np.abs(found.value[0]).max())


@cache
def bar(damping):
    """The solid bar's body, B of a force in z and one in x at its tip."""
    mesh = solid_bar.read_mesh(0)
    mass, stiffness = solid_bar.matrices(mesh.nodes, mesh.tets)
    options = {
        "none": {},
        "Rayleigh": {"rayleigh": (5.0, 1e-5)},
        "stiff": {"rayleigh": (0.0, 1e-3)},
        "ratios": {"modal_damping": [0.01, 0.02, 0.0, 0.03, 0.5]},
    }[damping]
    fixed = (3 * mesh.clamped[:, None] + np.arange(3)).ravel()
    B = np.zeros((mass.shape[0], 2))
    for column, axis in enumerate((2, 0)):
        B[3 * mesh.tip + axis, column] = solid_bar.face_weights(mesh, mesh.tip)
    body = ElasticBody(mass, stiffness, fixed=fixed, positions=mesh.nodes, **options)
    return body, B, romerr.node_displacement("tip", node=int(mesh.tip[0]), component="xz", unit="m"), mesh.omega


@cache
def bar_truth(damping):
    """Frequencies from a twentieth of the first mode to above the tenth, and sparse LU at each of them."""
    body, B, output, omega = bar(damping)
    count = 8 if damping == "ratios" else 25  # their matrix is full
    frequencies = np.array([0, *np.geomspace(omega[0] / 20, 1.1 * omega[9], count)])
    C, loads = body.space.rows(output.resolve(body)), body.space.loads(B).astype(complex)
    D = 0 * body.M if body.D is None else sp.csc_matrix(body.D @ np.eye(body.free.size))
    matrices = (sp.csc_matrix(body.K + 1j * w * D - w**2 * body.M) for w in frequencies)
    return frequencies, np.array([C @ splu(A).solve(loads) for A in matrices])


def bar_bases(damping):
    body, B, *_ = bar(damping)
    krylov = romerr.krylov_basis(body, B, 8)
    return [romerr.modal_basis(body, 6), krylov, Basis(krylov.V, romerr.modal_basis(body, krylov.n).V)]


@pytest.mark.parametrize("damping", ["none", "Rayleigh", "stiff", "ratios"])
def test_bar_against_full_solves(damping):
    """1113 coordinates, of which few modes are known: bounds hold, and are as sharp as the docs say in the median."""
    body, B, output, _ = bar(damping)
    frequencies, truth = bar_truth(damping)
    for basis in bar_bases(damping):
        found = frequency_response(body, basis, B, output, frequencies)
        error = np.abs(truth - found.value)
        assert np.all(error <= found.bound)
        assert np.isfinite(found.bound).all()
        resolved = error > 1e-8 * np.abs(truth)  # the truth's own rounding, times 1e3
        assert np.median((found.bound / np.where(error > 0, error, 1))[resolved]) <= MEDIAN
        left = np.abs(truth - found.value - found.estimate)
        assert np.median((left / np.where(error > 0, error, 1))[resolved]) <= CORRECTED


MUTATIONS = {
    "modes do not answer": lambda x: zero(x, "PL"),
    "output does not see modes": lambda x: zero(x, "CP"),
    "no static error": lambda x: zero(x, "static_rows"),
    "no rest": lambda x: zero(x, "C_rest"),
    "residual without B": lambda x: silent(x, slice(-2, None)),
}


def zero(estimator, name):
    setattr(estimator, name, 0 * getattr(estimator, name))


def silent(estimator, columns):
    """The norm no longer sees some columns."""
    norm = estimator.norm

    def less(z):
        z = z.copy()
        z[:, columns] = 0
        return norm(z)

    estimator.norm = less


@pytest.mark.parametrize("name", MUTATIONS)
def test_bound_breaks_where_a_term_is_left_out(name, monkeypatch):
    original = ProportionalDamping.__init__

    def mutated(self, problem):
        original(self, problem)
        MUTATIONS[name](self)

    monkeypatch.setattr(ProportionalDamping, "__init__", mutated)
    broken = 0
    for damping in ("none", "Rayleigh"):
        body, B, output, _ = bar(damping)
        frequencies, truth = bar_truth(damping)
        for basis in bar_bases(damping):
            found = frequency_response(body, basis, B, output, frequencies)
            broken += int(np.sum(np.abs(truth - found.value) > found.bound))
    assert broken


def mode_above(rayleigh):
    """A body of 30 modes whose 21st alone is loaded and seen; the basis is its first mode."""
    M, K = pencil(np.random.default_rng(3), size=30)
    body = ElasticBody(M, K, rayleigh=rayleigh)
    modes, seen = body.all_modes(), M @ body.all_modes().shapes[:, 20]
    frequencies = np.linspace(0.1, 0.95, 9) * modes.omega[10]  # twice that is below the 21st
    alpha, beta = rayleigh
    squares = modes.omega[20] ** 2
    truth = 1 / (squares - frequencies**2 + 1j * frequencies * (alpha + beta * squares))
    return body, romerr.modal_basis(body, 1), seen, frequencies, truth


@pytest.mark.parametrize("rayleigh", [(0.0, 0.0), (2.0, 0.0), (0.0, 0.02), (5.0, 0.05)])
def test_rest_is_attained(rayleigh, monkeypatch):
    """What is not known of a single mode just above those computed is its bound; a smaller gain breaks it."""
    monkeypatch.setattr(module, "ABOVE", 0.0)  # 20 modes
    body, basis, seen, frequencies, truth = mode_above(rayleigh)
    found = frequency_response(body, basis, seen, Output("y", seen), frequencies)
    value, estimate, bound = (x[:, 0, 0] for x in (found.value, found.estimate, found.bound))
    error = np.abs(truth - value)
    rest = np.abs(truth - value - estimate)
    assert np.all(error <= bound)
    np.testing.assert_allclose(bound, np.abs(estimate) + rest, rtol=ATTAINED)
    original = ProportionalDamping.gain
    monkeypatch.setattr(ProportionalDamping, "gain", lambda self, w: 0.5 * original(self, w))
    found = frequency_response(body, basis, seen, Output("y", seen), frequencies)
    assert np.all(found.bound[:, 0, 0] < np.abs(estimate) + rest)
    assert np.any(error > found.bound[:, 0, 0]) or rayleigh[1] > 0  # with beta parts have other phases


@pytest.mark.parametrize("rayleigh", [(0.0, 0.0), (2.0, 0.0), (0.0, 0.02), (5.0, 0.05), (30.0, 0.2)])
def test_gain_is_the_largest_over_all_modes_above(rayleigh):
    """Against a fine grid of modes; inf where an undamped one may be in resonance."""
    estimator = object.__new__(ProportionalDamping)
    estimator.rayleigh, estimator.cut = rayleigh, 10.0
    w = np.array([0.0, 1.0, 9.0, 10.5, 30.0, 1e3])
    s = np.concatenate([np.linspace(0, 0.01, 100001), 1 / np.maximum(w, 10) ** 2])[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):  # undamped, in resonance
        kappa = 1 + 1j * w * rayleigh[1]
        largest = np.abs(1 / kappa - 1 / (kappa - (w**2 - 1j * w * rayleigh[0]) * s)).max(axis=0)
        gain = estimator.gain(w)
    damped = any(rayleigh) | (w < 10)
    np.testing.assert_allclose(gain[damped], largest[damped], rtol=1e-3)  # the grid's step
    assert np.all(gain[damped] >= largest[damped] * (1 - 1e-12))
    assert np.all(np.isinf(gain[~damped]))


@pytest.mark.parametrize("block", [slice(0, 1), slice(1, 2), slice(-1, None)], ids=["M V", "K V", "B"])
def test_every_term_of_the_residual_counts(block, monkeypatch):
    """Errors in the 21st mode alone, which is not computed; test spaces that make its motion small, or too large."""
    monkeypatch.setattr(module, "ABOVE", 0.0)  # 20 modes
    body, _, seen, frequencies, truth = mode_above((0.0, 0.0))
    modes, original = body.all_modes(), ProportionalDamping.__init__
    low, high = modes.shapes[:, :1], modes.shapes[:, 20:21]
    large = -1.3 * (modes.omega[0] / modes.omega[20]) ** 2  # K V q is 4 times the load
    both = [Basis(low + high), Basis(low + high, low + large * high)]

    def violations():
        found = (frequency_response(body, basis, seen, Output("y", seen), frequencies) for basis in both)
        return sum(np.sum(np.abs(truth - x.value[:, 0, 0]) > x.bound[:, 0, 0]) for x in found)

    def mutated(self, problem):
        original(self, problem)
        silent(self, block)

    assert violations() == 0
    monkeypatch.setattr(ProportionalDamping, "__init__", mutated)
    assert violations()


def test_no_bound_at_eigenfrequencies_of_an_undamped_body():
    """inf, with the reason; finite beside them, never nan."""
    body, B, output, _ = bar("none")
    omega = body.modes(4).omega
    frequencies = np.sort(np.concatenate([omega, omega * (1 + 1e-14), 1.01 * omega]))
    found = frequency_response(body, romerr.krylov_basis(body, B, 6), B, output, frequencies)
    assert [why == module.RESONANCE for why in found.reasons] == 4 * [True, True, False]
    assert np.isfinite(found.bound).all(axis=(1, 2)).tolist() == 4 * [False, False, True]
    assert not any(np.isnan(x).any() for x in (found.value, found.estimate, found.bound))
    assert f"no bound at 8 of them, such as {omega[0] / (2 * np.pi):.6g} Hz: resonance" in str(found)


def test_no_bound_where_the_reduced_body_has_no_response():
    body = ElasticBody(np.eye(2), np.diag([1.0, 7.0]))
    found = frequency_response(body, Basis(np.ones((2, 1))), [1.0, 0.0], Output("x", [1.0, 0.0]), [2.0, 1.5])
    assert found.reasons == (module.RINGING, "")
    assert [np.isinf(np.abs(x[:, 0, 0])).tolist() for x in (found.value, found.estimate, found.bound)] == 3 * [
        [True, False]
    ]


def test_no_bound_above_the_modes_that_are_computed(monkeypatch):
    """Of an undamped body; a damped one has a bound there."""
    monkeypatch.setattr(module, "LARGEST_CAP", 3)
    monkeypatch.setattr(module, "AUTO_WITHOUT_OUTPUTS", 3)
    for damping in ("none", "Rayleigh"):
        body, B, output, omega = bar(damping)
        found = frequency_response(body, romerr.krylov_basis(body, B, 6), B, output, omega[[0, 4]] * 1.05)
        assert found.reasons == ("", module.TOO_HIGH.format(3) if damping == "none" else "")


def test_damping_matrices_are_refused():
    full = model("pencil", "matrix", 0)
    basis, row = romerr.modal_basis(full.body, 2), np.eye(full.N)[0]
    with pytest.raises(AssumptionError, match="needs Rayleigh damping, ratios by mode or none"):
        frequency_response(full.body, basis, row, Output("y", row), 1.0)


def test_velocities_are_those_of_displacements():
    body, B, output, _ = bar("Rayleigh")
    basis, frequencies = romerr.krylov_basis(body, B, 6), bar_truth("Rayleigh")[0]
    rate = romerr.node_velocity("rate", node=int(solid_bar.read_mesh(0).tip[0]), component="xz")
    moved, moving = (frequency_response(body, basis, B, out, frequencies) for out in (output, rate))
    for name in ("value", "estimate", "bound"):
        factor = frequencies[:, None, None] * (1 if name == "bound" else 1j)
        np.testing.assert_allclose(getattr(moving, name), factor * getattr(moved, name), rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"frequencies": [1.0, -2.0]}, "frequencies has -2; needed: at least one, none below zero, in rad/s"),
        ({"frequencies": []}, "frequencies is empty"),
        ({"frequencies": [np.nan]}, "frequencies has a nan or inf"),
        (
            {"output": romerr.node_displacement("tip", node=3, component="z", frame="global")},
            "output 'tip' is in global axes",
        ),
        ({"output": 3}, "output is a int; needed: Output"),
        ({"input": np.ones((4, 1))}, "inputs has shape"),
    ],
)
def test_bad_input_is_refused(change, message):
    body, B, output, _ = bar("none")
    given = {"input": B, "output": output, "frequencies": [1.0], **change}
    with pytest.raises(InputError, match=message):
        frequency_response(body, romerr.modal_basis(body, 2), **given)


def test_printed_and_drawn(tmp_path):
    """Every pair of row and load has its line; a picture tells bound and estimate apart."""
    body, B, output, omega = bar("none")
    frequencies = np.append(np.linspace(omega[0] / 20, 1.5 * omega[0], 20), body.modes(1).omega)
    found = frequency_response(body, romerr.krylov_basis(body, B, 6), B, output, frequencies)
    lines = str(found).splitlines()
    assert lines[0].startswith("unit loads, frequencies: 21, ")
    for line, name in zip(
        lines[1:5], ("tip x, load 1", "tip x, load 2", "tip z, load 1", "tip z, load 2"), strict=True
    ):
        assert line.startswith(f"{name}: up to ")
        assert "error at most " in line
    figure = found.plot(tmp_path / "response.png", row=1, column=1)
    assert isinstance(figure, Figure)
    assert (tmp_path / "response.png").stat().st_size
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "reduced response",
        "its error: bound",
        "its error: estimate",
    ]
    assert "no bound at 1 frequencies" in axes.get_title()
    bound = axes.lines[1].get_ydata()
    np.testing.assert_array_equal(np.isnan(bound), np.isinf(found.bound[np.argsort(frequencies), 1, 1]))
