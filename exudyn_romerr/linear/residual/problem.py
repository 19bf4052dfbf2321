"""BoundOptions: what was asked for; Problem: full-size quantities of one body and basis, each made when first needed.

Estimators take small matrices from a Problem when they are built; nothing of it is needed online.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...basis.basis import Basis
from ...checks import check_array, check_choice, check_type
from ...errors import InputError
from ...model.body import ElasticBody
from ...model.matrix_checks import checked_inputs, precision
from ...model.outputs import Output, stacked_rows
from .kernels import KERNELS, Kernel, make_kernel
from .modal_split import AuxiliaryModes, Split
from .residual import RESIDUALS, DualNorms, OutputNorms, ResidualMap


class Deferred(NamedTuple):
    """Inputs that are made when they are needed, and not kept: of a large body they take much memory."""

    make: Callable[[], Any]


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

    @classmethod
    def of(cls, given: dict[str, Any]) -> BoundOptions:
        """Return those that are among the arguments of a function, its locals()."""
        return cls(**{field.name: given[field.name] for field in fields(cls) if field.name in given})


class Problem:
    """One reduced body with its inputs, outputs and initial condition, on the free coordinates.

    dual : norms of the residual. rows : norms of the output rows.
    """

    def __init__(self, body: ElasticBody, basis: Basis, options: BoundOptions):
        check_type("body", body, ElasticBody)
        check_type("basis", basis, Basis)
        check_choice("residual", options.residual, RESIDUALS)
        check_choice("kernels", options.kernels, KERNELS)
        self.body, self.basis, self.options = body, basis, replace(options, inputs=None)
        self.V, self.W = basis.restricted_to(body)
        inputs = options.inputs.make() if isinstance(options.inputs, Deferred) else options.inputs
        self.precision = precision(inputs)
        self.B = body.space.loads(checked_inputs(inputs, body.N))
        self.map = ResidualMap(body, self.V, self.B, merged=options.residual != "expanded")
        self.outputs = tuple(checked_outputs(options.outputs))
        C, velocity_rows, self.slices = stacked_rows(self.outputs, body)
        self.views = tuple(out.view(body) for out in self.outputs)
        sizes = [part.stop - part.start for part in self.slices]
        self.rows_precision = np.repeat([precision(out.rows) for out in self.outputs], sizes)
        self.initial_state = _checked_initial(options.initial, body)
        self.dual = DualNorms(self.map, self.initial_state, options.residual, self.has_initial_error)
        self.rows = OutputNorms(body, C, velocity_rows, self.dual)

    @property
    def has_initial_error(self) -> bool:
        """False if the initial error is zero by assumption (initial=None)."""
        return self.options.initial is not None

    @cached_property
    def kernel(self) -> Kernel:
        """Kernel of the whole body."""
        return make_kernel(self.body, self.options.kernels)

    @cached_property
    def split(self) -> Split:
        """Auxiliary modes and what is left above them."""
        requested = np.zeros(len(self.rows.C), dtype=bool)
        for out, part in zip(self.outputs, self.slices, strict=True):
            requested[part] = out.is_requested
        modes = AuxiliaryModes(self.body, self.V, self.W, self.options.auxiliary_modes, self.rows, requested)
        return Split(modes, self.dual)

    def with_displacements(self, C: np.ndarray) -> Problem:
        """Return the same problem, with the same auxiliary modes, and displacements C (R, n_free) as outputs."""
        other = copy.copy(self)
        other.rows = OutputNorms(self.body, C, np.zeros(len(C), dtype=bool), self.dual)
        return other


def checked_outputs(outputs: Any) -> Sequence[Output]:
    """Return outputs; InputError unless they are a list of Output, each with a name of its own."""
    if not isinstance(outputs, list | tuple):
        raise InputError(
            f"outputs is a {type(outputs).__name__}; needed: a list of Output (floating bodies: or sensor numbers)"
        )
    for out in outputs:
        check_type("an entry of outputs", out, Output)
    names = [out.name for out in outputs]
    double = {name for name in names if names.count(name) > 1}
    if double:
        raise InputError(f"outputs: the name {sorted(double)[0]!r} is used more than once")
    return outputs


def _checked_initial(initial: Any, body: ElasticBody) -> tuple[np.ndarray, np.ndarray] | None:
    if initial is None or (isinstance(initial, str) and initial == "equilibrium"):
        return None
    if not isinstance(initial, tuple | list | np.ndarray) or len(initial) != 2:
        found = repr(initial) if np.isscalar(initial) else f"of type {type(initial).__name__}"
        raise InputError(f"initial is {found}; allowed: None, 'equilibrium' or (q0, q0_t), two arrays of N entries")
    parts = ((f"initial[{i}]", check_array(f"initial[{i}]", part, (body.N,))) for i, part in enumerate(initial))
    return tuple(body.space.coordinates(name, part) for name, part in parts)
