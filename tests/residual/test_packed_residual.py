"""Packing keeps what turns with a frame: little of the residual is cut, however fast the frame turns."""

from functools import cache
from unittest import mock

import numpy as np
import pytest
import scipy.sparse as sp

import exudyn_romerr as romerr
from exudyn_romerr.model.floating_frame import RIGID_INERTIA, inertia_columns
from exudyn_romerr.residual import packed_residual, turning_columns
from exudyn_romerr.residual.packed_residual import PackedProblem
from exudyn_romerr.residual.problem import Problem
from models import floating
from tests.helpers import tolerances

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
    cut = slice(RIGID_INERTIA, RIGID_INERTIA + 9 * MODES)
    u[:, cut] = np.einsum("k,sj->skj", [0.0, 0, 0, 0, 1, 0, 0, 0, 1], q).reshape(20, -1)
    return u, cut


@pytest.mark.parametrize("kept", [1, packed_residual.KEPT])
def test_what_is_kept_and_what_is_cut_bound_the_residual(kept):
    """From above, and sharply; a single direction that is kept leaves up to 6e-4 of it."""
    body, basis, columns = problem()
    (u, cut), none = turning(), np.zeros((20, MODES))
    whole = Problem(body, basis, inputs=columns)
    with mock.patch.object(packed_residual, "KEPT", kept):
        packed = PackedProblem(body, basis, inputs=columns, cut=cut, with_modes=False, turns_fast=True)
    exact = whole.dual.norm_K(whole.map.coordinates(none, none, none, u))
    y, left = packed.packing(u)
    norm, left = packed.dual.norm_K(packed.map.coordinates(none, none, none, y)), np.abs(left).sum(axis=1)
    assert np.all(norm <= exact * (1 + 1e-9))
    assert np.all(exact <= norm + left + 1e-9 * exact)
    assert np.all(left <= 1e-5 * exact) == (kept > 1)  # measured: 1e-6, SMALL of each of the columns


@pytest.mark.parametrize("with_modes", [False, True])
def test_columns_of_large_bodies_a_few_at_a_time(with_modes):
    """Made anew for every use, in groups of 10 of 72, they give the same norms as all at once.

    Auxiliary modes hold some columns whole: what rounding leaves of these must not become a direction of its own.
    """
    body, basis, columns = problem()
    (u, cut), none, found = turning(), np.zeros((20, MODES)), []
    for room, group in ((turning_columns.ROOM, turning_columns.GROUP), (0, 10)):
        with mock.patch.multiple(turning_columns, ROOM=room, GROUP=group, COLUMNS=4):
            options = {"cut": cut, "with_modes": with_modes, "turns_fast": True, "auxiliary_modes": 5}
            packed = PackedProblem(body, basis, inputs=sp.csc_matrix(columns), **options)
        y, left = packed.packing(u)
        z = packed.map.coordinates(none, none, none, y)
        basis_K = packed.dual.Y_K
        np.testing.assert_allclose(basis_K.T @ basis_K, np.eye(packed.dual.k), rtol=0, atol=tolerances.ORTHONORMAL)
        found.append((packed.dual.norm_K(z), packed.dual.norm_static(z), np.abs(left)))
    for whole, in_groups, scale in zip(*found, (0, 1, 0), strict=True):  # what is cut is small beside |R|
        np.testing.assert_allclose(in_groups, whole, rtol=0, atol=1e-9 * found[0][scale].max())


def test_without_what_turns_fast_there_are_fewer_columns_and_more_is_cut():
    """The bound stays one."""
    body, basis, columns = problem()
    (u, cut), none = turning(), np.zeros((20, MODES))
    whole = Problem(body, basis, inputs=columns)
    exact = whole.dual.norm_K(whole.map.coordinates(none, none, none, u))
    options = {"inputs": columns, "cut": cut, "with_modes": False}
    few, many = (PackedProblem(body, basis, **options, turns_fast=fast) for fast in (False, True))
    assert few.dual.k == whole.dual.Y_K.shape[1] - 9 * MODES < many.dual.k
    y, left = few.packing(u)
    assert np.all(exact <= few.dual.norm_K(few.map.coordinates(none, none, none, y)) + np.abs(left).sum(axis=1))


@pytest.mark.parametrize(("scope", "fewer"), [("inputs frozen", True), ("auto", False)])
def test_runs_with_frozen_inputs_keep_few_columns(scope, fewer):
    """158 of them, in place of 62, were 17 us of a step."""
    scene = floating.pendulum(MODES)
    tip = romerr.node_displacement("tip", node=int(floating.interface(scene.fem, "tip")[0][0]), component="z")
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(
        scene.mbs, flex, outputs=[tip], scope=scope, estimators=("energy", "auxiliary"), auxiliary_modes=5
    )
    scene.mbs.Assemble()
    with mock.patch.object(PackedProblem, "_turning", autospec=True, side_effect=PackedProblem._turning) as turning:
        assert monitor.plan
    assert turning.called != fewer
