"""Auxiliary vectors of bodies in a mechanism: of the steel bar under Exudyn's modes, and of small random lattices."""

from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr import AssumptionError, ElasticBody
from exudyn_romerr.basis.enrichment import Enrichment, independent_beside
from exudyn_romerr.model.admissible_space import mass_orthogonal, mean_motion, rigid_modes
from exudyn_romerr.model.floating_frame import unit_inertia
from models import floating
from tests.helpers import tolerances as tol

NODES = 8
N = 3 * NODES
FACES = np.arange(3), np.arange(3, 6)  # nodes of the interfaces, left and right
KINDS = ("RBE2", "RBE3", "free")
CRAIG_BAMPTON = [("RBE3", "free"), ("RBE2", "free"), ("RBE2", "rigid")]


@dataclass(frozen=True)
class Part:
    """A body, inertia (N, 6) of its rigid motions, wrenches that move it in its frame, loads B, modes V (N, n)."""

    body: ElasticBody
    inertia: np.ndarray
    wrenches: np.ndarray
    B: np.ndarray
    V: np.ndarray

    def reduced(self, rng, static, n):
        """The same on static modes of its interfaces, or without, and n eigenmodes or random columns."""
        body, columns = self.body, []
        if n:
            columns = [body.modes(n).shapes if rng.random() < 0.7 else rng.standard_normal((body.free.size, n))]
        if static:
            columns.append(body.stiffness_factor.solve(self.wrenches))
        return replace(self, V=body.expand(np.hstack(columns)))


def lattice(rng, kind):
    """A Part without modes: every two nodes are joined by a spring, so that nothing but rigid motion is free."""
    x = rng.uniform(-1, 1, (NODES, 3))
    K, M, Rg = np.zeros((N, N)), np.kron(np.diag(rng.uniform(0.5, 2, NODES)), np.eye(3)), rigid_modes(x)
    for i, j in zip(*np.tril_indices(NODES, -1), strict=True):
        along = np.zeros((NODES, 3))
        along[i], along[j] = x[i] - x[j], x[j] - x[i]
        K += 10 ** rng.uniform(1, 2.5) * np.outer(along, along)
    faces = np.vstack([mean_motion(face).motion_rows(x) for face in FACES])
    held = {"RBE2": {"fixed": range(9), "rigid": FACES[1:]}, "RBE3": {"reference": mean_motion(FACES[0])}}
    body = ElasticBody(M, K, positions=x, **held.get(kind, {"reference": mass_orthogonal()}))
    wrenches = body.space.loads(faces.T)[:, 0 if kind == "free" else 6 :]
    return Part(body, M @ Rg, wrenches, rng.standard_normal((N, 2)), np.zeros((N, 0)))


class Enriched(NamedTuple):
    """K and M (free, free), modes V, the columns asked for, and what was found; |.|_K of root x is the 2-norm."""

    K: np.ndarray
    M: np.ndarray
    V: np.ndarray
    inertia: np.ndarray
    loads: np.ndarray
    wrenches: np.ndarray
    P: np.ndarray
    keeps: np.ndarray
    first: np.ndarray

    @property
    def omega(self):
        """Ritz frequencies, where blocks of P are orthogonal in K and orthonormal in M."""
        return np.sqrt(np.einsum("ij,ij->j", self.P, self.K @ self.P))

    def missed(self, forces):
        """|x - closest in span [V, P]|_K / |x|_K of the responses x = K^-1 forces (k,)."""
        root = la.cholesky(self.K)
        x, held = la.solve(root.T, forces), root @ np.hstack([self.V, self.P])
        basis = la.qr(held / la.norm(held, axis=0), mode="economic")[0]
        left = x - basis @ (basis.T @ x)
        return la.norm(left - basis @ (basis.T @ left), axis=0) / la.norm(x, axis=0)

    def cosines(self):
        """Largest of angles in K between V and P."""
        root = la.cholesky(self.K)
        V, P = ((root @ x) / la.norm(root @ x, axis=0) for x in (self.V, self.P))
        return np.abs(V.T @ P).max()


def enriched(body, V, inertia, loads, wrenches, m):
    """Enrichment of one body; columns that are None are none."""
    columns = [np.zeros((len(V), 0)) if part is None else part for part in (inertia, loads, wrenches)]
    found = Enrichment(body, V, *columns, m)
    return Enriched(body.K.toarray(), body.M.toarray(), V, *columns, found.P, found.keeps, found.first)


@cache
def bar(kind, n, interfaces="free"):
    """Body, V (free, n) and columns (free, ...): inertia of the frame, two loads, wrenches at the right face."""
    fem = floating.load_fem("bar")
    floating.reduce(fem, n, kind)
    left, right = (floating.interface(fem, side) for side in ("left", "right"))
    held = {"reference": mean_motion(*left)}
    if interfaces == "rigid":
        held = {"fixed": (3 * left[0][:, None] + np.arange(3)).ravel(), "rigid": [right[0]]}
    body = ElasticBody(fem.massMatrix, fem.stiffnessMatrix, positions=fem.GetNodePositionsAsArray(), **held)
    loads = np.random.default_rng(0).standard_normal((body.N, 2))
    wrenches = mean_motion(*right).motion_rows(body.positions).T
    columns = (unit_inertia(body.mass, body.positions), loads, wrenches)
    return body, body.space.coordinates("V", fem.modeBasis["matrix"]), *(body.space.loads(x) for x in columns)


