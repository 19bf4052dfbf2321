"""make_plan: what is computed for a scene, and what is left out and why."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...report.data import Plan
from ...report.scope import Scene
from ..estimators import ESTIMATORS
from ..residual.problem import BoundOptions, Problem

NO_NODES = "the body has no node positions"
IN_THE_SPAN = "the full body starts in the span of V (initial=None)"


def make_plan(problem: Problem, names: tuple[str, ...], options: BoundOptions, scene: Scene) -> Plan:
    """Return the plan of estimators `names`, chosen by what `options` ask for.

    Made last: what a problem makes when first needed, and has not made by then, is left out.
    """
    body, layout, made = problem.body, problem.map.coordinates, vars(problem)
    merged = "Rayleigh damping is merged into M V and K V" if any(body.rayleigh or ()) else "undamped"
    all_modes = "state-space" in names or (options.kernels == "spectrum" and "kernel" in made)
    at_nodes = NO_NODES if body.positions is None else "made when report.node_bound is asked for"
    left_out = [
        *_estimators_not_made(problem, names),
        ("kernel" not in made, "kernels of Phi12", "no estimator asked for takes them"),
        *_modes_not_made(problem, all_modes),
        *((True, *pair) for pair in scene.left_out),
        (scene.pose is None, "terms of a turning frame", "the body has no frame"),
        (not layout.p, "load columns B", "nothing loads the body"),
        (not layout.has_damping, "damping columns D V", merged),
        (not problem.has_initial_error, "initial error, Phi11", IN_THE_SPAN),
        (options.time == "sampled", "bound of the error of the time integration", "time='sampled'"),
        (options.tolerance is None, "comparison with a tolerance", "none was given"),
        (True, "bounds at nodes", at_nodes),
        (True, "errors of static solves", "made when a static solve begins"),
        (True, "plots", "made, and matplotlib loaded, when report.plot is called"),
    ]
    computed = _computed(problem, names, options, scene)
    return Plan(tuple(computed), tuple((what, why) for is_left_out, what, why in left_out if is_left_out))


def _computed(problem: Problem, names: tuple[str, ...], options: BoundOptions, scene: Scene) -> Iterator[str]:
    body = problem.body
    yield f"scope: {scene.scope}"
    yield f"body: N = {body.N} coordinates, {body.fixed.size} fixed"
    yield f"basis: {problem.basis.note}"
    yield from scene.computed
    yield f"residual: {problem.map.coordinates.k} columns, {options.residual}"
    for name in names:
        yield f"estimator {name!r}{_details(problem, name)}"
    for out in problem.outputs:
        if out.is_requested:
            yield f"output {out.name!r}: {out.of}{out.unit and f' in {out.unit}'}"
    if problem.has_initial_error:
        where = "its own static equilibrium" if problem.initial_state is None else "the state given as initial="
        yield f"initial error: the full body starts in {where}"
    if options.time == "reconstructed":
        yield "error of the time integration: quintic reconstruction between steps"
    if options.tolerance is not None:
        yield "a tolerance is to stop the solve: bounds of every step are compared, some steps at a time"


def _details(problem: Problem, name: str) -> str:
    if name == "auxiliary":
        modes = problem.split.modes
        cap_note = f"; {modes.cap_note}" if modes.cap_note else ""
        return f": {modes.omega.size} modes up to {modes.omega[-1]:.4g} rad/s, none missed{cap_note}"
    return f": kernel '{problem.options.kernels}'" if name in ("fast", "convolution") else ""


def _estimators_not_made(problem: Problem, names: tuple[str, ...]) -> Iterator[tuple[bool, str, str]]:
    reasons: dict[str, list[str]] = {}
    for name in ESTIMATORS:
        if problem.options.estimators != "auto":
            why = "not asked for"
        elif name == "auxiliary" and problem.body.proportional is None:
            why = "needs Rayleigh damping, or ratios by mode"
        else:
            why = "'auto' takes sharper ones"
        reasons.setdefault(why, []).extend([] if name in names else [repr(name)])
    for why, others in reasons.items():
        yield bool(others), f"estimator {', '.join(others)}", why


def _modes_not_made(problem: Problem, all_modes: bool) -> Iterator[tuple[bool, str, str]]:
    if "split" in vars(problem):
        modes = problem.split.modes
        yield bool(np.isfinite(modes.cut)), f"modes above {modes.omega[-1]:.4g} rad/s", "bounded together"
    else:
        yield not all_modes, "modes above the first", "no estimator asked for takes them"
