"""The examples, shortened: they run, write what they say they write, and their numbers are right."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import exudyn_romerr as romerr
from examples import (
    boom,
    clamped_bar,
    double_pendulum,
    error_against_run_time,
    flexible_pendulum,
    fundamental_matrix_norms,
    how_many_modes,
    hump,
    linkage_scene,
    paper_linkage,
    rotor_run_up,
    slider_crank,
    sprung_body,
    suspension_linkage,
)
from models import exact, linkage

ROOT = Path(__file__).resolve().parents[2]
SHORT = 0.03  # s simulated: the largest reduction error of the linkage comes within the first 10 ms
PNG = b"\x89PNG"
# The closed form loses nothing but rounding, 1e-16, times the spread of the terms of the equation of motion.
CLOSED_FORM = 1e-9


def random_body(seed, alpha, beta):
    rng = np.random.default_rng(seed)
    M, K = (x @ x.T + 5 * np.eye(5) for x in rng.standard_normal((2, 5, 5)))
    return romerr.ElasticBody(M, 50 * K, rayleigh=(alpha, beta), fixed=[3]), rng.standard_normal((5, 2))


def residual(body, B, amplitude, W, t, q, q_t, q_tt):
    """Residual of the equations of motion on the free coordinates, over the largest elastic force."""
    alpha, beta = body.rayleigh
    u = np.outer(np.sin(W * t), np.broadcast_to(amplitude, B.shape[1]))
    inertia, elastic = body.mass @ (q_tt + alpha * q_t).T, body.stiffness @ (q + beta * q_t).T
    return np.max(np.abs(inertia + elastic - B @ u.T)[body.free]) / np.max(np.abs(elastic))


@pytest.mark.parametrize("rayleigh", [(0.0, 0.0), (0.3, 0.01), (200.0, 0.0), (0.0, 2.0)])
def test_exact_solution_meets_the_equations_of_motion_from_a_given_state(rayleigh):
    body, B = random_body(1, *rayleigh)
    state = np.random.default_rng(2).standard_normal((2, 5))
    state[:, 3] = 0.0
    t = np.linspace(0, 3, 50)
    q, q_t, q_tt = exact.full_solution(body, B, (2.0, -1.0), 3.0, state).motion(t)
    assert residual(body, B, (2.0, -1.0), 3.0, t, q, q_t, q_tt) < CLOSED_FORM
    np.testing.assert_allclose([q[0], q_t[0]], state, atol=1e-12)
    assert np.all(q[:, 3] == 0)


def test_exact_velocity_is_the_derivative_of_the_exact_displacement():
    body, B = random_body(3, 0.3, 0.01)
    solution = exact.full_solution(body, B, 1.0, 2.0)
    h = 1e-5
    before, now, after = (solution.motion([1.0 + x]) for x in (-h, 0.0, h))
    for k in (0, 1):
        np.testing.assert_allclose((after[k] - before[k]) / (2 * h), now[k + 1], rtol=1e-6, atol=1e-8)


def test_exact_reduced_solution_of_the_full_basis_is_the_full_solution():
    body, B = random_body(4, 0.3, 0.01)
    basis = romerr.Basis(body.expand(np.random.default_rng(5).standard_normal((4, 4))))
    t = np.linspace(0, 3, 20)
    trajectory = exact.reduced_trajectory(exact.reduced_solution(body, basis, B, 1.0, 2.0), t, 1.0, 2)
    np.testing.assert_allclose(
        trajectory.q @ basis.V.T, exact.full_solution(body, B, 1.0, 2.0).motion(t)[0], atol=1e-13
    )
    np.testing.assert_allclose(trajectory.u, np.sin(2 * t)[:, None] * [1, 1])


def test_exact_reduced_solution_refuses_petrov_galerkin():
    body, B = random_body(6, 0.3, 0.01)
    V, W = np.eye(5)[:, :2], np.eye(5)[:, :2] + 0.1
    with pytest.raises(ValueError, match="Galerkin"):
        exact.reduced_solution(body, romerr.Basis(V, W), B, 1.0, 2.0)


def test_truth_of_the_linkage_does_not_depend_on_its_coordinates():
    body = linkage_scene.body
    t = np.linspace(0, 2, 201)
    basis = romerr.krylov_basis(body, linkage_scene.INPUTS, 84)
    solution = exact.reduced_solution(body, basis, linkage_scene.INPUTS, linkage.AMPLITUDE, linkage_scene.OMEGA)
    other = solution.output(linkage_scene.OUTPUT.resolve(body) @ basis.V, t)[:, 0]
    assert np.max(np.abs(other - linkage_scene.exact_tip(t))) < linkage_scene.TRUTH_FLOOR


@pytest.fixture(scope="module")
def suspension(tmp_path_factory):
    directory = tmp_path_factory.mktemp("suspension")
    return paper_linkage.main(["--output", str(directory)], end=SHORT), directory


def test_paper_linkage_prints_the_published_constants(capsys):
    paper_linkage.print_constants(paper_linkage.constants())
    rows = re.findall(r"^(C\d+) +(\S+) +(\S+) ", capsys.readouterr().out, re.MULTILINE)
    assert [name for name, *_ in rows] == ["C1", "C11", "C12", "C2"]
    for _, computed, published in rows:
        assert float(computed) == pytest.approx(float(published), rel=5e-5)


def test_paper_linkage_bounds_hold_and_time_integration_is_exact_enough(suspension):
    run, _ = suspension
    reduction, total = run.true_errors(np.arange(len(run.report.t)))
    for bound in run.output.bound.values():
        assert np.all(np.abs(reduction) <= bound[:, 0])
    assert np.max(np.abs(total)) == pytest.approx(np.max(np.abs(reduction)), rel=0.05)
    assert np.max(np.abs(reduction)) == pytest.approx(2.3e-9, rel=0.05)


def test_paper_linkage_writes_pictures_and_tables(suspension):
    run, directory = suspension
    for name in ("paper_linkage.png", "error_against_run_time.png"):
        assert (directory / name).read_bytes().startswith(PNG)
    table = np.loadtxt(directory / "paper_linkage.csv", delimiter=",", skiprows=1)
    t, value, fast, convolution, reduction, total = table.T
    np.testing.assert_allclose(t, np.linspace(0, SHORT, 201))
    assert np.all(np.abs(reduction) <= convolution)
    assert np.all(convolution <= fast)
    np.testing.assert_allclose(total, reduction, atol=0.05 * np.max(np.abs(reduction)))
    np.testing.assert_allclose(value[-1], run.output.value[-1, 0])


def test_error_against_run_time_lists_every_level_and_labels_what_is_bounded(suspension):
    text = (suspension[1] / "error_against_run_time.txt").read_text()
    names = ["Krylov 6", "Krylov 12", "Krylov 24", "Krylov 30", "Krylov 36", "Krylov 84", "modal 12", "Gramian 12"]
    assert re.findall(r"^(\w+ \d+) ", text, re.MULTILINE) == names
    assert "reduction error / m: true, and its bounds" in text
    assert "(not bounded)" in text
    assert "Krylov 84: the time error of generalised-alpha" in text


def test_error_against_run_time_rows_are_bounded(tmp_path):
    cases = [
        ("Krylov 6", error_against_run_time.krylov(6), None),
        ("Krylov 84", error_against_run_time.krylov(84), 1e-4),
    ]
    six, eighty_four = (error_against_run_time.row(*case, end=SHORT) for case in cases)
    for line in (six, eighty_four):
        assert line.reduction <= line.bound["convolution"] <= line.bound["fast"]
    assert not six.remark
    assert "none affordable" in eighty_four.remark
    error_against_run_time.draw([six, eighty_four], tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(PNG)


def test_paper_linkage_writes_the_figure_alone(tmp_path):
    path = tmp_path / "figures" / "readme.png"
    paper_linkage.main(["--figure", str(path)], end=SHORT)
    assert path.read_bytes().startswith(PNG)
    assert list(path.parent.iterdir()) == [path]


def test_hump_rises_with_frequency_while_phi12_falls(tmp_path, capsys):
    hump.main(["--output", str(tmp_path)])
    assert (tmp_path / "hump.png").read_bytes().startswith(PNG)
    Phi12, Phi21, C1 = np.array([hump.suprema(m) for m in hump.MASSES]).T
    assert np.all(np.diff(Phi12) < 0)
    assert np.all(np.diff(Phi21) > 0)
    for m, supremum, bound in zip(hump.MASSES, Phi21, C1, strict=True):
        Phi = hump.fundamental_matrix(m, hump.TIMES)
        assert np.max(np.abs(Phi[:, 1, 0])) == pytest.approx(supremum, rel=1e-4)
        assert np.max(np.linalg.norm(Phi, 2, axis=(1, 2))) <= bound
    assert len(capsys.readouterr().out.splitlines()) == 2 + len(hump.MASSES)


def test_fundamental_matrix_norms_agree_with_the_exponential(tmp_path, capsys):
    fundamental_matrix_norms.main(["--output", str(tmp_path)], few=2)
    assert (tmp_path / "fundamental_matrix_norms.png").read_bytes().startswith(PNG)
    printed = capsys.readouterr().out
    assert "extrapolated from 2" in printed
    assert float(re.search(r"agree to (\S+) of", printed)[1]) < 1e-5


def test_suspension_linkage_prints_the_bound_and_draws_it(tmp_path, capsys):
    report = suspension_linkage.main(tmp_path, steps=200)
    out = report.output("tip z")
    # 200 steps of 10 ms: the error is that of the time step, which the sampled residual cannot see
    assert np.all(np.abs(out.error) <= out.bound["best"] + CLOSED_FORM * np.abs(out.value).max())
    assert out.effectivity["best"][0] < 1.2
    assert re.search(
        r"\nStep: too large, about .* at tip z; take [\d,]+ steps, \d+ times as short\.\n", capsys.readouterr().out
    )
    assert (tmp_path / "suspension_linkage.png").read_bytes()[:4] == PNG


def test_clamped_bar_bounds_what_a_truth_shows_that_has_a_bound_itself(tmp_path, capsys):
    report, truth = clamped_bar.main(tmp_path, t_end=0.004)
    out, full = report.output("tip z"), truth.output("tip z")
    own = full.corrected_bound[::4]  # |error| <= bound holds for the exact truth; this one is within `own` of it
    np.testing.assert_allclose(truth.t[::4], report.t, rtol=1e-12)
    assert np.all(np.abs(out.error) <= out.bound["best"] + own)
    assert out.effectivity["best"][0] < 1.5
    assert set(report.scope.values()) == {"complete"}
    printed = capsys.readouterr().out
    assert "itself within" in printed
    assert "is above the bound" not in printed  # no alarm by a truth that is worse than the bound
    assert (tmp_path / "clamped_bar.png").read_bytes()[:4] == PNG


def test_flexible_pendulum_has_the_same_bounds_from_its_file(tmp_path, capsys):
    report, from_file = flexible_pendulum.main(tmp_path, t_end=0.005)
    for name, out in report.outputs.items():
        np.testing.assert_array_equal(out.value, from_file.output(name).value)
        np.testing.assert_allclose(out.bound["best"], from_file.output(name).bound["best"], rtol=1e-12)
    assert set(report.scope.values()) == {"inputs frozen"}
    printed = capsys.readouterr().out
    assert "\nNot covered by any estimate: tip" in printed
    assert "these react to the bar's deformation" in printed
    assert re.search(r"z: .* inputs frozen .*, coupled ", printed)
    assert (tmp_path / "flexible_pendulum.png").read_bytes()[:4] == PNG


def test_rotor_run_up_has_a_bound_that_says_something(tmp_path, capsys):
    report = rotor_run_up.main(tmp_path, t_end=0.1)
    out = report.output("rim")
    assert np.all(out.bound["best"].max(axis=0) < 0.2 * np.abs(out.value).max(axis=0))
    assert set(report.scope.values()) == {"inputs frozen"}
    assert "\nNot covered by any estimate: rim" in capsys.readouterr().out
    assert (tmp_path / "rotor_run_up.png").read_bytes()[:4] == PNG


def test_double_pendulum_shows_what_frozen_inputs_hide(tmp_path, capsys):
    found = double_pendulum.main(tmp_path, t_end=0.002)
    coupled, frozen = ([report.output(f"tip {bar}") for bar in (1, 2)] for report in found.values())
    for out in coupled:
        assert np.all(np.abs(out.error) <= out.bound["best"])
        assert out.effectivity["best"][0] < 1.1
    assert frozen[0].effectivity["best"][0] < 0.5
    for scope, report in found.items():
        assert [set(one.scope.values()) for one in (report, *report.bodies)] == [{scope}] * 3
    assert "tip 2: true error up to" in capsys.readouterr().out
    assert (tmp_path / "double_pendulum.png").read_bytes()[:4] == PNG


def test_slider_crank_is_bounded_by_one_level_and_by_two(tmp_path, capsys):
    levels = slider_crank.main(tmp_path, t_end=0.01)
    coarse, fine = (reports[0].output(slider_crank.NAME) for reports in (levels.coarse, levels.fine))
    by_two = levels.output(slider_crank.NAME).bound
    for out, bound in ((coarse, coarse.bound["best"]), (coarse, by_two), (fine, fine.bound["best"])):
        assert np.all(np.abs(out.error) <= bound)
        assert np.max(bound) < 1.1 * np.max(np.abs(out.error))
    assert "runs with n = 0 and n = 4" in capsys.readouterr().out
    assert (tmp_path / "slider_crank.png").read_bytes()[:4] == PNG


def test_sprung_body_is_bounded_from_its_static_equilibrium_on(tmp_path, capsys):
    static, dynamic = sprung_body.main(tmp_path, t_end=0.01)
    out = dynamic.output(sprung_body.NAME)
    assert static.time == "static"
    assert set(dynamic.scope.values()) == {"coupled (linearised)"}
    assert 0 < np.abs(out.error[0, 0]) <= out.bound["best"][0, 0] < 1.1 * np.abs(out.error[0, 0])
    assert np.all(np.abs(out.error) <= out.bound["best"])
    assert np.all(np.abs(out.error + out.value - out.corrected) <= out.corrected_bound)
    assert "of the corrected output" in capsys.readouterr().out
    assert (tmp_path / "sprung_body.png").read_bytes()[:4] == PNG


def test_modes_that_the_rod_needs_are_found(tmp_path, capsys):
    choices = how_many_modes.main(tmp_path, t_end=0.01, shown=(0, 4))
    assert all(choice.met and len(choice.tried) <= 4 for choice in choices)
    assert choices[0].n <= choices[1].n
    printed = capsys.readouterr().out
    assert printed.count("; its bounds are within the tolerance; their scope: coupled (linearised)") == 2
    assert "4 eigenmodes: true error" in printed
    assert (tmp_path / "how_many_modes.png").read_bytes()[:4] == PNG


def test_bounds_of_a_model_of_pymor_are_nearer_than_its_norms():
    pytest.importorskip("pymor")
    from examples import pymor_second_order

    true, about, most, by_norm = pymor_second_order.main()
    assert about == pytest.approx(true, rel=1e-3)
    assert true <= most <= 1.01 * true
    assert by_norm > 100 * most


def solved_as_in_exudyn(steps):
    """What the example for Exudyn's folder has at its end, of short thick links that are meshed and solved fast."""
    path = ROOT / "examples" / "reductionErrorCMS.py"
    code = path.read_text(encoding="utf-8").replace("endTime = 0.5", "endTime = 0.01")
    for name, value in {"useGraphics": False, "nSteps": steps, "W": 0.2}.items():
        code, count = re.subn(rf"^{name} *= *\S+", f"{name} = {value}", code, flags=re.MULTILINE)
        assert count == 1
    found = {}
    exec(compile(code, path, "exec"), found)
    return found["report"]


