"""make_plan: what is computed for a scene, and what is left out and why."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...model.body import ElasticBody
from ...report.data import Plan
from ...report.scope import Scene
from ..estimators import ESTIMATORS
from ..residual.problem import BoundOptions, Problem

NO_NODES = "the body has no node positions"


def make_plan(problem: Problem, names: tuple[str, ...], options: BoundOptions, scene: Scene) -> Plan:
    """Return the plan of estimators `names`, chosen by what `options` ask for.

    Made last: what a problem makes when first needed, and has not made by then, is left out.
    """
    sampled = options.time == "sampled"
    left_out = [
        *_estimators_not_made(problem, names, options.estimators),
        *scene.left_out,
        *_terms_not_there(problem, scene),
        *([("bound of the error of the time integration", "time='sampled'")] if sampled else []),
        *([] if options.live else [("comparison with a tolerance", "none was given")]),
        (
            "bounds at nodes",
            NO_NODES if problem.body.positions is None else "made when report.node_bound is asked for",
        ),
        ("errors of static solves", "made when a static solve begins"),
        ("plots", "made, and matplotlib loaded, when report.plot is called"),
    ]
    return Plan(tuple(_computed(problem, names, options, scene)), tuple(left_out))


def _computed(problem: Problem, names: tuple[str, ...], options: BoundOptions, scene: Scene) -> Iterator[str]:
    body = problem.body
    yield f"scope: {scene.scope}"
    yield f"body: N = {body.N} coordinates, {body.fixed.size} fixed"
    yield f"basis: {problem.basis.note}"
    yield from scene.computed
    yield f"residual: {problem.map.coordinates.k} columns, {problem.options.residual}"
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
    if options.live:
        yield "a tolerance is to stop the solve: bounds of every step are compared, some steps at a time"


def _details(problem: Problem, name: str) -> str:
    if name == "auxiliary":
        modes = problem.split.modes
        cap_note = f"; {modes.cap_note}" if modes.cap_note else ""
        return f": {modes.omega.size} modes up to {modes.omega[-1]:.4g} rad/s, none missed{cap_note}"
    return f": kernel '{problem.options.kernels}'" if name in ("fast", "convolution") else ""


def _estimators_not_made(problem: Problem, names: tuple[str, ...], asked: Any) -> Iterator[tuple[str, str]]:
    why_not = {name: _why_not(name, asked, problem.body) for name in ESTIMATORS if name not in names}
    for why in dict.fromkeys(why_not.values()):
        yield f"estimator {', '.join(repr(name) for name in why_not if why_not[name] == why)}", why
    if "kernel" not in vars(problem):
        yield "kernels of Phi12", "no estimator asked for takes them"
    if "split" in vars(problem):
        if np.isfinite(problem.split.modes.cut):
            yield f"modes above {problem.split.modes.omega[-1]:.4g} rad/s", "bounded together"
    elif "state-space" not in names and not (problem.options.kernels == "spectrum" and "kernel" in vars(problem)):
        yield "modes above the first", "no estimator asked for takes them"


def _why_not(name: str, asked: Any, body: ElasticBody) -> str:
    if asked != "auto":
        return "not asked for"
    if name == "auxiliary" and body.proportional is None:
        return "needs Rayleigh damping, or ratios by mode"
    return "'auto' takes sharper ones"


def _terms_not_there(problem: Problem, scene: Scene) -> Iterator[tuple[str, str]]:
    if scene.pose is None:
        yield "terms of a turning frame", "the body has no frame"
    if not problem.B.shape[1]:
        yield "load columns B", "nothing loads the body"
    if not problem.map.coordinates.has_damping:
        merged = any(problem.body.rayleigh)
        yield "damping columns D V", "Rayleigh damping is merged into M V and K V" if merged else "undamped"
    if not problem.has_initial_error:
        yield "initial error, Phi11", "the full body starts in the span of V (initial=None)"
