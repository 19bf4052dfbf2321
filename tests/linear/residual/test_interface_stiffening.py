"""What rigid (RBE2) interfaces make of the error is told apart from what missing modes make of it."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.linear.residual.interface_stiffening import static_errors
from exudyn_romerr.linear.residual.problem import BoundOptions, Problem
from exudyn_romerr.model.admissible_space import Space
from models import floating, mechanisms

# Static parts share out a moving body's error: off where the parts ring differently; measured 3e-4.
SHARE = 0.01


def welded(kind="RBE2", n=4, **options):
    """Bounds of a bar, welded by one interface, loaded at the other."""
    scene = floating.clamped_bar(n, kind=kind, h=2e-5, t_end=2e-3)
    monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items, **options))
    scene.solve()
    return monitor.report()


def tip(report):
    return next(iter(report.outputs.values()))


def known_error(report):
    """Largest part of the error that is known with its sign (r,); the rest of it is below 1 %."""
    out = tip(report)
    assert np.max(out.corrected_bound) < 0.01 * np.max(np.abs(out.corrected - out.value))
    return np.max(np.abs(out.corrected - out.value), axis=0)


def test_share_is_that_of_free_interfaces_in_the_error():
    """The same run against both truths: what interfaces="rigid" leaves of the error is the share of missing modes."""
    free, rigid = welded(), welded(interfaces="rigid")
    of_modes = np.max(tip(rigid).bound["best"][:, 1:], axis=0) / known_error(free)[1:]
    causes = tip(free).causes
    share = causes["interfaces"] / (causes["interfaces"] + causes["basis"]).clip(min=np.finfo(float).tiny)
    assert np.all(np.abs(1 - share[-1, 1:] - of_modes) <= SHARE)
    np.testing.assert_allclose(sum(causes.values()), tip(free).bound["best"], rtol=1e-12)


def test_estimate_has_the_part_of_rigid_interfaces_with_its_sign():
    """What the truth with rigid interfaces lacks of the error: both estimates, less their parts of time steps."""
    free, rigid = tip(welded()), tip(welded(interfaces="rigid"))
    part = free.estimate - rigid.estimate - free.estimate_parts["time step"] + rigid.estimate_parts["time step"]
    largest = np.max(np.abs(part))
    np.testing.assert_allclose(free.estimate_parts["interfaces"], part, rtol=0, atol=SHARE * largest)
    assert largest > 0.9 * np.max(np.abs(free.estimate))
    np.testing.assert_allclose(sum(free.estimate_parts.values()), free.estimate, rtol=0, atol=1e-12 * largest)
    assert not rigid.estimate_parts["interfaces"].any()


@pytest.mark.parametrize(("kind", "options"), [("RBE3", {}), ("RBE2", {"interfaces": "rigid"})])
def test_there_is_no_such_share_where_interfaces_are_not_stiffened(kind, options):
    report = welded(kind, **options)
    assert not tip(report).causes["interfaces"].any()
    assert "RBE2" not in str(report)


@pytest.mark.parametrize("rayleigh", [(2.0, 1e-5), None])
def test_static_errors_are_the_same_without_norms_of_all_columns(rayleigh):
    """Where no estimator takes these, responses to the outputs' rows tell it; with a damping matrix, too."""
    fem = floating.load_fem("bar")
    left, right = (
        (3 * floating.interface(fem, side)[0][:, None] + np.arange(3)).ravel() for side in ("left", "right")
    )
    body = romerr.ElasticBody.from_fem(fem, rayleigh=(2.0, 1e-5), fixed=left)
    if rayleigh is None:
        mass, stiffness = body.mass, body.stiffness
        body = romerr.ElasticBody(mass, stiffness, damping=stiffness * 1e-5, fixed=left, positions=body.positions)
    stiff = Space(body.N, np.concatenate([left, right]))
    rng = np.random.default_rng(3)
    tip = romerr.node_displacement("middle", node=mechanisms.MIDDLE, component="xyz")
    outputs = [tip, romerr.Output("v", rng.standard_normal(body.N), of="velocity")]
    B, basis = rng.standard_normal((body.N, 3)), romerr.modal_basis(body, 5)
    few, all_columns = (Problem(body, basis, BoundOptions(inputs=B, outputs=outputs)) for _ in range(2))
    assert all_columns.dual.Y_K.shape[1] == few.map.coordinates.k
    found, known = (static_errors(problem, stiff) for problem in (few, all_columns))
    assert "Y_K" not in vars(few.dual)
    off = np.abs(found - known).max(axis=(0, 1)) / np.abs(known).max(axis=(0, 1))

    assert off.max() < 1e-11  # K^-1 of a bar; measured 7e-14
    assert not found[:, 3].any()
    assert known[0].any()
