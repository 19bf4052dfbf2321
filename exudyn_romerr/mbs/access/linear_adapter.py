"""LinearSubject: adapts a body made by add_reduced_body to a monitor."""

from __future__ import annotations

import weakref
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ...linear.run.prepare import prepare
from ...linear.trajectory.input_signal import InputSignal
from ..memory.detached import Detached
from .mbs_items import require_inputs_only

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np

    from ...linear.run.offline import Offline
    from ...linear.run.prepare import BoundOptions
    from ...model.outputs import Output
    from .reduced_body import ReducedBody


class KeptSignal(InputSignal):
    """An input function that a run goes on with: copies of it are called, which keep what they keep."""

    def __init__(self, flex: ReducedBody):
        super().__init__(flex.input_function, flex.model.G.shape[1])
        self._mbs, self._given = weakref.ref(flex.mbs), flex.input_function

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Let a copy be called."""
        detached = Detached(self._mbs(), [self._given])
        with detached.in_use(*filter(None, [self._mbs()])):
            self._f = detached.of(self._given)
            try:
                yield
            finally:
                self._f = self._given


class LinearSubject:
    """Its offline work is done when it is attached; the mbs is read for what it must not contain.

    body : the full body.
    """

    def __init__(self, flex: ReducedBody, options: BoundOptions):
        self._node, self.item = (int(flex.items[key]) for key in ("nGenericODE2", "oGenericODE2"))
        self._model, self.body, self._basis = flex.model, flex.body, flex.basis  # not flex, which holds the mbs
        self._signal = None if flex.input_function is None else KeptSignal(flex)
        self._options = replace(options, inputs=flex.inputs, input_function=self._signal)
        self._offline = prepare(self.body, self._basis, self._options)
        self.columns, self.floor = slice(0, 0), 0.0

    @property
    def outputs(self) -> tuple[Output, ...]:
        """What is bounded."""
        return self._offline.outputs

    def modes(self, mbs: Any) -> tuple[np.ndarray, Any]:
        """Return V (N, n) and the full K (N, N)."""
        return self._basis.V, self.body.stiffness

    def add(self, outputs: Sequence[Output]) -> None:
        """Bound further outputs."""
        self._options = replace(self._options, outputs=[*self._options.outputs, *outputs])
        self._offline = prepare(self.body, self._basis, self._options)

    def is_told(self, mbs: Any, static: bool, why_not: str) -> bool:
        """Whether a mechanism tells of it: nothing reacts to a linear body."""
        return False

    def at_every_step(self) -> None:
        """Let bounds be known while a solve goes on: they are."""

    def read(self, mbs: Any, static: bool = False, why_not: str = "") -> Offline:
        """Find the body's coordinates in the mbs; AssumptionError if something else acts on it."""
        require_inputs_only(mbs, self._node, self.item)
        first = mbs.GetNodeODE2Index(self._node)
        self.columns = slice(first, first + len(self._model.M))
        return self._offline

    def first(self, t: float, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray, **_: bool) -> tuple:
        """Return q, q_t, q_tt of a run's first sample, each (n,)."""
        # explicit solvers leave the initial accelerations unset until their first step is done
        model = self._model if self._signal is None else replace(self._model, input_function=self._signal.at)
        return q, q_t, model.acceleration(t, q, q_t)

    def sampled(self, t: np.ndarray, *states: np.ndarray) -> tuple:
        """Return q, q_t, q_tt of accepted steps, each (S, n)."""
        return states
