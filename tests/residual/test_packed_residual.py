"""Packing keeps what turns with a frame: little of the residual is cut, however fast the frame turns."""

from functools import cache
from unittest import mock

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.model.floating_frame import inertia_columns, modal_inertia
from exudyn_romerr.residual import packed_residual
from exudyn_romerr.residual.packed_residual import PackedProblem
from exudyn_romerr.residual.problem import Problem
from models import floating

MODES = 8


@cache
def problem():
    """Arguments of a problem of the rotor on some modes, under the inertia of its frame."""
    fem = floating.load_fem("rotor")
    body = romerr.ElasticBody.from_fem(fem, reference=romerr.mean_motion(*floating.interface(fem, "left")))
    basis = romerr.modal_basis(body, MODES)
    columns = inertia_columns(body.mass, body.positions, basis.V).toarray()
    return body, basis, -columns


def turning():
    """Inputs (S, p): a frame that turns about x makes modes of random accelerations act."""
    *_, columns = problem()
    q, u = np.random.default_rng(7).standard_normal((20, MODES)), np.zeros((20, columns.shape[1]))
    cut = modal_inertia(MODES)
    u[:, cut] = np.einsum("k,sj->skj", [0.0, 0, 0, 0, 1, 0, 0, 0, 1], q).reshape(20, -1)
    return u, cut


@pytest.mark.parametrize("kept", [1, packed_residual.KEPT])
def test_what_is_kept_and_what_is_cut_bound_the_residual(kept):
    """From above, and sharply; a single direction that is kept leaves up to 6e-4 of it."""
    body, basis, columns = problem()
    (u, cut), none = turning(), np.zeros((20, MODES))
    whole = Problem(body, basis, inputs=columns)
    with mock.patch.object(packed_residual, "KEPT", kept):
        packed = PackedProblem(body, basis, inputs=columns, cut=cut, with_modes=False)
    exact = whole.dual.norm_K(whole.map.coordinates(none, none, none, u))
    y, left = packed.packing(u)
    norm, left = packed.dual.norm_K(packed.map.coordinates(none, none, none, y)), np.abs(left).sum(axis=1)
    assert np.all(norm <= exact * (1 + 1e-9))
    assert np.all(exact <= norm + left + 1e-9 * exact)
    assert np.all(left <= 1e-5 * exact) == (kept > 1)  # measured: 1e-6, SMALL of each of the columns
