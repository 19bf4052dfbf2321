"""Bodies with damping ratios by mode in Exudyn: the matrix it gets, and the error of its own solution."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr import ElasticBody
from models import floating
from tests.helpers.mbs_scenes import INPUTS, TIP, N, chain_body, new_mbs, settings

RATIOS = [0.05, 0.0, 0.2, 0.01]
END = 1.0  # s
FORCE = 3.0  # N, from the start


def test_ratios_by_mode_in_exudyn():
    """A constant force, so that the truth is the closed form of all modes; Exudyn's steps are in the error."""
    plain = chain_body()
    body = ElasticBody(plain.mass, plain.stiffness, rayleigh=(0.1, 0.01), modal_damping=RATIOS)
    mbs, basis = new_mbs(), romerr.modal_basis(body, 2)
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=INPUTS, input_function=lambda t: FORCE)
    monitor = romerr.attach(mbs, flex, outputs=[TIP])
    mbs.Assemble()
    omega, shapes = (getattr(body.all_modes(), name) for name in ("omega", "shapes"))
    D = mbs.GetObject(flex.items["oGenericODE2"])["dampingMatrix"].GetPythonObject()
    np.testing.assert_allclose(D, np.diag(2 * np.array(RATIOS[:2]) * omega[:2]), atol=1e-12)
    mbs.SolveDynamic(settings(steps=400, end=END))
    report = monitor.report()
    out, zeta = report.output("tip"), body.damping_ratios(omega)
    assert set(report.scope.values()) == {"complete"}
    np.testing.assert_allclose(zeta[4:], (0.1 / omega + 0.01 * omega)[4:] / 2)
    eta = closed_form(omega, zeta, FORCE * (shapes.T @ INPUTS).ravel(), report.t)
    error = eta @ shapes[7] - out.value[:, 0]
    size = np.max(np.abs(error))
    assert np.all(np.abs(error) <= out.bound["best"][:, 0] + out.round_off[:, 0])
    assert np.all(np.abs(error - out.estimate[:, 0]) <= out.uncertainty[:, 0] + 1e-9 * size)
    assert np.max(out.bound["best"]) < 1.05 * size  # with ratios of the modes above left out it would not be


def closed_form(omega, zeta, force, t):
    """Modal coordinates (T, m) from rest under constant forces; all underdamped."""
    decay, ring = zeta * omega, omega * np.sqrt(1 - zeta**2)
    angle = np.outer(t, ring)
    free = np.exp(-np.outer(t, decay)) * (np.cos(angle) + decay / ring * np.sin(angle))
    return force / omega**2 * (1 - free)


@pytest.mark.parametrize("estimator", ["energy", "fast"])
def test_other_estimators_hold(estimator):
    plain = chain_body()
    body = ElasticBody(plain.mass, plain.stiffness, modal_damping=0.03)
    mbs = new_mbs()
    flex = romerr.add_reduced_body(
        mbs, body, romerr.modal_basis(body, 2), inputs=INPUTS, input_function=lambda t: FORCE
    )
    monitor = romerr.attach(mbs, flex, outputs=[TIP], estimators=estimator)
    mbs.Assemble()
    mbs.SolveDynamic(settings(steps=200, end=END))
    out = monitor.report().output("tip")
    modes = body.all_modes()
    eta = closed_form(modes.omega, np.full(N, 0.03), FORCE * (modes.shapes.T @ INPUTS).ravel(), monitor.report().t)
    error = np.abs(eta @ modes.shapes[7] - out.value[:, 0])
    assert np.all(error <= out.bound[estimator][:, 0] + out.round_off[:, 0])


@pytest.mark.parametrize("attached", [False, True])
def test_what_an_input_function_keeps_is_as_the_run_leaves_it(attached):
    """An integral over time takes arrays as if they were a time: none stays, and the run is the same."""
    kept = {"t": 0.0, "integral": 0.0}

    def force(t):
        kept["integral"] += 2.0 * (t - kept["t"])
        kept["t"] = t
        return FORCE + 0.0 * kept["integral"]

    mbs, body = new_mbs(), chain_body()
    flex = romerr.add_reduced_body(mbs, body, romerr.modal_basis(body, 2), inputs=INPUTS, input_function=force)
    monitor = romerr.attach(mbs, flex, outputs=[TIP]) if attached else None
    mbs.Assemble()
    mbs.SolveDynamic(settings(steps=40, end=END))
    if monitor is not None:
        assert np.all(np.isfinite(monitor.report().output("tip").bound["best"]))
    assert [type(x) for x in kept.values()] == [float, float]
    assert kept["t"] == pytest.approx(END, rel=1e-12)


def test_bodies_are_told_in_a_line():
    """Not their matrices, nor the mbs: these fill screens."""
    flex = romerr.add_reduced_body(new_mbs(), chain_body(), romerr.modal_basis(chain_body(), 3))
    scene = floating.clamped_bar(1)
    for body in (flex, romerr.floating_body(scene.fem, scene.items)):
        assert len(repr(body).splitlines()) == 1
        assert f"items={body.items}" in repr(body)