BARS = [(kind, n, interfaces) for kind, interfaces in CRAIG_BAMPTON for n in (0, 4)]


@cache
def enriched_bar(kind, n, interfaces, m):
    return enriched(*bar(kind, n, interfaces), m)


@pytest.mark.parametrize("m", [1, 5, 16, 40])
@pytest.mark.parametrize("which", BARS)
def test_vectors_are_orthonormal_and_hold_the_interfaces_still(which, m):
    """In M; their frequencies are Ritz's, ascending in both blocks; V misses six static modes of rigid faces."""
    found = enriched_bar(*which, m)
    P, faces = found.P, found.wrenches.T
    assert P.shape[1] == m + 6 * (which[0] == "RBE2" and which[2] == "free")
    assert np.abs(P.T @ found.M @ P - np.eye(P.shape[1])).max() < tol.RITZ
    for block in (found.first, ~found.first):
        part, omega = P[:, block], found.omega[block]
        assert np.abs(part.T @ found.K @ part - np.diag(omega**2)).max(initial=0) < tol.RITZ * found.omega.max() ** 2
        assert np.all(np.diff(omega) >= 0)
    moved = np.abs(faces @ P) / np.outer(la.norm(faces, axis=1), la.norm(P, axis=0))
    assert moved.max() < tol.STILL


@pytest.mark.parametrize("n", [0, 4])
def test_vectors_are_orthogonal_in_the_stiffness_where_modes_hold_static_ones(n):
    """RBE3; what RBE2 modes miss of static modes is not."""
    assert enriched_bar("RBE3", n, "free", 16).cosines() < tol.STILL
    assert enriched_bar("RBE2", n, "rigid", 16).cosines() < tol.STILL
    assert enriched_bar("RBE2", n, "free", 16).cosines() > 0.1


@pytest.mark.parametrize("m", [0, 16])
@pytest.mark.parametrize("which", BARS)
def test_static_responses_to_wrenches_are_held(which, m):
    """Also of rigid faces, and without any vector asked for: modes as Exudyn rounds them."""
    found = enriched_bar(*which, m)
    assert found.missed(found.wrenches).max() < tol.STATIC_MODES
    assert found.missed(found.inertia).max() > tol.STATIC_MODES


@pytest.mark.parametrize("which", BARS)
def test_responses_to_all_that_was_asked_for_are_held(which):
    """Inertia of frame and modes, loads: in half of the vectors; fewer hold the largest of them better."""
    body, V, inertia, loads, wrenches = bar(*which)
    asked = np.hstack([inertia, loads, body.M @ V])
    found = enriched(body, V, inertia, loads, wrenches, 2 * asked.shape[1])
    assert found.missed(asked).max() < tol.STATIC_MODES
    few, none = (enriched(body, V, inertia, loads, wrenches, m).missed(loads).max() for m in (8, 0))
    assert few < 0.05 < none


def test_modes_that_cannot_move_a_face_are_refused():
    """Four columns in six ways."""
    body, _, inertia, loads, wrenches = bar("RBE3", 0)
    with pytest.raises(AssumptionError, match=r"static modes\s+\(Craig-Bampton\)"):
        Enrichment(body, body.modes(4).shapes, inertia, loads, wrenches, 3)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_more_vectors_than_there_are_complete_the_body(kind, seed):
    part = lattice(np.random.default_rng([seed, 5]), kind)
    part = part.reduced(np.random.default_rng(seed), static=True, n=1)
    body, V = part.body, part.body.space.coordinates("V", part.V)
    inertia, loads = (body.space.loads(x) for x in (part.inertia, part.B))
    found = enriched(body, V, inertia, loads, part.wrenches, 1000)
    assert np.hstack([V, found.P]).shape == found.K.shape
    assert found.missed(np.eye(len(V))).max() < tol.STATIC_MODES
    assert np.abs(found.P.T @ found.M @ found.P - np.eye(found.P.shape[1])).max() < tol.RITZ


@pytest.mark.parametrize("units", [(1e-12, 1e-9), (1e6, 1e3), (1e3, 1e9)])
def test_units_do_not_matter(units):
    """M and K in other units, and columns: the same frequencies, in those units."""
    body, V, inertia, loads, wrenches = bar("RBE2", 4)
    mass, stiffness, left = (
        units[0] * body.mass,
        units[1] * body.stiffness,
        floating.interface(floating.load_fem("bar"), "left"),
    )
    other = ElasticBody(mass, stiffness, positions=body.positions, reference=mean_motion(*left))
    found = enriched(other, V, inertia * units[0] ** 0.5, 1e5 * loads, 1e-5 * wrenches, 10)
    expected = enriched_bar("RBE2", 4, "free", 10).omega * (units[1] / units[0]) ** 0.5
    assert found.omega == pytest.approx(expected, rel=tol.RITZ)


def test_vectors_that_others_hold_are_left_out():
    rng = np.random.default_rng(4)
    V, P = rng.standard_normal((9, 4)), rng.standard_normal((9, 6))
    P[:, 1] = V @ [1, 2, 3, 4] + 1e-9 * P[:, 1]
    P[:, 3] = 1e3 * (P[:, 0] - P[:, 2])
    assert independent_beside(V, P).tolist() == [True, False, True, False, True, True]
    assert not independent_beside(V, np.hstack([P, P])).all()  # more than there are coordinates
