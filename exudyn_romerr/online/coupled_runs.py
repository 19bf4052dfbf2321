"""Runs of the bodies of one mechanism, whose bounds share one energy (theory.md 7, "coupled")."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..estimates.overshoot import CarriedTurn, Overshoot, overshoots
from ..estimators.coupled_energy import MechanismEnergy, joint_growth
from ..model.floating_frame import FrameRows
from ..residual.felt_residuals import FeltResiduals
from .run_messages import (
    BEGUN_ANEW,
    REPEATED,
    ROUGH_RADIUS,
    STARTS_DAMPED,
    STARTS_HELD_BACK,
    STARTS_ROUGHLY,
    UNKNOWN_SCHEME,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..estimates.march import Scheme
    from ..report.scope import Doubt
    from ..residual.free_mass import AtStart
    from ..trajectory.samples import Extension
    from ..trajectory.segments import Block
    from .run import Opening, Run

# from one step to the next: Exudyn's adaptive steps grow by 2 at most unless they are told else
GREW = 2.0 * (1 + 1e-6)
SAME_STEP = 1e-6  # of a step: solvers add up their steps
NEGLIGIBLE = 1e-3  # of the energy's root, what the integrator makes of the start
ROUNDING = 1e-8  # of the terms of R(0): so much may a static solve leave
# of the first step: what a residual of mass 1 makes velocities of slow modes by way of Rayleigh's alpha. Damping of
# motion relative to a frame joins modes; with 6e-4 an error was 1.3 times its bound, with 3e-3 3.4 times
CARRIED = 1e-4
TOO_FAST = (
    "no bound from t = {:g} s on (inf): the step grew by a factor of {:.3g} at once, and what an integrator with a "
    "spectral radius below 1 makes of that is not known; set adaptiveStepIncrease to 2 at most"
)


def shared_energy(run: Run, stream: str) -> MechanismEnergy:
    """Return the estimator of a stream that bounds the energy of the mechanism."""
    return next(e for e in run.estimators(stream).values() if isinstance(e, MechanismEnergy))


def joined_openings(runs: Sequence[Run], openings: Sequence[Opening]) -> list[Opening]:
    """Return the openings with the energy that all bodies start with together."""
    # they go on from runs before, with one energy already; or there are none
    if not openings or any(opening.start is None for opening in openings):
        return list(openings)
    pairs = [(shared_energy(run, "reduction"), o.start) for run, o in zip(runs, openings, strict=True)]
    joint = tuple(np.linalg.norm([energy.energies_at(start) for energy, start in pairs], axis=0).tolist())
    return [o._replace(start=replace(o.start, joint=joint)) for o in openings]


class FirstSteps:
    """What the integrator may add to |e|_M and |e'|_M of the bodies of a mechanism (estimates/overshoot.py).

    scheme : of the solver; None: unknown. share : of a residual at a step's begin in what the step feels of it, None:
    not known. damped : whether there are dampers beside those of the bodies. These may have any ratio in a mode, and
    they join modes: what they carry on into slow ones is in no march of single modes, so it is not certified. step :
    that the solver tries first, None: unknown.
    """

    def __init__(
        self, scheme: Scheme | None, share: float | None = None, damped: bool = False, step: float | None = None
    ):
        self._scheme, self._push, self._share, self.damped, self.step = scheme, 0.0, share, damped, step
        self._doubts: list[Doubt] = []
        self._felt: dict[str, FeltResiduals] = {}
        self._times, self._is_lost, self._varies = np.zeros(0), False, False  # the last two
        self._starts: list[tuple[AtStart, Opening]] = []  # until the first step
        self._overshoot: Overshoot | None = None
        self._carried: CarriedTurn | None = None
        self._positions = np.zeros(0)

    def open(self, runs: Sequence[Run], openings: Sequence[Opening]) -> str:
        """Begin; return what is not known, if anything."""
        if any(opening.start is None for opening in openings):
            self._share = None
        self._times = openings[0].first.t
        if self._scheme is None:
            return UNKNOWN_SCHEME
        if any(opening.start is None for opening in openings):
            return BEGUN_ANEW if overshoots(self._scheme) else ""
        starts = [shared_energy(run, "reduction").at_start for run in runs]
        starts = list(zip(starts, openings, strict=True))
        if push := float(np.linalg.norm([_push(*start) for start in starts])):
            self._carried = CarriedTurn(self._scheme, push * max(at.turning for at, _ in starts))
        if overshoots(self._scheme):
            self._starts, self._push = starts, push
        return ""

    def carried(self, h: np.ndarray, turned: np.ndarray) -> np.ndarray:
        """Return what accelerations at the start make of the energy's root (S,) where the mechanism turns."""
        return np.zeros(len(h)) if self._carried is None else self._carried.advance(h, turned)

    def _begin(self, h: float) -> None:
        """Begin with a first step h; what is not certified is in the bound as far as damping may join modes."""
        dampings = [at.damping for at, _ in self._starts]
        alpha = max((known[0] for known in dampings if known is not None), default=0.0)
        radius = self._scheme.alpha_f / (1 - self._scheme.alpha_f)
        doubts = [STARTS_DAMPED] * self.damped + [STARTS_ROUGHLY] * (radius < ROUGH_RADIUS)
        doubts += [STARTS_HELD_BACK] * (alpha * h * (1 - radius) ** 2 / 4 > CARRIED)
        terms = sum(_terms(*start) for start in self._starts) if doubts else 0.0
        self._doubts = doubts if self._push > ROUNDING * terms else []
        dampings += [None][: len(self._doubts)]
        self._overshoot = Overshoot(self._scheme, float(self._starts[0][1].start.t), dampings)
        self._starts = []

    def doubts(self, overshoot: np.ndarray, g: np.ndarray) -> list[Doubt]:
        """Return once why the start is not certified, with what the first call of advance returned, and g (S,)."""
        if not len(g):
            return []
        found, self._doubts = self._doubts, []
        return found if overshoot[:, 1].max() > NEGLIGIBLE * g[-1] else []

    def felt(self, stream: str, energies: Sequence[MechanismEnergy]) -> FeltResiduals | None:
        """Return what goes on with the energy of a stream by averages, from where it begins; None: nothing does."""
        if self._share is not None and stream not in self._felt:
            norms, betas = zip(*((energy.norm, energy.beta) for energy in energies), strict=True)
            self._felt[stream] = FeltResiduals(self._share, norms, betas, (energies[0].g, energies[0].rough))
        return self._felt.get(stream)

    def advance(self, t: np.ndarray) -> np.ndarray:
        """Return it (S, 2) at the next samples t (S,)."""
        more = np.zeros((len(t), 2))
        if self._push and len(t):
            if self._overshoot is None:
                self._begin(float(t[0] - self._times[0]))
            more = self._push * self._overshoot.advance(t)
        self._positions = more[:, 0]
        return more

    def repeated(self, t: np.ndarray) -> list[Doubt]:
        """Return once why nothing is certified, if some of the next samples t (S,) show that a step was repeated.

        Before `lost` is asked. Steps are of the size that is tried first until one is repeated. With a spectral
        radius of 1 errors were as in other runs.
        """
        times, is_first = np.append(self._times, t), len(self._times) < 2
        h = np.append([self.step] if is_first and self.step is not None else [], np.diff(times))
        if self._varies or self._scheme is None or not overshoots(self._scheme):
            return []
        self._varies = bool(np.any(np.abs(np.diff(h)) > SAME_STEP * h[1:]))
        return [REPEATED] * self._varies

    def lost(self, t: np.ndarray) -> tuple[np.ndarray, list[str]]:
        """Return at which of the next samples t (S,) there is no bound any more, and why, once."""
        times, is_lost = np.append(self._times, t), np.full(len(t), self._is_lost)
        self._times, h = times[-2:], np.diff(times)
        grew = np.flatnonzero(h[1:] > GREW * h[:-1]) + 1
        if self._is_lost or not grew.size or not (self._scheme is None or overshoots(self._scheme)):
            return is_lost, []
        self._is_lost, first = True, grew[0]
        is_lost[first - len(h) :] = True
        return is_lost, [TOO_FAST.format(times[first], h[first] / h[first - 1])]

    def seen(self, run: Run) -> np.ndarray | float:
        """Return what outputs in global axes of a body may see of it (S, r), at the samples of `advance`."""
        if not self._positions.any():
            return 0.0
        return np.outer(self._positions, shared_energy(run, "reduction").at_start.shown)


