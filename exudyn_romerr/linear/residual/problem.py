"""Problem: the full-size offline quantities of one body, basis, inputs and outputs, each made when first needed.

Estimators take small matrices from here when they are built; nothing of it is needed online.
"""

from __future__ import annotations

import copy
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...basis.basis import Basis
from ...checks import check_array, check_choice, check_type
from ...errors import InputError
from ...model.body import ElasticBody
from ...model.matrix_checks import checked_inputs, precision
from ...model.outputs import Output, StackedRows, stacked_rows
from .dual_norms import DualNorms, OutputNorms
from .kernels import KERNELS, Kernel, make_kernel
from .modal_split import AuxiliaryModes, Split
from .residual import RESIDUALS, ResidualMap

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


class Deferred(NamedTuple):
    """Inputs that are made when they are needed, and not kept: of a large body they take much memory.

    made_of : what tells them apart, beside the body and its basis.
    """

    make: Callable[[], Any]
    made_of: tuple[Any, ...]


class Problem:
    """One reduced body with its inputs, outputs and initial condition, on the free coordinates.

    dual : norms of the residual. rows : norms of the output rows.
    """

    def __init__(
        self,
        body: ElasticBody,
        basis: Basis,
        *,
        inputs: Any = None,
        outputs: Sequence[Output] = (),
        initial: Any = None,
        residual: str = "orthonormal",
        kernels: str = "certified",
        auxiliary_modes: int | str = "auto",
    ):
        check_type("body", body, ElasticBody)
        check_type("basis", basis, Basis)
        check_choice("residual", residual, RESIDUALS)
        check_choice("kernels", kernels, KERNELS)
        self.body = body
        self.residual, self.kernels, self.initial, self.auxiliary_modes = residual, kernels, initial, auxiliary_modes
        self.V, self.W = basis.restricted_to(body)
        inputs = inputs.make() if isinstance(inputs, Deferred) else inputs
        self.precision = precision(inputs)
        self.B = body.space.loads(checked_inputs(inputs, body.N))
        self.map = ResidualMap(body, self.V, self.B, merged=residual != "expanded")
        C, velocity_rows, _ = self._name(basis, outputs)
        self.initial_state = _checked_initial(initial, body)
        self.dual = DualNorms(self.map, self.initial_state, residual, self.has_initial_error)
        self.rows = OutputNorms(body, C, velocity_rows, self.dual)

    def _name(self, basis: Basis, outputs: Sequence[Output]) -> StackedRows:
        rows = stacked_rows(checked_outputs(outputs), self.body)
        self.basis, self.outputs, self.slices = basis, tuple(outputs), rows.slices
        self.views = tuple(out.view(self.body) for out in outputs)
        self.rows_precision = np.repeat([precision(out.rows) for out in outputs], [x.stop - x.start for x in rows[2]])
        return rows

    def renamed(self, basis: Basis, outputs: Sequence[Output]) -> Problem:
        """Return the same problem with a basis and outputs of the same numbers, which may have other names."""
        other = copy.copy(self)
        other._name(basis, outputs)
        return other

    @property
    def has_initial_error(self) -> bool:
        """False if the initial error is zero by assumption (initial=None)."""
        return self.initial is not None

    @cached_property
    def kernel(self) -> Kernel:
        """Kernel of the whole body."""
        return make_kernel(self.body, self.kernels)

    @cached_property
    def split(self) -> Split:
        """Auxiliary modes and what is left above them."""
        requested = np.zeros(len(self.rows.C), dtype=bool)
        for out, part in zip(self.outputs, self.slices, strict=True):
            requested[part] = out.is_requested
        modes = AuxiliaryModes(self.body, self.V, self.W, self.auxiliary_modes, self.rows, requested)
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