def test_example_for_exudyn_is_as_wrong_as_it_says(capsys):
    """The truth are steps 20 times as short, whose own error is a seventh of the half width."""
    pytest.importorskip("ngsolve")
    coarse, fine = (solved_as_in_exudyn(steps) for steps in (20, 400))
    assert "Step: too large" in capsys.readouterr().out
    tip = coarse.output("tip")
    error = fine.output("tip").value[::20] - tip.value
    half = tip.uncertainty.max(axis=0)
    assert np.all(np.abs(error - tip.estimate_parts["time step"]).max(axis=0) <= half)
    assert np.abs(error).max() > 10 * half.max()


def test_crane(tmp_path, monkeypatch):
    short = partial(boom.boom, t_end=0.04)
    monkeypatch.setattr(boom, "boom", lambda n=8, h=0.02, **_: short(h=h))
    monkeypatch.setattr(boom, "FINER", (1, 2))
    boom.draw(str(path := tmp_path / "boom.png"))
    assert path.read_bytes().startswith(PNG)


def test_crane_prints_where_its_payload_is(monkeypatch, capsys):
    monkeypatch.setattr(boom, "boom", partial(boom.boom, t_end=0.04))
    monkeypatch.setattr("sys.argv", ["boom.py", "0.02"])
    boom.main()
    shown = capsys.readouterr().out.rpartition("payload: [")[2].rstrip("]\n")
    x, y, z = map(float, shown.split())
    assert abs(x) + abs(y) < 1e-2
    assert -5e-3 < z < -4e-3  # what it hangs on has given way
