"""Problem: the full-size offline quantities of one body, basis, inputs and outputs, each made when first needed.

Estimators take small matrices from here when they are built; nothing of it is needed online.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError, check_array, check_choice
from .kernels import KERNELS, Kernel, make_kernel
from .outputs import Output, stacked_rows
from .residual import RESIDUALS, ResidualMap, make_norm

if TYPE_CHECKING:
    from .basis import Basis
    from .body import ElasticBody


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
    ):
        check_choice("residual", residual, RESIDUALS)
        check_choice("kernels", kernels, KERNELS)
        self.body, self.basis = body, basis
        self.residual, self.kernels, self.initial = residual, kernels, initial
        self.V, self.W = basis.restricted_to(body)
        self.B = checked_inputs(body, inputs)
        self.map = ResidualMap(body, self.V, self.B, merged=residual != "expanded")
        self.C, self.velocity_rows, self.slices = stacked_rows(outputs, body)
        self.outputs = tuple(outputs)
        self.initial_state = _checked_initial(initial, body)

    @property
    def may_start_off(self) -> bool:
        """False if the initial error is zero by assumption (initial=None)."""
        return self.initial is not None

    @cached_property
    def kernel(self) -> Kernel:
        """Kernel of the whole body."""
        return make_kernel(self.body, self.kernels)

    @cached_property
    def X_M(self) -> np.ndarray:
        """M^-1 [L, K q0, M q0']."""
        extra = () if self.initial_state is None else (self.body.K @ self.initial_state[0],)
        solved = [self.body.mass_factor.solve(column)[:, None] for column in extra]
        last = [] if self.initial_state is None else [self.initial_state[1][:, None]]
        return np.hstack([self.map.mass_inverse_columns(), *solved, *last])

    @cached_property
    def X_K(self) -> np.ndarray:
        """K^-1 [L, K q0, M q0']."""
        columns = self.map.stiffness_inverse_columns()
        if self.initial_state is None:
            return columns
        q0, q0_t = self.initial_state
        return np.column_stack([columns, q0, self.body.stiffness_factor.solve(self.body.M @ q0_t)])

    @cached_property
    def norm_M(self):
        """Callable z -> |R|_{M^-1} = |M^-1 L z|_M."""
        return make_norm(self.residual, self.X_M, self.body.M)

    @cached_property
    def norm_K(self):
        """Callable z -> |R|_{K^-1} = |K^-1 L z|_K."""
        return make_norm(self.residual, self.X_K, self.body.K)

    @cached_property
    def norm_static(self):
        """Callable z -> |K^-1 R|_M, the mass norm of the static reconstruction."""
        return make_norm(self.residual, self.X_K, self.body.M)

    @cached_property
    def C2(self) -> np.ndarray:
        """|c_i|_{M^-1} of every output row (R,), paper (29)."""
        return np.sqrt(np.einsum("ij,ji->i", self.C, self.body.mass_factor.solve(self.C.T)))

    @cached_property
    def static_rows(self) -> np.ndarray:
        """C K^-1 L (R, k): outputs of the static reconstruction K^-1 R."""
        return self.C @ self.X_K[:, : self.map.coordinates.k]


def checked_inputs(body: ElasticBody, inputs: Any) -> np.ndarray:
    """Return B on the free coordinates, (n_free, 0) for None."""
    if inputs is None:
        return np.zeros((body.free.size, 0))
    return check_array("inputs", inputs, (body.N, None))[body.free]


def _checked_initial(initial: Any, body: ElasticBody) -> tuple[np.ndarray, np.ndarray] | None:
    if initial is None or (isinstance(initial, str) and initial == "equilibrium"):
        return None
    if isinstance(initial, str) or len(initial) != 2:
        raise InputError(f"initial={initial!r}; allowed: None, 'equilibrium' or (q0, q0_t), two arrays of N entries")
    state = tuple(check_array(f"initial[{i}]", part, (body.N,)) for i, part in enumerate(initial))
    moved = max(np.max(np.abs(part[body.fixed]), initial=0.0) for part in state)
    if moved > 0:
        raise InputError(f"initial moves fixed coordinates (largest entry there {moved:.3g}); they must be 0")
    return tuple(part[body.free] for part in state)
