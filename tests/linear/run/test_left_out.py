"""What a plan leaves out costs nothing: it is not computed, not factorised, not allocated, not imported."""

import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from exudyn import itemInterface

import exudyn_romerr as romerr
from exudyn_romerr.linalg import eigenmodes as modes
from exudyn_romerr.linalg.symmetric_factor import SymmetricFactor
from exudyn_romerr.linear.residual.problem import Problem
from exudyn_romerr.linear.run import prepare as offline
from exudyn_romerr.linear.run.prepare import BoundOptions
from exudyn_romerr.linear.run.run import BLOCK, Run
from exudyn_romerr.mechanism.mechanism import Mechanism
from exudyn_romerr.model import body as body_module
from models import floating, linkage
from tests.helpers import mbs_scenes
from tests.helpers.mechanism_runs import FROZEN, pendulum, solve, watch

ROOT = Path(__file__).resolve().parents[3]
BODY, B, TIP = linkage.build()
BASIS = romerr.krylov_basis(BODY, B, 6)
AUTO_CAP = 60  # modes among which "auto" chooses


def fresh_body(**changes):
    """The linkage's body, without what other tests had it compute."""
    options = {"rayleigh": BODY.rayleigh, "fixed": BODY.fixed, "positions": BODY.positions, **changes}
    return romerr.ElasticBody(BODY.mass, BODY.stiffness, **options)


class Watched:
    """What was made, by name; m of every computation of modes; problems, the last one last."""

    def __init__(self):
        self.made, self.modes, self.problems = Counter(), [], []

    @property
    def problem(self):
        """What the last problem has made, by name of the attribute."""
        problem = self.problems[-1]
        return {*vars(problem), *vars(problem.dual), *vars(problem.rows)}

    def count(self, monkeypatch, owner, name, label=None):
        """Count calls of a function."""
        original, label = getattr(owner, name), label or name

        def counted(*arguments, **options):
            self.made[label] += 1
            return original(*arguments, **options)

        monkeypatch.setattr(owner, name, counted)


@pytest.fixture
def watched(monkeypatch):
    """Count factorisations, and constructions of what plans leave out."""
    found = Watched()
    original_init, lowest = Problem.__init__, modes.lowest_modes

    def init(self, *arguments, **options):
        found.problems.append(self)
        original_init(self, *arguments, **options)

    def lowest_modes(M, K, m, factor):
        found.modes.append(m)
        return lowest(M, K, m, factor)

    monkeypatch.setattr(Problem, "__init__", init)
    monkeypatch.setattr(body_module, "lowest_modes", lowest_modes)
    found.count(monkeypatch, SymmetricFactor, "__init__", "factor")
    found.count(monkeypatch, modes, "negative_eigenvalues", "count")
    for owner, name in ((offline, "Turning"), (offline, "StaticError"), (offline, "node_bounds")):
        found.count(monkeypatch, owner, name)
    found.count(monkeypatch, Mechanism, "__init__", "mechanism")
    return found


def prepared(body=None, **options):
    """The offline part of the linkage."""
    options = {"inputs": B, "input_function": linkage.force, "outputs": [TIP], **options}
    return offline.prepare(body or fresh_body(), BASIS, BoundOptions(**options))


def left_out(plan):
    """What -> why."""
    return dict(plan.left_out)


# --- estimators, modes, factors ---------------------------------------------

MADE = {  # estimators -> (what must not be made for them, modes computed)
    "energy": ({"split", "kernel", "Y_M", "norm_M"}, [1]),
    "fast": ({"split", "Y_K", "norm_K", "Y_static", "norm_static", "static_rows"}, [1]),
    "convolution": ({"split", "Y_K", "norm_K", "Y_static", "norm_static", "static_rows"}, [1]),
    "auxiliary": ({"kernel", "Y_M", "norm_M", "norm_K", "norm_static"}, [5]),
    ("fast", "energy"): ({"split"}, [1]),
    ("energy", "auxiliary"): ({"kernel", "Y_M", "norm_M"}, [5]),
    "auto": ({"kernel", "Y_M", "norm_M"}, [5]),
}


@pytest.mark.parametrize("names", MADE, ids=str)
def test_estimators_not_asked_for_leave_nothing_behind(watched, names):
    """Neither their norms, nor kernels, nor modes; K and M are factorised once, when the body is made."""
    absent, computed = MADE[names]
    body = fresh_body()
    watched.made.clear()
    plan = prepared(body, estimators=names, auxiliary_modes=5).plan
    assert watched.problem & absent == set()
    assert watched.modes == computed
    assert watched.made["factor"] == 0
    assert ("modes above the first" in left_out(plan)) == (computed == [1])
    assert ("kernels of Phi12" in left_out(plan)) == ("kernel" in absent)