def _push(at: AtStart, opening: Opening) -> float:
    """|R(0) + K e(0)|_{M^-1}, what accelerates a full body beside the reduced one where both start."""
    return at.push(_start(at, opening))


def _terms(at: AtStart, opening: Opening) -> float:
    """Sizes of what that is a sum of."""
    return at.terms(_start(at, opening))


def _start(at: AtStart, opening: Opening) -> np.ndarray:
    first, start = opening.first, opening.start
    if start.y0 is not None:
        return start.z + start.y0
    return at.coordinates(first.q[0], first.q_t[0], first.q_tt[0], opening.inputs)


def join_extensions(
    runs: Sequence[Run], extensions: Sequence[Extension], first_steps: FirstSteps, turned: np.ndarray
) -> list[str]:
    """Tell every block what energy all bodies have together at the ends of its segments; return notes.

    turned (S,) : of turned_in.
    """
    t = extensions[0].new.t
    overshoot, repeated, (is_lost, notes) = first_steps.advance(t), first_steps.repeated(t), first_steps.lost(t)
    notes = repeated + notes
    for stream in extensions[0].segments:
        blocks = [extension.segments[stream][0] for extension in extensions]
        energies = [shared_energy(run, stream) for run in runs]
        joint, felt = joint_growth(energies, blocks), first_steps.felt(stream, energies)
        notes = notes + first_steps.doubts(overshoot, joint[0])
        joint = joint if felt is None else _sharpened(joint, felt, energies, blocks, turned)
        joint = _with_carried(joint, first_steps.carried(blocks[0].h, turned))
        joint = tuple(np.where(is_lost, np.inf, x) for x in joint)
        for block in blocks:
            block.joint, block.overshoot = joint, overshoot
    for run in runs:
        run.messages += notes
    return notes


