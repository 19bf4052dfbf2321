"""Problem: the full-size offline quantities of one body, basis, inputs and outputs, each made when first needed.

Estimators take small matrices from here when they are built; nothing of it is needed online.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..basis.basis import Basis
from ..errors import InputError, check_array, check_choice, check_type
from ..model.body import ElasticBody
from ..model.matrix_input import checked_inputs, precision
from ..model.outputs import Output, stacked_rows
from .kernels import KERNELS, Kernel, make_kernel
from .modal_split import Split
from .residual import RESIDUALS, ResidualMap, StartNorms, make_norm

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence


class Problem:
    """One reduced body with its inputs, outputs and initial condition, on the free coordinates.

    Columns of L are followed by extra columns K q0 and M q0' if an initial state is given, so that the initial error
    is a combination y of columns as well: K e0 = L y0, M e0' = L y0'.
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
        self.body, self.basis = body, basis
        self.residual, self.kernels, self.initial, self.auxiliary_modes = residual, kernels, initial, auxiliary_modes
        self.V, self.W = basis.restricted_to(body)
        self.precision = precision(inputs)
        self.B = body.space.loads(checked_inputs(inputs, body.N))
        self.map = self.terms = ResidualMap(body, self.V, self.B, merged=residual != "expanded")
        self.C, self.velocity_rows, self.slices = stacked_rows(checked_outputs(outputs), body)
        self.outputs = tuple(outputs)
        self.views = tuple(out.view(body) for out in outputs)
        self.rows_precision = np.repeat(
            [precision(out.rows) for out in outputs], [x.stop - x.start for x in self.slices]
        )
        self.initial_state = _checked_initial(initial, body)

    packing = None  # see packing.py

    @property
    def may_start_off(self) -> bool:
        """False if the initial error is zero by assumption (initial=None)."""
        return self.initial is not None

    @cached_property
    def decides(self) -> np.ndarray:
        """Rows (R,) of outputs that decide how many auxiliary modes "auto" takes."""
        rows = np.zeros(len(self.C), dtype=bool)
        for out, part in zip(self.outputs, self.slices, strict=True):
            rows[part] = out.decides
        return rows

    @cached_property
    def kernel(self) -> Kernel:
        """Kernel of the whole body."""
        return make_kernel(self.body, self.kernels)

    @cached_property
    def Y_M(self) -> np.ndarray:
        """[L, K q0, M q0'] where |.|_{M^-1} is the 2-norm; M V as it is, so that no digits are lost in it."""
        factor = self.body.mass_factor
        q0, q0_t = self.initial_state or (None, None)
        rest = [*self.map.blocks[1:], *([] if q0 is None else [self.body.K @ q0[:, None]])]
        last = [] if q0_t is None else [factor.half_multiply(q0_t[:, None])]
        return np.hstack([factor.half_multiply(self.V), *map(factor.half_solve, filter(np.size, rest)), *last])

    @cached_property
    def Y_K(self) -> np.ndarray:
        """[L, K q0, M q0'] where |.|_{K^-1} is the 2-norm; K V as it is, so that no digits are lost in it."""
        factor = self.body.stiffness_factor
        before = [factor.half_solve(block) for block in self.map.blocks[:-2]]
        after = [factor.half_solve(-self.B)] if self.B.size else []
        if self.initial_state is not None:
            q0, q0_t = self.initial_state
            after += [factor.half_multiply(q0[:, None]), factor.half_solve(self.body.M @ q0_t[:, None])]
        return np.hstack([*before, factor.half_multiply(self.V), *after])

    @cached_property
    def Y_static(self) -> np.ndarray:
        """K^-1 [L, K q0, M q0'] where |.|_M is the 2-norm."""
        solve = self.body.stiffness_factor.solve
        columns = [*map(solve, self.map.blocks[:-2]), self.V, *([solve(-self.B)] if self.B.size else [])]
        if self.initial_state is not None:
            q0, q0_t = self.initial_state
            columns += [q0[:, None], solve(self.body.M @ q0_t[:, None])]
        return self.body.mass_factor.half_multiply(np.hstack(columns))

    @cached_property
    def norm_M(self) -> Callable:
        """Return z -> |R|_{M^-1}."""
        return make_norm(self.residual, self.Y_M)

    @cached_property
    def norm_K(self) -> Callable:
        """Return z -> |R|_{K^-1}."""
        return make_norm(self.residual, self.Y_K)

    @cached_property
    def norm_static(self) -> Callable:
        """Return z -> |K^-1 R|_M, the mass norm of the static reconstruction."""
        return make_norm(self.residual, self.Y_static)

    @cached_property
    def start_norms(self) -> StartNorms | None:
        """Norms of an initial error; None if there is none."""
        return StartNorms(self.norm_K, self.norm_static, self.norm_M) if self.may_start_off else None

    @cached_property
    def Y_C_M(self) -> np.ndarray:
        """C^T where |.|_{M^-1} is the 2-norm, (n_free, R)."""
        return self.body.mass_factor.half_solve(self.C.T)

    @cached_property
    def Y_C_K(self) -> np.ndarray:
        """C^T where |.|_{K^-1} is the 2-norm, (n_free, R)."""
        return self.body.stiffness_factor.half_solve(self.C.T)

    @cached_property
    def C2(self) -> np.ndarray:
        """|c_i|_{M^-1} of every output row (R,), paper (29)."""
        return np.linalg.norm(self.Y_C_M, axis=0)

    @cached_property
    def C_K(self) -> np.ndarray:
        """|c_i|_{K^-1} of every output row (R,)."""
        return np.linalg.norm(self.Y_C_K, axis=0)

    @cached_property
    def static_rows(self) -> np.ndarray:
        """C K^-1 L (R, k): outputs of the static reconstruction K^-1 R, which has no velocity."""
        return self.of_displacements(self.Y_C_K.T @ self.Y_K[:, : self.map.coordinates.k])

    def of_displacements(self, rows: np.ndarray) -> np.ndarray:
        """Return rows (R, k) with those of velocity outputs zero."""
        return np.where(self.velocity_rows[:, None], 0.0, rows)

    @cached_property
    def split(self) -> Split:
        """Auxiliary modes and what is left above them."""
        return Split(self, self.auxiliary_modes)


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
