"""Plan: what is computed for a scene, and what is left out and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .estimators import ESTIMATORS

if TYPE_CHECKING:
    from .body import ElasticBody
    from .problem import Problem
    from .scope import Scene


IN_A_MECHANISM = "a mechanism's joints and other bodies have one that no residual of this body shows"


@dataclass(frozen=True)
class Plan:
    """Readable with print().

    computed : lines; left_out : (what, why) pairs.
    """

    computed: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        lines = ["computed:", *(f"  {line}" for line in self.computed)]
        if self.left_out:
            lines += ["left out:", *(f"  {what}: {why}" for what, why in self.left_out)]
        return "\n".join(lines)


def make_plan(problem: Problem, names: tuple[str, ...], time: str, asked: Any, scene: Scene) -> Plan:
    """Return the plan of estimators `names`, chosen by what was `asked` for."""
    layout, body = problem.terms.coordinates, problem.body
    packed = f", packed into {problem.map.coordinates.k}" if problem.packing else ""
    made = [name for name in names if not (scene.feedback and name == "auxiliary")]  # a line of scene.computed
    computed = [
        f"body with N = {body.N} coordinates ({body.fixed.size} fixed), basis: {problem.basis.note}",
        *scene.computed,
        f"residual of {layout.k} columns{packed}, {problem.residual}",
        *(f"estimator '{name}'{_details(problem, name)}" for name in made),
        *(f"output '{out.name}' ({out.unit}, {out.of})" for out in problem.outputs if out.decides),
    ]
    left_out = [(f"estimator '{name}'", _why_not(name, asked, body)) for name in ESTIMATORS if name not in names]
    left_out += scene.left_out
    if problem.may_start_off:
        where = "its own static equilibrium" if problem.initial_state is None else "the state given as initial="
        computed.append(f"initial error: the full body starts in {where}")
    else:
        left_out.append(("initial error", "initial=None: the full body starts in the span of V"))
    if not layout.has_damping:
        why = "undamped" if body.D is None else "Rayleigh damping is merged into the M V and K V columns"
        left_out.append(("damping columns D V", why))
    if time == "sampled":
        left_out.append(("error of the time integration", IN_A_MECHANISM if scene.coupled else "time='sampled'"))
    else:
        computed.append("error of the time integration: quintic reconstruction between steps")
    return Plan(tuple(computed), tuple(left_out))


def _why_not(name: str, asked: Any, body: ElasticBody) -> str:
    if asked != "auto":
        return "not asked for"
    if name == "auxiliary" and body.rayleigh is None:
        return "needs Rayleigh damping"
    return "'auto' takes sharper ones"


def _details(problem: Problem, name: str) -> str:
    if name == "auxiliary":
        split = problem.split
        capped = f"; {split.capped}" if split.capped else ""
        return f": {split.omega.size} modes up to {split.omega[-1]:.4g} rad/s, none missed{capped}"
    return f": kernel '{problem.kernels}'" if name in ("fast", "convolution") else ""
