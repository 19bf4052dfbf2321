"""RunRecord: what a run has found, frozen; reports and messages are made from it. SolverFacts: what it was told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...linalg.blocked_products import norms_times
from ...report.data import NodeFields
from ...report.scope import SMOOTHLY
from ..residual.samples import GrowingArray

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...model.outputs import Output, View
    from ...report.scope import Doubt
    from ..estimators.bounds import Bounds
    from ..estimators.node_bounds import AtNodes
    from ..estimators.round_off import Rounded
    from ..residual.samples import Samples
    from .prepare import Offline


class Internal(NamedTuple):
    """Outputs of a run beside those that were asked for, corrected (T, r), None: they cannot be.

    frames : (T, 24), motion of the frame, if outputs need it. outputs, views : all of them, and how they are seen.
    """

    corrected: dict[str, np.ndarray | None]
    frames: np.ndarray
    outputs: Sequence[Output]
    views: Sequence[View | None]


class SolverFacts(NamedTuple):
    """What the solver of a run tells about itself.

    end_time : where it was to go, None if not known. newton_tolerance : relative. floor : size of terms of W^T R that
    cancelled before they came here. is_stopped : whether a tolerance of any body in the mbs stopped it.
    name : its own.
    """

    end_time: float | None = None
    newton_tolerance: float = 0.0
    floor: float = 0.0
    is_stopped: bool = False
    name: str = ""

    def ends_early(self, t: float) -> bool | None:
        """Return whether a run that is at t ends before its solver was to; None: not known."""
        return None if self.end_time is None else bool(t < self.end_time * (1 - 1e-9))


UNKNOWN = SolverFacts()
# of omega_1^2 max |V qr|_M: with as large a |V qr''|_M at first a body rings with that amplitude; where a load is
# there at once, and stays, it is 0.5 at least; where one grows over three quarters of the longest period, 0.15
AT_ONCE = 0.25


@dataclass(frozen=True)
class RunRecord:
    """A run up to some instant.

    time : what the bounds cover of time, "reconstructed", "sampled", or "static".
    t (T,), values (T, R), round_off (T, R), frames (T, 24) or (0,) : samples, output rows of the reduced body, what
    rounding of the input may move these by, motion of the frame if outputs need it.
    sizes (T, 2) : |V qr|_M, |V qr''|_M.
    static_errors (T, 2, R) : see linear/residual/interface_stiffening.py; (0,) if modes make no interface rigid.
    streams : stream -> estimator -> bounds; "total" is what counts. assumptions : estimator -> what it assumes.
    nodes : fields at every node, on demand. messages : what was noted along the run. doubts : why no bound is
    certified.
    tolerances : output -> what its bound was asked to stay below, of those that were asked for.
    rounding_share, largest_miss : of the reconstruction, see residual.reconstruction; None if there is none.
    """

    offline: Offline
    solver: SolverFacts
    time: str
    t: np.ndarray
    values: np.ndarray
    round_off: np.ndarray
    frames: np.ndarray
    sizes: np.ndarray
    static_errors: np.ndarray
    streams: dict[str, dict[str, Bounds]]
    assumptions: dict[str, str]
    nodes: Callable[[], NodeFields]
    messages: tuple[str, ...]
    doubts: tuple[Doubt, ...]
    begins_late: bool
    tolerances: dict[str, float]
    rounding_share: float | None
    largest_miss: float | None

    @property
    def planned_end(self) -> float | None:
        """Where the solver was to go to, if the run ends before; None: it does not, or that is not known."""
        return self.solver.end_time if self.solver.ends_early(self.t[-1]) else None

    @property
    def stopped(self) -> float | None:
        """Where a tolerance stopped the solver before its end; None: none did."""
        is_stopped = self.solver.is_stopped and self.solver.ends_early(self.t[-1]) is not False
        return float(self.t[-1]) if is_stopped else None

    @property
    def beside_steps(self) -> tuple[str, ...]:
        """What helps beside shorter steps where the body rings, for something acts on it at once; else nothing."""
        return beside_steps(self.sizes, self.offline.omega_1) if not self.begins_late else ()


def beside_steps(sizes: np.ndarray, omega_1: float) -> tuple[str, ...]:
    """Return what helps beside shorter steps where a body rings, for something acts on it at once; else nothing.

    sizes : (T, 2), of its deformation and of the acceleration of that. omega_1 : its lowest frequency, rad/s.
    """
    displaced, accelerated = np.max(sizes[:, 0]), np.max(sizes[:2, 1])
    return (SMOOTHLY,) if accelerated > AT_ONCE * omega_1**2 * displaced else ()


class RecordedSamples:
    """What is kept of samples along a run: see RunRecord, frames if outputs need them.

    q, which many outputs would fit in, only where one of the `bounds` so far is largest, and of the last samples.
    """

    def __init__(self, offline: Offline, bounds: Callable[[], dict[str, Bounds]]):
        self._offline, self._bounds, self.t = offline, bounds, GrowingArray()
        names = ("values", "round_off", "frames", "sizes", "static_errors")
        self._kept = {"t": self.t, **{name: GrowingArray() for name in names}}
        self._motions: list[tuple[int, np.ndarray]] = []  # number of the first sample, q
        self._worst: dict[str, tuple[float, int]] = {}  # estimator -> its largest bound of |e|_M, and where
        self._looked: dict[str, int] = {}

    def append(self, new: Samples, rounded: Rounded, own: float | np.ndarray) -> None:
        """Keep further samples; rounded: what rounding of the computation may move there; own: see RoundOff."""
        self._drop_motions()
        self._motions.append((len(self.t), new.q))
        offline, root = self._offline, self._offline.mass_root.T
        rounded = offline.input_rounding(new, own) if offline.input_rounding else rounded
        found = {
            "t": new.t,
            "values": offline.outputs_of(new.q, new.q_t),
            "round_off": rounded.outputs,
            "sizes": np.stack([norms_times(x, root) for x in (new.q, new.q_tt)], axis=1),
        }
        if offline.static_errors is not None:
            z = offline.coordinates(new.q, new.q_t, new.q_tt, new.u)
            found["static_errors"] = np.einsum("sk,erk->ser", z, offline.static_errors, optimize=True)
        if any(offline.views):  # outputs in global axes
            found["frames"] = new.frame
        for name, rows in found.items():
            self._kept[name].append(rows)

    def _drop_motions(self) -> None:
        """Forget q of all samples but those where a bound is largest."""
        for name, b in self._bounds().items():
            first = self._looked.get(name, 0)
            if len(b.position) > first:
                i = first + int(np.argmax(b.position[first:]))
                if name not in self._worst or b.position[i] > self._worst[name][0]:
                    self._worst[name] = b.position[i], i
                self._looked[name] = len(b.position)
        places = sorted({i for _, i in self._worst.values()})
        # copies: a view would keep all samples of its block
        self._motions = [(i, q[i - a, None].copy()) for a, q in self._motions for i in places if a <= i < a + len(q)]

    def _motion(self, i: int) -> np.ndarray:
        first, q = next(block for block in reversed(self._motions) if block[0] <= i)
        return q[i - first]

    def fields_of(self, found: dict[str, AtNodes], bounds: dict[str, Bounds]) -> NodeFields:
        """Return what is known at nodes, with the displacements where each estimator's bound of |e|_M is largest."""
        worst = {e: int(np.argmax(bounds[e].position)) for e in found}
        return NodeFields(
            bound={e: x.bound for e, x in found.items()},
            estimate={e: x.estimate for e, x in found.items() if x.estimate is not None},
            displacement={e: self._offline.moved(self._motion(i)) for e, i in worst.items()},
            instant={e: float(self.t.read()[i]) for e, i in worst.items()},
            positions=self._offline.positions,
        )

    def read(self, index: slice) -> dict[str, np.ndarray]:
        """Return these fields of a RunRecord at some samples."""
        return {name: rows.read()[index] for name, rows in self._kept.items()}