def turned_in(extension: Extension, frames: Sequence[np.ndarray], turning: np.ndarray) -> np.ndarray:
    """Return twice the angles (S,) by which frames of bodies, rows (S, 24), and constraints turn in the next steps.

    turning (S,) : of constraints, in rad/s.
    """
    rates = [turning, *(np.linalg.norm(FrameRows.of(rows).w, axis=1) for rows in frames)]
    return 2 * next(iter(extension.segments.values()))[0].h * np.max(rates, axis=0)


def _sharpened(
    joint: tuple[np.ndarray, ...],
    felt: FeltResiduals,
    energies: Sequence[MechanismEnergy],
    blocks: Sequence[Block],
    turned: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Return g, rough and the largest g of joint_growth, or by what is felt; with what two go on."""
    own, own_rough, peak = joint
    missed = np.linalg.norm([energy.missed(block) for energy, block in zip(energies, blocks, strict=True)], axis=0)
    before = felt.latest
    g, rough = felt.advance(blocks[0].h, [block.chain for block in blocks], missed, turned)
    peak = np.minimum(peak, np.maximum(g, np.append(before, g[:-1])))
    return np.minimum(own, g), np.minimum(own_rough, rough), peak, own, own_rough


def _with_carried(joint: tuple[np.ndarray, ...], more: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return g, rough and the largest g with what is beside them (S,), and what two go on with."""
    g, rough, peak, *own = joint
    return g + more, rough + more, peak + more, *(own or (g, rough))
