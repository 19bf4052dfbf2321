"""BoundOptions: what was asked for; prepare: all that is done once before a run, ending in small constants only."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ...checks import check_array, check_choice
from ...errors import AssumptionError, InputError
from ...model.matrix_checks import DOUBLE
from ...model.outputs import View, stacked_rows
from ...model.shared_body import made_once
from ...report.scope import COMPLETE, Scene
from ..estimators import ESTIMATORS
from ..estimators.energy import StaticError
from ..estimators.node_bounds import node_bounds, node_displacements
from ..estimators.round_off import RoundOff, of_input
from ..estimators.turning_frame import Turning
from ..residual.input_signal import InputSignal
from ..residual.interface_stiffening import static_errors
from ..residual.problem import Deferred, Problem, checked_outputs
from .offline import Offline
from .planning import make_plan

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...basis.basis import Basis
    from ...model.body import ElasticBody
    from ...model.outputs import Output

UNMOVED = 1e-9  # of the entries of an output: what rounding leaves of rows that reference conditions hold at zero
OF_PROBLEM = ("inputs", "outputs", "initial", "residual", "kernels", "auxiliary_modes")
IN_A_TURNING_FRAME = ("fast", "convolution", "energy", "auxiliary")  # what Turning can add the turning to

ALONE = Scene()  # of a body without a frame
TIMES = ("reconstructed", "sampled")


@dataclass(frozen=True, eq=False)
class BoundOptions:
    """Arguments of evaluate and attach, whose docstrings describe them; checked where they are used.

    outputs : None until sensors tell them, of a floating body. inputs, input_function : of a floating body those that
    its scene makes.
    """

    inputs: Any = None
    input_function: Callable | None = None
    outputs: Sequence[Output] | None = ()
    initial: Any = None
    jumps: Sequence[float] = ()
    estimators: Any = "auto"
    residual: str = "orthonormal"
    kernels: str = "certified"
    time: str = "reconstructed"
    auxiliary_modes: int | str = "auto"
    tolerance: Any = None

    @property
    def live(self) -> bool:
        """Whether bounds are compared with tolerances, which the plan says."""
        return self.tolerance is not None

    @classmethod
    def of(cls, given: dict[str, Any]) -> BoundOptions:
        """Return those that are among the arguments of a function, its locals()."""
        return cls(**{field.name: given[field.name] for field in fields(cls) if field.name in given})


def prepare(
    body: ElasticBody,
    basis: Basis,
    options: BoundOptions,
    *,
    sampled_inputs: bool = False,
    samples_precision: float = DOUBLE,
    scene: Scene = ALONE,
) -> Offline:
    """Do the offline work of evaluate and attach.

    sampled_inputs: the inputs come as samples with the trajectory, input_function may be missing. samples_precision:
    relative spacing of the trajectory's numbers.

    Raises
    ------
    InputError, AssumptionError
    """
    check_choice("time", options.time, TIMES)
    time, initial = options.time, options.initial
    names = _checked_estimators(options.estimators, body)
    with_modes = "auxiliary" in names
    problem = _made_problem(body, basis, options)
    _check_frame(problem, names, options.jumps, scene)
    if with_modes:
        _ = problem.split  # first, for it takes most modes: none made twice
    signal = _made_signal(options.input_function, problem.B.shape[1], sampled_inputs)
    V, W, B = problem.V, problem.W, problem.B
    eps, single = of_input(problem, samples_precision)
    views, blind = _without_sight(problem, scene)
    estimators = {name: _made(name, problem, scene) for name in names}
    return Offline(
        coordinates=problem.map.coordinates,
        signal=signal,
        estimators=estimators,
        outputs=problem.outputs,
        slices=tuple(problem.slices),
        velocity_rows=problem.rows.velocity_rows,
        value_rows=problem.rows.C @ V,
        balance_rows=problem.map.seen_by(W.T),
        jump_response=np.linalg.solve(W.T @ (body.M @ V), W.T @ B),
        mass_root=np.linalg.qr(body.mass_factor.half_multiply(V), mode="r"),
        static_errors=None if scene.stiff is None else static_errors(problem, scene.stiff),
        rounding=RoundOff(problem, dict.fromkeys(eps, DOUBLE) | {"outputs": np.full(len(problem.rows.C), DOUBLE)}),
        input_rounding=RoundOff(problem, eps) if single else None,
        single=tuple(single),
        samples_precision=samples_precision,
        measure=lambda z: _sharpest_norm(problem, names, with_modes)(z),
        omega_1=float(body.modes(1).omega[0]),
        jumps=_checked_jumps(options.jumps, signal),
        initial=None if initial is None else "equilibrium" if isinstance(initial, str) else "state",
        time=time,
        total_mass=body.total_mass,
        modes=problem.split.modes.omega.size if with_modes else 0,
        plan=make_plan(problem, names, time, options.estimators, scene, options.live),
        views=tuple(views),
        scene=scene,
        from_static=cache(
            lambda: prepare(
                body, basis, replace(options, initial="equilibrium"), sampled_inputs=sampled_inputs, scene=scene
            )
        ),
        notes=tuple(filter(None, [scene.note, problem.split.modes.left_ringing if with_modes else None, blind])),
        nodes=lambda worst: node_bounds(problem, lambda name, p: _made(name, p, scene), worst),
        moved=lambda q: node_displacements(problem, q),
        positions=body.positions,
        static=lambda: StaticError(problem),
    )


def _checked_estimators(estimators: Any, body: ElasticBody) -> tuple[str, ...]:
    """Names of the estimators; "auto": the sharp one if damping allows it, else two that neither is always best."""
    if isinstance(estimators, str) and estimators == "auto":
        return ("energy", "auxiliary") if body.proportional is not None else ("fast", "energy")
    return checked_names(estimators)


def checked_names(estimators: Any) -> tuple[str, ...]:
    """Return the names of estimators that were asked for one by one; InputError if one is unknown."""
    names = (estimators,) if isinstance(estimators, str) else estimators
    if not isinstance(names, tuple | list | set) or not names:
        raise InputError(f"estimators={estimators!r}; allowed: 'auto' or some of {tuple(ESTIMATORS)}")
    for name in names:
        check_choice("estimators", name, ESTIMATORS)
    return tuple(dict.fromkeys(names))


def _made_signal(f: Callable | InputSignal | None, p: int, sampled: bool) -> InputSignal | None:
    if isinstance(f, InputSignal):
        return f
    if f is not None and not p:
        raise InputError("input_function was given without inputs=B, the matrix it multiplies; pass both or neither")
    return None if sampled and f is None else InputSignal(f, p)


def _made_problem(body, basis, options: BoundOptions) -> Problem:
    """Kept where its inputs are made of the body alone, and nothing but R has to be measured."""
    given = {name: getattr(options, name) for name in OF_PROBLEM}
    if not isinstance(options.inputs, Deferred) or options.initial is not None:
        return Problem(body, basis, **given)
    rows, asked = stacked_rows(checked_outputs(options.outputs), body), [out.is_requested for out in options.outputs]
    kinds = options.residual, options.kernels, options.auxiliary_modes
    kept = made_once(
        body,
        "residual",
        (basis.V, basis.W, *options.inputs.made_of, rows.C, rows.velocity, rows.slices, asked, kinds),
        # without outputs, which may know the fem
        lambda: Problem(body, basis, **given).renamed(basis, ()),
    )
    return kept.renamed(basis, options.outputs)


def _made(name: str, problem: Problem, scene: Scene) -> Any:
    if name == "static":
        return StaticError(problem)
    estimator = ESTIMATORS[name](problem)
    return Turning(estimator, problem) if scene.turns else estimator


def _check_frame(problem: Problem, names: tuple[str, ...], jumps: Sequence[float], scene: Scene) -> None:
    for out in problem.outputs:
        if scene.pose is None and out.frame == "global":
            raise InputError(f"output {out.name!r} is in global axes; this body has no frame, leave frame='body'")
    if not scene.turns:
        return
    for name in names:
        if name not in IN_A_TURNING_FRAME:
            raise AssumptionError(f"estimator {name!r} needs a frame at rest; allowed here: {IN_A_TURNING_FRAME}")
    if len(jumps):
        raise AssumptionError("jumps= need a frame at rest; let the load grow over a few steps instead")


def _sharpest_norm(problem: Problem, names: tuple[str, ...], with_modes: bool) -> Callable:
    """The norm of R that the sharpest estimator accumulates."""
    if with_modes:
        return problem.split.norm_K
    return problem.dual.norm_K if "energy" in names else problem.dual.norm_M


def _without_sight(problem: Problem, scene: Scene) -> tuple[list[View | None], str | None]:
    """Return the views, blind where no motion of the body in its frame moves an output, and a note about these.

    What such an output, on the interface that holds the frame, shows in global axes is the motion of the frame: exact
    where the scope is complete, else unknown.
    """
    views, names = list(problem.views), []
    for i, (out, part) in enumerate(zip(problem.outputs, problem.slices, strict=True)):
        if views[i] is None or scene.scope == COMPLETE:
            continue
        if np.max(np.abs(problem.rows.C[part])) <= UNMOVED * np.max(np.abs(out.resolve(problem.body))):
            views[i] = replace(views[i], blind=True)
            names += [repr(out.name)] if out.is_requested else []
    if not names:
        return views, None
    return views, (
        f"nothing is known of the error of {', '.join(names)}: the reference conditions hold the body there, so that "
        "the output shows the motion of the frame alone, which is taken as it is in this run (bound inf). Take an "
        "output in the body's frame, or one elsewhere on the body"
    )


def _checked_jumps(jumps: Sequence[float], signal: InputSignal | None) -> tuple[float, ...]:
    times = check_array("jumps", jumps, (None,))
    if times.size and (signal is None or not signal.p):
        raise InputError("jumps need input_function, which gives the input on both sides; pass it beside inputs")
    return tuple(sorted(times.tolist()))