def test_what_is_asked_for_is_made(watched):
    """Otherwise the test above would pass on names that no longer exist."""
    prepared(estimators=("fast", "energy", "auxiliary"), initial="equilibrium")
    assert watched.problem >= set.union(*(absent for absent, _ in MADE.values()))


def test_modes_are_computed_once(watched):
    """Those that "auto" chooses among; a second monitor of the body finds them."""
    body = fresh_body()
    plan = prepared(body).plan
    assert watched.modes == [AUTO_CAP]
    prepared(body)
    assert watched.modes == [AUTO_CAP]
    assert "5 modes up to" in str(plan)


def test_large_body_is_factorised_no_more_than_its_modes_need(watched):
    """Above the limit of dense eigenproblems: K, M, and K - sigma M once, to prove that no mode is missed."""
    n = modes.DENSE_LIMIT + 100
    K = sp.diags([np.full(n, 2.0), np.full(n - 1, -1.0), np.full(n - 1, -1.0)], [0, 1, -1])
    body = romerr.ElasticBody(sp.identity(n), K, rayleigh=(0.1, 0.0))
    assert watched.made["factor"] == 2
    offline.prepare(
        body, romerr.Basis(np.eye(n)[:, :3]), BoundOptions(outputs=[], auxiliary_modes=4), sampled_inputs=True
    )
    assert (watched.made["factor"], watched.made["count"]) == (2, 1)
    assert watched.modes == [4]


# --- terms of the residual --------------------------------------------------


def test_zero_initial_error_has_no_norms_and_no_stream():
    """Phi11 is for an initial error only."""
    without, with_it = prepared(), prepared(initial="equilibrium")
    for part, has in ((without, False), (with_it, True)):
        assert ("initial error, Phi11" in left_out(part.plan)) == (not has)
        assert ("initial" in Run(part)._streams) == has
        assert all((e.start_norms is not None) == has for e in part.estimators.values())
    extra = prepared(initial=(np.zeros(BODY.N), np.zeros(BODY.N)))
    assert (
        extra.estimators["auxiliary"].start_rows.shape[1] == without.estimators["auxiliary"].start_rows.shape[1] + 2
    )


@pytest.mark.parametrize(
    ("rayleigh", "residual", "columns", "why"),
    [
        (None, "orthonormal", 13, "undamped"),
        (None, "expanded", 13, "undamped"),
        ((1.0, 1e-5), "orthonormal", 13, "merged into M V and K V"),
        ((1.0, 1e-5), "expanded", 19, None),
    ],
)
def test_damping_has_columns_only_where_it_needs_them(rayleigh, residual, columns, why):
    """6 modes and one load; D itself is not made where it has none."""
    body = fresh_body(rayleigh=rayleigh)
    part = prepared(body, residual=residual)
    assert part.coordinates.k == columns
    assert "expanded" in residual or "D" not in vars(body)
    assert ("damping columns D V" in left_out(part.plan)) == (why is not None)
    assert (why or "") in left_out(part.plan).get("damping columns D V", "")


def clamped(marker=False, **options):
    """A welded bar of 6 + 2 modes that 3 forces and gravity act on, and a monitor of its tip."""
    scene = floating.clamped_bar(2, h=2e-4, t_end=0.004)
    nodes, weights = floating.interface(scene.fem, "tip")
    if marker:
        scene.mbs.AddMarker(
            itemInterface.MarkerSuperElementPosition(
                bodyNumber=scene.items["oFFRFreducedOrder"], meshNodeNumbers=nodes, weightingFactors=weights
            )
        )
    tip = romerr.node_displacement("tip", node=nodes[0], component="z")
    return scene, romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items), outputs=[tip], **options)


def test_frame_at_rest_has_no_terms_of_turning(watched):
    """16 columns of modes, 3 of gravity, 3 of the load; none of the 9 n that turn."""
    scene, monitor = clamped()
    scene.solve()
    plan = monitor.report().plan
    assert "22 columns" in str(plan)
    assert "welds" in left_out(plan)["terms of a turning frame"]
    assert [watched.made[name] for name in ("Turning", "mechanism")] == [0, 0]


