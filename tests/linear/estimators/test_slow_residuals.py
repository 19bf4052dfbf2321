"""Undamped long runs: where the residual is slow beside what is bounded, its second derivative counts."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.linear.estimators import energy
from models import linkage
from models.exact import full_solution, reduced_solution, reduced_trajectory

W = 2 * np.pi * linkage.FREQUENCY
END, STEP = 10.0, 1e-3  # s: 80 periods of the lowest mode, 3 to 30 steps a period of the reduced body's four


@pytest.fixture(scope="module")
def long_run():
    """Body, basis, trajectory and inputs of the undamped linkage on 4 vectors; its error (T, 1), in closed form."""
    _, B, out = linkage.build()
    positions = linkage.mesh()[0]
    body = romerr.ElasticBody(*linkage.matrices(), rayleigh=(0.0, 0.0), fixed=linkage.CLAMPED, positions=positions)
    basis, t = romerr.krylov_basis(body, B, 4), np.arange(0.0, END + STEP / 2, STEP)
    full = full_solution(body, B, linkage.AMPLITUDE, W)
    reduced = reduced_solution(body, basis, B, linkage.AMPLITUDE, W)
    rows = out.resolve(body)
    error = full.output(rows, t) - reduced.output(rows @ basis.V, t)
    trajectory = reduced_trajectory(reduced, t, linkage.AMPLITUDE)
    return body, basis, trajectory, B, out, error.astype(float)


def bounded(run, monkeypatch, time="reconstructed", modes=20, hide=None):
    """The output, bounded with both kinds of rows of g, or one hidden ("smooth", "plain")."""
    body, basis, trajectory, B, out, _ = run
    if hide == "smooth":
        monkeypatch.setattr(energy.Smooth, "of", lambda *_: None)
    if hide == "plain":
        original = energy.Energy._grown

        def grown(self, block, static):
            g, *others = original(self, block, static)
            return np.vstack([np.full_like(g[:-1], np.inf), g[-1:]]), *others

        monkeypatch.setattr(energy.Energy, "_grown", grown)
    report = romerr.evaluate(
        body,
        basis,
        trajectory,
        inputs=B,
        outputs=[out],
        input_function=lambda t: linkage.AMPLITUDE * np.sin(W * t),
        time=time,
        estimators=("auxiliary",),
        auxiliary_modes=modes,
    )
    return report.outputs[out.name]


@pytest.mark.parametrize("modes", [20, 60])
def test_bounds_by_second_derivatives_hold_and_are_sharper(long_run, monkeypatch, modes):
    """The trajectory is exact at samples: reduction error, and what a quintic misses, are all there is.

    Measured: plain 50 times as large with 20 modes, 2400 times with 60.
    """
    error = long_run[-1]
    with monkeypatch.context() as patch:
        slow = bounded(long_run, patch, modes=modes, hide="plain")
    with monkeypatch.context() as patch:
        plain = bounded(long_run, patch, modes=modes, hide="smooth")
    both = bounded(long_run, monkeypatch, modes=modes)
    assert (np.abs(error) <= slow.bound["auxiliary"])[1:].all()
    assert (np.abs(error - (slow.corrected - slow.value)) <= slow.corrected_bound)[1:].all()
    assert (both.corrected_bound <= plain.corrected_bound * (1 + 1e-12)).all()
    assert 10 * both.corrected_bound.max() < plain.corrected_bound.max()


def test_where_r_is_not_slow_nothing_changes(long_run, monkeypatch):
    """Of a step of 1 ms 592 rad/s, above 5 modes, is too low."""
    both = bounded(long_run, monkeypatch, modes=5)
    with monkeypatch.context() as patch:
        plain = bounded(long_run, patch, modes=5, hide="smooth")
    np.testing.assert_array_equal(both.bound["auxiliary"], plain.bound["auxiliary"])


# --- one mode above, at its resonance: nothing is left to spare ---------------------

OMEGA = 20.0  # rad/s


def driven(t, u, time, input_function=None):
    """Bound (T,) of the mode above the one that basis and auxiliary modes have; only that is driven."""
    body = romerr.ElasticBody(np.eye(2), np.diag([1.0, OMEGA**2]), rayleigh=(0.0, 0.0))
    still = np.zeros((len(t), 1))
    report = romerr.evaluate(
        body,
        romerr.Basis(np.eye(2)[:, :1]),
        romerr.Trajectory(t, still, still, still, u[:, None]),
        inputs=np.eye(2)[:, 1:],
        outputs=[romerr.Output("x", np.eye(2)[1])],
        input_function=input_function,
        time=time,
        estimators=("auxiliary",),
        auxiliary_modes=1,
    )
    return report.outputs["x"].bound["auxiliary"][:, 0]


def test_kinks_at_resonance_are_bounded_closely():
    """A triangle wave with the period of the mode: every kink strikes in time."""
    h, u = np.pi / (2 * OMEGA), np.tile([0.0, 0.5, 1.0, 0.5], 40)
    x, x_t, found = 0.0, 0.0, [0.0]
    for a, b in zip(u[:-1] / OMEGA**2, np.diff(u) / h / OMEGA**2, strict=True):  # x'' + OMEGA^2 x = u, u linear
        x, x_t = a + b * h + (x_t - b) / OMEGA, b - OMEGA * (x - a)  # a quarter of a period
        found.append(x)
    bound = driven(h * np.arange(len(u)), u, "sampled")
    assert (np.abs(found) <= bound * (1 + 1e-12)).all()
    assert bound[-1] <= 1.05 * np.max(np.abs(found))
