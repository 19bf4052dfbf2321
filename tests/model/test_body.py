"""ElasticBody: checks when built, modes with their count, factors made once, from_fem."""

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from exudyn_romerr import AssumptionError, ElasticBody, InputError
from exudyn_romerr.linalg import eigenmodes
from models.beam3d import STEEL, RoundSection, assemble
from tests.helpers import tolerances as tol
from tests.helpers.bodies import DAMPINGS, chain, model


def free_beam(count=5, seed=0):
    """Mass and stiffness of a straight beam that nothing holds."""
    direction = np.random.default_rng(seed).standard_normal(3)
    nodes = np.linspace(0, 1, count + 1)[:, None] * direction / la.norm(direction)
    elements = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    return assemble(nodes, elements, RoundSection(diameter=0.02), STEEL)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("fixed", "left"), [((), 6), ((0, 1, 2), 3), ((0, 1, 2, 3), 2), (range(3, 6), 3)])
def test_rigid_body_modes_are_counted(fixed, left, seed):
    """The message of a free beam says 6; of a ball joint 3; and what to do."""
    with pytest.raises(AssumptionError, match=f"{left} rigid-body.*fixed=.*reference="):
        ElasticBody(*free_beam(seed=seed), fixed=fixed)


def test_from_fem_without_matrices():
    """An FEMinterface that imported nothing yet."""
    fem_module = pytest.importorskip("exudyn.FEM")
    with pytest.raises(InputError, match="fem has no mass or stiffness matrix"):
        ElasticBody.from_fem(fem_module.FEMinterface())


@pytest.mark.parametrize("convert", [np.asarray, sp.csr_matrix, sp.coo_array, lambda A: A.tolist()])
def test_any_matrix_type_gives_the_same_body(convert):
    """Dense, sparse matrix, sparse array, nested lists; kept sparse inside."""
    M, K = chain(np.random.default_rng(0))
    body = ElasticBody(convert(M), convert(K), rayleigh=(0.1, 0.01))
    assert all(sp.issparse(A) for A in (body.M, body.K, body.D))
    assert body.K.toarray() == pytest.approx(K, rel=tol.ENTRIES)
    assert body.D.toarray() == pytest.approx(0.1 * M + 0.01 * K, rel=tol.ENTRIES)


@pytest.mark.parametrize("damping", DAMPINGS)
def test_every_dissipative_damping_is_accepted(damping):
    """None, Rayleigh, semidefinite, gyroscopic; D is what was asked for."""
    full = model("pencil", damping, 1)
    D = full.body.D
    assert (np.zeros((12, 12)) if D is None else D.toarray()) == pytest.approx(full.D, rel=tol.ENTRIES)


@pytest.mark.parametrize("fixed", [(), (0, 3)])
def test_modes_solve_the_eigenproblem(fixed):
    """K phi = omega^2 M phi on the free coordinates, M-orthonormal, ascending, the lowest ones."""
    full = model("pencil", "under", 2)
    body = ElasticBody(full.M, full.K, fixed=fixed)
    modes = body.modes(5)
    M, K = body.M.toarray(), body.K.toarray()
    assert modes.omega == pytest.approx(np.sqrt(la.eigvalsh(K, M))[:5], rel=tol.EIGEN)
    assert modes.shapes.T @ M @ modes.shapes == pytest.approx(np.eye(5), rel=tol.EIGEN, abs=tol.EIGEN)
    assert np.max(np.abs(K @ modes.shapes - M @ modes.shapes * modes.omega**2)) < tol.EIGEN * la.norm(K)
    assert modes.omega[-1] < modes.cut <= np.sqrt(la.eigvalsh(K, M))[5]


def test_a_count_that_rounding_spoils_at_the_lowest_mode_refuses_nothing(monkeypatch):
    """As of a bar of 2 m and 20 mm: one was counted below the lowest mode. A few more are asked for, and counted."""
    n, count = 700, eigenmodes.count_below
    K = sp.diags([-np.ones(n - 1), np.full(n, 2.0), -np.ones(n - 1)], [-1, 0, 1])
    first = 2 * np.sin(np.pi / (2 * n + 2))

    def spoilt(M, K, limit):
        return 1 if limit < 1.001 * first else count(M, K, limit)

    monkeypatch.setattr(eigenmodes, "count_below", spoilt)
    assert ElasticBody(sp.identity(n), K).modes(1).omega == pytest.approx([first], rel=tol.EIGEN)


def test_fixed_coordinates_count_in_N_and_expand_to_zero():
    """Expand puts values back among all N."""
    full = model("chain", "none", 5)
    body = ElasticBody(full.M, full.K, fixed=(2, 0, 2))
    assert body.N == full.N
    assert body.fixed.tolist() == [0, 2]
    values = np.ones((full.N - 2, 1))
    assert np.flatnonzero(body.expand(values)[:, 0] == 0).tolist() == [0, 2]


def test_from_fem_takes_matrices_and_positions():
    """An Exudyn FEMinterface filled by hand: a bar of three nodes, three coordinates each."""
    fem_module = pytest.importorskip("exudyn.FEM")
    fem = fem_module.FEMinterface()
    bar = np.kron(np.array([[1.0, -1, 0], [-1, 2, -1], [0, -1, 1]]), np.diag([100.0, 10.0, 10.0]))
    fem.nodes = {"Position": np.array([[0.0, 0, 0], [0.5, 0, 0], [1, 0, 0]])}
    fem.massMatrix, fem.stiffnessMatrix = sp.csr_matrix(np.eye(9) * 0.3), sp.csr_matrix(bar)
    body = ElasticBody.from_fem(fem, rayleigh=(0.5, 1e-3), fixed=range(3))
    assert body.N == 9
    assert body.dofs_per_node == 3
    assert body.total_mass == pytest.approx(0.9, rel=tol.ENTRIES)
    assert body.K.toarray() == pytest.approx(bar[3:, 3:], rel=tol.ENTRIES)
    assert body.rayleigh == (0.5, 1e-3)
    assert np.array_equal(body.positions, fem.nodes["Position"])


@pytest.mark.parametrize("kind", [MemoryError, SystemError])
def test_matrix_too_large_to_factorise_is_said_so(monkeypatch, kind):
    """What SuperLU raises at 1e5 coordinates of a solid."""

    def failing(*_, **__):
        raise kind("gstrf was called with invalid arguments")

    monkeypatch.setattr("exudyn_romerr.linalg.symmetric_factor.splu", failing)
    with pytest.raises(AssumptionError, match="4 coordinates and 4 entries is too large to factorise"):
        ElasticBody(np.eye(4), np.eye(4))
