"""Round-off: of the numbers that the input came in, and of the bounds themselves, which hold it."""

from dataclasses import dataclass
from functools import cache

import mpmath
import numpy as np
import pytest

import exudyn_romerr as romerr
from models import beam3d, exact, extreme_bodies, linkage, solid_bar
from models.precise import DIGITS, PreciseModes

RELATIVE = 1e-8  # of every entry: large enough to measure, small enough to be linear
W = 2 * np.pi * linkage.FREQUENCY
T = np.linspace(0, 0.5, 401)
ALL = ("state-space", "fast", "convolution", "energy", "auxiliary")
SINGLE = {"stiffness": "K", "mass": "M", "inputs": "B", "outputs": "C", "samples": "q"}


def static_report(body, basis, B, outputs):
    """One instant of the reduced body in static equilibrium under unit load."""
    V = basis.V
    q = np.linalg.solve(V.T @ (body.stiffness @ V), V.T @ B).T
    zero = np.zeros_like(q)
    return romerr.evaluate(body, basis, romerr.Trajectory([0.0], q, zero, zero, [1.0]), inputs=B, outputs=outputs)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("build", [linkage.build, lambda: solid_bar.build(0)], ids=["linkage", "solid"])
def test_perturbed_entries_move_the_output_by_less(build, seed):
    """Random relative changes of K's entries move C K^-1 B by at most the scaled round-off, and not by much less."""
    body, B, outputs = build()
    outputs = outputs if isinstance(outputs, list) else [outputs]
    report = static_report(body, romerr.krylov_basis(body, B, 3), B, outputs)
    signs = body.K.copy()
    signs.data = np.random.default_rng(seed).choice([-1.0, 1.0], signs.nnz)
    dK = body.K.multiply((signs + signs.T) / 2)
    u = body.stiffness_factor.solve(B[body.free])
    for out in outputs:
        C = out.resolve(body)[:, body.free]
        moved = RELATIVE * np.abs(C @ body.stiffness_factor.solve(dK @ u))
        allowed = RELATIVE / np.finfo(float).eps * report.output(out.name).round_off.T
        assert np.all(moved <= allowed)
        assert np.all(moved >= 1e-3 * allowed)  # signs at random cancel like the square root of their number


@cache
def true_tip():
    """The exact motion of the tip of the linkage, modes in extended precision."""
    body, B, tip = linkage.build()
    return exact.full_solution(body, B, linkage.AMPLITUDE, W).output(tip.resolve(body), T)


def exact_run(body, B, out, basis, single=(), **options):
    """Bounds of the exact reduced motion; what `single` names is rounded to 7 digits."""
    solution = exact.reduced_solution(body, basis, B, linkage.AMPLITUDE, W)
    q = [x.astype(np.float32) if "samples" in single else x for x in solution.motion(T)]
    rows = out.resolve(body)
    return romerr.evaluate(
        body,
        basis,
        romerr.Trajectory(T, *q),
        inputs=B.astype(np.float32) if "inputs" in single else B,
        outputs=[romerr.Output("tip z", rows.astype(np.float32) if "outputs" in single else rows)],
        input_function=linkage.force,
        **options,
    )


@pytest.mark.parametrize("n", [2, 4, 8, 12, 16, 20, 30, 60, 114])
def test_no_bound_is_below_the_error_not_even_by_rounding(n):
    """From 1e-4 m down to 1e-16 m, all estimators, no tolerance; near round-off the bound stops and says so."""
    body, B, out = linkage.build()
    basis = romerr.krylov_basis(body, B, n) if n < 60 else romerr.modal_basis(body, n)
    found = exact_run(body, B, out, basis, estimators=ALL, auxiliary_modes=60).compare("tip z", T, true_tip())
    for e, bound in found.bound.items():
        assert np.all(np.abs(found.error) <= bound), e
    # what interpolation over steps of 1.25 ms leaves above the 60 modes: measured 7.8e-10 m
    assert np.max(found.bound["best"]) < 1.1 * np.max(np.abs(found.error)) + 1e-9


@pytest.mark.parametrize("what", [*SINGLE, "all"])
def test_single_precision_is_taken_and_told(what):
    """Bounds are those of the numbers as they are; what their rounding has moved is within round_off."""
    names = tuple(SINGLE) if what == "all" else (what,)
    (M, K), options = linkage.matrices(), {"rayleigh": linkage.RAYLEIGH, "fixed": linkage.CLAMPED}
    M, K = (A.astype(np.float32) if name in names else A for name, A in (("mass", M), ("stiffness", K)))
    body = romerr.ElasticBody(M, K, positions=linkage.mesh()[0], **options)
    _, B, out = linkage.build()
    report = exact_run(body, B, out, romerr.krylov_basis(body, B, 8), single=names)
    found = report.compare("tip z", T, true_tip())
    assert np.all(np.abs(found.error) <= found.bound["best"] + found.round_off)
    assert ", ".join(name for name in ("mass", "stiffness", "inputs", "samples", "outputs") if name in names) in str(
        report
    )
    assert ("at round-off" in str(report)) == (what in ("stiffness", "all"))
    ours = exact_run(*linkage.build(), romerr.krylov_basis(linkage.build()[0], B, 8))
    assert np.max(found.round_off) > 100 * np.max(ours.output("tip z").round_off)
    assert "16 digits" not in str(ours)


