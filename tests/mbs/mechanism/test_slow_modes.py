"""Slow modes of a body on a joint: bounds of outputs against exact errors, and against those without them."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg as la

import exudyn_romerr as romerr
from exudyn_romerr.online.coupled_runs import shared_energy
from exudyn_romerr.residual import slow_modes
from exudyn_romerr.residual.slow_modes import SlowModes
from models import floating
from tests.basis.test_enrichment import KINDS, lattice
from tests.mbs.mechanism.test_mechanism_energy import STEPS, Scenario, violations

SEEDS = range(30)


@cache
def on_a_joint(seed):
    """A body that a joint at its left face leaves some rigid motions, as (6, f); one load is in resonance with it."""
    rng = np.random.default_rng([seed, 31])
    part = lattice(rng, rng.choice(KINDS[:2]))
    body, rows, locked = part.body, part.faces[:6], rng.permutation(6) < rng.integers(1, 7)
    inertia, solve = body.space.loads(part.matrices[0] @ part.Rg), body.stiffness_factor.solve
    responses = solve(inertia)
    V = np.hstack([responses, solve(body.M @ responses[:, rng.permutation(6)[:2]])])
    free = la.null_space(rows[locked] @ part.Rg)
    (M, _, K), X = part.matrices, np.hstack([part.Rg @ free, body.expand(np.eye(body.free.size))])
    omega = np.sqrt(la.eigh(X.T @ K @ X, X.T @ M @ X, eigvals_only=True)[free.shape[1] + rng.integers(3)])
    t = 0.2 * np.arange(STEPS + 1)
    loads = np.sin(np.outer(t, [1.0, rng.uniform(0.1, 3.0)])) * rng.standard_normal(2)
    links = [(rows, locked, np.zeros((6, 6)), np.zeros((6, 6)))]
    part = part.__class__(**{**vars(part), "V": body.expand(V)})
    return Scenario([part], links, loads, 0.2 / omega), free


def bounds(case, free, more=None):
    """Bounds of the body, slow modes known from the freedoms, or not known. more: a motion beside its modes."""
    (part,), (rows,), V = case.parts, case.reduced.samples, case.parts[0].V
    if more is not None:
        shape, signals = more
        V = np.hstack([V, shape])
        states = [np.hstack([x, s[:, None]]) for x, s in zip(rows[1:4], signals, strict=True)]
        rows = (rows[0], *states, rows[4])
    run = part.run(V, True)
    opening = run.opening(*(x[0] for x in rows))
    run.open(opening)
    if free is not None:
        energy = shared_energy(run, "reduction")
        energy.slow = energy.slow_modes(free)
        energy.slow.start(opening.start.z, 0.0)
    for a, b in pairwise((0, 40, 41, STEPS)):
        run.extend(*(x[a + 1 : b + 1] for x in rows))
    return next(iter(run.streams()["total"].values()))


@pytest.mark.parametrize("seed", SEEDS)
def test_bounds_with_slow_modes_are_above_errors(seed):
    case, free = on_a_joint(seed)
    assert not violations(case.compared(case.e, [bounds(case, free)]))


def test_bounds_are_no_larger_than_without_slow_modes():
    for seed in SEEDS:
        case, free = on_a_joint(seed)
        known, usual = bounds(case, free), bounds(case, None)
        assert np.all(known.outputs <= usual.outputs)
        np.testing.assert_array_equal(known.outputs[:, 2:], usual.outputs[:, 2:])  # velocities


def moved_beside(seed):
    """A body that is welded, with a motion beside that of its modes (shape, s, s', s''): its R is not orthogonal."""
    case, free = on_a_joint(seed)
    (part,), (M, _, K) = case.parts, case.parts[0].matrices
    shape = part.body.expand(part.body.modes(1).shapes)  # V has it nearly, but not this motion
    t = case.reduced.samples[0][0]
    rate = part.body.modes(1).omega[0]
    signals = 1 - np.cos(rate * t), rate * np.sin(rate * t), rate**2 * np.cos(rate * t)
    R = case.reduced.R + np.outer(signals[2], M @ shape) + np.outer(signals[0], K @ shape)
    return case, free, (shape, signals), case.error(R)


@pytest.mark.parametrize("is_seen", [True, False])
def test_what_is_left_of_the_residual_in_modes_drives_slow_modes(is_seen, monkeypatch):
    welded = [seed for seed in SEEDS if not on_a_joint(seed)[1].size]
    original = SlowModes.__init__

    def without(self, problem, free):
        original(self, problem, free)
        self._driven, self._static = 0 * self._driven, 0 * self._static

    if not is_seen:
        monkeypatch.setattr(SlowModes, "__init__", without)
    found = []
    for seed in welded:
        case, free, more, e = moved_beside(seed)
        found.append("y" in violations(case.compared(e, [bounds(case, free, more)])))
    assert any(found) != is_seen


@pytest.mark.parametrize("part", ["_coupling", "_rests"])
def test_every_part_is_needed(part, monkeypatch):
    original = SlowModes.__init__

    def without(self, problem, free):
        original(self, problem, free)
        values = getattr(self, part)
        none = [np.where(np.isfinite(x), 0.0, x) for x in values] if part == "_rests" else 0 * values
        setattr(self, part, none)

    monkeypatch.setattr(SlowModes, "__init__", without)
    found = [violations(case.compared(case.e, [bounds(case, free)])) for case, free in map(on_a_joint, SEEDS)]
    assert any("y" in names for names in found)


def test_turning_is_about_axes_that_the_joint_leaves_free():
    """A joint that drives the body about an axis leaves it other ones; rounding at rest is about any."""
    case, _ = on_a_joint(0)
    (part,) = case.parts
    energy = shared_energy(part.run(part.V, True), "reduction")
    hinge, slider = np.eye(6)[:, 5:], np.eye(6)[:, :1]
    along, beside, at_rest = np.array([[[0.0, 1e-4, 1.0]], [[0.0, 0.1, 1.0]], [[1e-14, 0.0, 0.0]]])
    of_hinge, of_slider = energy.slow_modes(hinge), energy.slow_modes(slider)
    assert of_hinge.cover(along)
    assert not of_hinge.cover(beside)
    assert not of_slider.cover(along)
    assert of_slider.cover(at_rest)


def test_full_size_work_is_done_before_the_solve(monkeypatch):
    """And once: joints leave what they leave, solves begin again."""
    made, original = [], slow_modes.SlowShapes.__init__

    def counted(self, problem):
        made.append(problem)
        original(self, problem)

    monkeypatch.setattr(slow_modes.SlowShapes, "__init__", counted)
    scene = floating.pendulum(0, damping=(0.0, 1e-4), h=1e-3, t_end=5e-3, assemble=True)
    monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items))
    _ = monitor.plan
    assert len(made) == 1
    for _ in range(2):
        scene.solve()
        assert shared_energy(monitor.runs[-1].companion, "reduction").slow is not None
    assert len(made) == 1