def test_frame_that_turns_has_them(watched):
    """The same counters see them where they are needed."""
    scene = pendulum()
    monitors = watch(scene, 1, scope=FROZEN)
    solve(scene)
    assert watched.made["Turning"] == 2  # "energy" and "auxiliary"
    assert watched.made["mechanism"] == 0
    assert "terms of a turning frame" not in left_out(monitors[0].report().plan)
    scene = pendulum()
    monitors = watch(scene)
    solve(scene)
    monitors[0].report()
    assert (watched.made["mechanism"], watched.made["Turning"]) == (1, 2)  # told by the mechanism, which has its own


# --- while a solve runs -----------------------------------------------------


@pytest.mark.parametrize("tolerance", [None, 1e9])
def test_without_a_tolerance_nothing_is_evaluated_step_by_step(watched, monkeypatch, tolerance):
    """300 steps: two blocks, the first of one step; or 1, 2, 4 ... up to 128 at once."""
    watched.count(monkeypatch, Run, "advance")
    mbs, _, monitor = mbs_scenes.scene(tolerance=tolerance)
    mbs.SolveDynamic(mbs_scenes.settings(steps=300))
    plan = monitor.report().plan
    assert BLOCK > 300
    assert watched.made["advance"] == (1 if tolerance is None else 8)
    assert ("comparison with a tolerance" in left_out(plan)) == (tolerance is None)
    assert ("a tolerance is to stop the solve" in str(plan.computed)) == (tolerance is not None)


def test_later_work_waits_until_it_is_asked_for(watched):
    """Static errors, bounds at nodes."""
    scene, monitor = clamped()
    scene.solve()
    report = monitor.report()
    assert [watched.made[name] for name in ("StaticError", "node_bounds")] == [0, 0]
    assert {"errors of static solves", "bounds at nodes", "plots"} <= set(left_out(report.plan))
    report.node_bound["energy"]
    assert [watched.made[name] for name in ("StaticError", "node_bounds")] == [0, 1]
    scene.mbs.SolveStatic(scene.settings)
    assert [watched.made[name] for name in ("StaticError", "node_bounds")] == [1, 1]


# --- imports ----------------------------------------------------------------

HEAVY = (
    "exudyn",
    "exudyn_romerr.mbs",
    "matplotlib",
    "scipy.signal",
    "scipy.stats",
    "scipy.optimize",
    "scipy.integrate",
)
EVALUATED = """
import sys
import numpy as np
import exudyn_romerr as romerr
n = 4
body = romerr.ElasticBody(np.eye(n), np.diag(np.arange(1.0, 1 + n)), rayleigh=(0.1, 0.01))
t = np.linspace(0, 1, 9)
q = np.outer(np.sin(t), [1.0, 0.5]), np.outer(np.cos(t), [1.0, 0.5]), np.outer(-np.sin(t), [1.0, 0.5])
basis, y = romerr.modal_basis(body, 2), romerr.Output("y", np.ones(n))
report = romerr.evaluate(body, basis, romerr.Trajectory(t, *q), outputs=[y])
str(report), str(report.plan), report.save(PATH), romerr.load_report(PATH)
"""
SOLVED = """
import sys
import exudyn
before = set(sys.modules)
from tests.helpers import mbs_scenes
mbs, _, monitor = mbs_scenes.scene()
mbs.SolveDynamic(mbs_scenes.settings())
str(monitor.report()), str(monitor.plan)
"""


def loaded_after(code, names, tmp_path):
    """Which of the modules a script has loaded at its end, in a Python of its own."""
    code = f"PATH = {str(tmp_path / 'run.npz')!r}\n{code}\n"
    code += f"print([name for name in {names!r} if name in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    return run.stdout.strip().splitlines()[-1]


def test_report_of_a_stored_trajectory_loads_nothing_heavy(tmp_path):
    """Neither Exudyn nor matplotlib, nor the slow parts of scipy; until a plot is asked for."""
    code = f"{EVALUATED}assert not {{*{HEAVY!r}}} & {{*sys.modules}}\nreport.plot()\n"
    assert loaded_after(code, ("matplotlib.figure",), tmp_path) == "['matplotlib.figure']"


def test_solve_loads_nothing_that_draws(tmp_path):
    """Exudyn loads matplotlib's base by itself; no figures."""
    names = ("matplotlib.figure", "matplotlib.pyplot", "tkinter", "scipy.signal", "scipy.stats")
    assert loaded_after(SOLVED, names, tmp_path) == "[]"