def test_single_precision_that_spoils_the_stiffness_is_named():
    """The stiffness of a wire of 1 mm, rounded to 7 digits, is no longer positive definite."""
    nodes = np.outer(np.linspace(0, 1, 201), [1.0, 2.0, 3.0])
    elements = np.column_stack([np.arange(200), np.arange(1, 201)])
    M, K = beam3d.assemble(nodes, elements, beam3d.RoundSection(diameter=1e-3), beam3d.STEEL)
    assert romerr.ElasticBody(M, K, fixed=range(6)).N == 1206
    with pytest.raises(romerr.AssumptionError, match="single precision"):
        romerr.ElasticBody(M, K.astype(np.float32), fixed=range(6))


def test_a_report_cannot_be_written_to_where_the_run_goes_on():
    """A change in place would be in the next report, and in the bounds of a run that continues."""
    body, B, out = linkage.build()
    report = exact_run(body, B, out, romerr.krylov_basis(body, B, 4))
    for array in (report.t, report.output("tip z").value, report.output("tip z").bound["energy"]):
        with pytest.raises(ValueError, match="read-only"):
            array *= 2.0


# --- what the reduced motion lacks: an equilibrium, a state, a load that no mode follows ---------------------


def graded_chain(ratio, seed):
    """Eight masses in a row, the first one on a soft spring, the others' stiffness up to `ratio` times as large."""
    rng = np.random.default_rng(seed)
    k = np.append(ratio ** np.append(0, rng.uniform(0, 1, 7)), 0.0)
    return np.diag(rng.uniform(0.5, 2, 8)), np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)


ILL = {
    **{f"chain 1e11, {seed}": graded_chain(1e11, seed) for seed in range(6)},
    "beam 1e4": extreme_bodies.slender_beam(1e4, turned=True),
    "beam 1e5": extreme_bodies.slender_beam(1e5, turned=True),
    "link 1e5": extreme_bodies.stiff_link(1e5),
}
LAST = "y"  # the last coordinate


@dataclass
class Ill:
    """A body of condition 1e10 to 1e13, two of its modes, a load b and its static response to 50 digits."""

    body: romerr.ElasticBody
    basis: romerr.Basis
    b: np.ndarray
    static: np.ndarray
    t: np.ndarray

    @property
    def output(self):
        return romerr.Output(LAST, np.eye(len(self.b))[-1])

    def left_behind(self, load, **options):
        """The output of a reduced body that stays at zero, under a load that is constant."""
        zero = np.zeros((len(self.t), 2))
        traj = romerr.Trajectory(self.t, zero, zero, zero, np.full(len(self.t), load))
        common = {"inputs": self.b[:, None], "input_function": lambda t: load + 0 * t, "outputs": [self.output]}
        return romerr.evaluate(self.body, self.basis, traj, **common, **options).output(LAST)


@cache
def ill(name):
    M, K = ILL[name]
    body, b = romerr.ElasticBody(M, K, rayleigh=(0.0, 0.0)), np.random.default_rng(1).standard_normal(len(M))
    with mpmath.workdps(DIGITS):
        static = mpmath.lu_solve(mpmath.matrix(K.tolist()), mpmath.matrix(b.tolist()))
    t = np.linspace(0, 6 / float(body.modes(1).omega[0]), 21)
    return Ill(body, romerr.modal_basis(body, 2), b, np.array([float(x) for x in static]), t)


def check_covered(out, true):
    """By every estimator, without tolerance."""
    for e, bound in out.bound.items():
        assert np.all(np.abs(true - out.value[:, 0]) <= bound[:, 0]), e


@pytest.mark.parametrize("name", ILL)
def test_an_equilibrium_is_known_to_its_rounding(name):
    """The full body stays in it: bounds were up to 9e-6 of it too low, and round_off zero."""
    case = ill(name)
    out = case.left_behind(1.0, initial="equilibrium", estimators=("fast", "energy", "auxiliary"))
    check_covered(out, case.static[-1])
    assert np.all(np.abs(case.static[-1] - out.corrected[:, 0]) <= out.corrected_bound[:, 0])
    moved = out.round_off[:, 0] / np.abs(case.static[-1])
    condition = np.linalg.cond(case.body.K.toarray())
    assert np.all(moved > 0)
    assert np.all(moved < 10 * np.finfo(float).eps * condition)  # no more than any solve with K may lose


@pytest.mark.parametrize("name", ILL)
def test_a_given_state_rings_with_its_rounding(name):
    """Free motion from the static response."""
    case = ill(name)
    out = case.left_behind(0.0, initial=(case.static, 0 * case.static), estimators=("fast", "energy", "auxiliary"))
    truth = PreciseModes(*ILL[name], (0.0, 0.0), 0 * case.b, 1.0, case.static)
    check_covered(out, truth.motion(case.t)[0][:, -1])
