"""Runs that begin or end in an unusual way: released from a static solve, given states, failed solves."""

import exudyn as exu
import numpy as np
import pytest
import scipy.linalg as la

import exudyn_romerr as romerr

N = 8
ROUNDING = 1e-9  # of the largest displacement: matrix exponential of a well conditioned chain


class Load:
    """A constant load that can be switched between solves, and that may fail at a time."""

    def __init__(self, value, fails_at=np.inf):
        self.value, self.fails_at = value, fails_at

    def __call__(self, t):
        if t > self.fails_at:
            raise ArithmeticError("no load any more")
        return self.value


def scene(load, **options):
    """A chain of 8 masses, 2 of its modes, attached; returns mbs, monitor, body, basis, B."""
    K = 400.0 * (2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
    body = romerr.ElasticBody(np.eye(N), K, rayleigh=(0.2, 1e-3))
    B = np.eye(N)[:, -1:]
    basis = romerr.modal_basis(body, 2)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=B, input_function=load)
    monitor = romerr.attach(mbs, flex, outputs=[romerr.Output("last", np.eye(N)[-1])], **options)
    mbs.Assemble()
    return mbs, monitor, body, B


def settings(end=2.0, steps=400):
    """Solver settings without files."""
    ss = exu.SimulationSettings()
    ss.timeIntegration.endTime, ss.timeIntegration.numberOfSteps = end, steps
    ss.solution.file.write = False
    return ss


def free_motion(body, q0, t):
    """Exact motion of the full body from rest at q0 without load, by matrix exponentials."""
    M, D, K = body.M.toarray(), body.D.toarray(), body.K.toarray()
    A = np.block([[np.zeros((N, N)), np.eye(N)], [-la.solve(M, K), -la.solve(M, D)]])
    return np.array([(la.expm(A * s) @ np.concatenate([q0, np.zeros(N)]))[:N] for s in t])


def test_release_from_a_static_solve_starts_in_its_equilibrium():
    """Loaded statically, then let go: the full body starts in its own equilibrium, not in the reduced one."""
    load = Load(20.0)
    mbs, monitor, body, B = scene(load)
    mbs.SolveStatic(settings(), updateInitialValues=True)
    load.value = 0.0
    mbs.SolveDynamic(settings())
    report = monitor.report()
    truth = free_motion(body, 20.0 * np.linalg.solve(body.K.toarray(), B[:, 0]), report.t)[:, -1]
    found = report.compare("last", report.t, truth)
    assert np.all(np.abs(found.error) <= found.bound["best"] + ROUNDING * np.abs(truth).max())
    assert found.effectivity["best"][0] < 1.5
    assert np.abs(found.error[0]) > 1e-3 * np.abs(truth).max()  # the initial error is not zero
    assert report.output("last").causes["initial"][0] > 0


def test_a_static_solve_that_failed_in_its_first_step_left_no_equilibrium():
    """Nothing was moved: the full body starts undeformed. As if in equilibrium, errors were above the bound."""
    load = Load(20.0, fails_at=0.5)
    mbs, monitor, body, B = scene(load)
    with pytest.raises(exu.ExudynError):
        mbs.SolveStatic(settings())
    load.fails_at = np.inf
    mbs.SolveDynamic(settings())
    report = monitor.report()
    rest = 20.0 * np.linalg.solve(body.K.toarray(), B[:, 0])
    truth = (rest + free_motion(body, -rest, report.t))[:, -1]
    found = report.compare("last", report.t, truth)
    assert np.all(np.abs(found.error) <= found.bound["best"] + ROUNDING * np.abs(truth).max())
    assert found.bound["best"][0] <= ROUNDING * np.abs(truth).max()


def test_start_in_the_reduced_state_is_said():
    """A run that starts displaced, with initial=None: the report says what was assumed."""
    mbs, monitor, _, _ = scene(Load(0.0))
    mbs.SetNodeParameter(0, "initialCoordinates", [0.1, 0.0])
    mbs.Assemble()
    mbs.SolveDynamic(settings(0.1, 20))
    assert any("start exactly in the reduced state" in message for message in monitor.report().messages)
