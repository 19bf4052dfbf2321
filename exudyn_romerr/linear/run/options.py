"""BoundOptions: what evaluate, attach and evaluate_file were asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...model.outputs import Output

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
