"""Runs of the bodies of one mechanism, whose bounds share one energy (theory.md 7, "coupled")."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..decay.passive_steps import PassiveSteps, step_change
from ..estimates.overshoot import CarriedTurn, Excess, Overshoot, StartStorage, overshoots
from ..estimators.coupled_energy import EXACT, JointEnergy, MechanismEnergy, joint_growth
from ..model.floating_frame import FrameRows
from ..residual.felt_residuals import STARTED, FeltResiduals
from .run_messages import BEGUN_ANEW, REPEATED, STARTS_DAMPED, UNKNOWN_SCHEME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..report.scope import Doubt
    from ..residual.free_mass import AtStart
    from ..trajectory.samples import Extension
    from ..trajectory.scheme import Scheme
    from ..trajectory.segments import Block
    from .run import Opening, Run

# from one step to the next: Exudyn's adaptive steps grow by 2 at most unless they are told else
GREW = 2.0 * (1 + 1e-6)
SAME_STEP = 1e-6  # of a step: solvers add up their steps
NEGLIGIBLE = 1e-3  # of the energy's root, what the integrator makes of the start
ROUNDING = 1e-8  # of the terms of R(0): so much may a static solve leave
# of the first step: what a residual of mass 1 makes velocities of slow modes by way of Rayleigh's alpha. Damping of
# motion relative to a frame joins modes, so that no march of single ones tells
CARRIED = 1e-4


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


@dataclass(frozen=True)
class Connectors:
    """Springs and dampers beside bodies.

    stiffness, damping : K_s <= stiffness M, in 1/s^2, D_s <= damping M, in 1/s; inf: unknown. covered : in s, the
    largest beta with D_s >= beta K_s.
    """

    are_damped: bool = False
    stiffness: float = 0.0
    damping: float = 0.0
    covered: float = np.inf


class FirstSteps:
    """What the integrator makes of a start, and of steps of other sizes, in all bodies of a mechanism together.

    Where damping leaves single modes apart, their march tells what accelerations at the start do (Overshoot). Dampers
    in joints, Rayleigh's alpha and ratios of bodies' modes join modes of the mechanism: PassiveSteps holds for any.

    scheme : of the solver; None: unknown. share : of a residual at a step's begin in what the step feels of it, None:
    not known. step : that the solver tries first, None: unknown.
    """

    def __init__(
        self,
        scheme: Scheme | None,
        share: float | None = None,
        connectors: Connectors = Connectors(),
        step: float | None = None,
    ):
        self._scheme, self._share, self.connectors, self.step = scheme, share, connectors, step
        self.steps = EXACT if scheme is None else PassiveSteps.of(**vars(scheme)) or EXACT
        self._is_passive = scheme is not None and PassiveSteps.of(**vars(scheme)) is not None
        self._push = 0.0
        self._doubts: list[Doubt] = []
        self._felt: dict[str, FeltResiduals] = {}
        self._times, self._varies = np.zeros(0), False  # the last two
        self._grown = 1.0  # product of factors
        self._starts: list[tuple[AtStart, Opening]] = []  # until the first step
        self._overshoot: Overshoot | None = None
        self._started: StartStorage | None = None
        self._apart = False  # whether damping leaves modes apart
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
        """Begin with a first step h."""
        dampings = [at.damping for at, _ in self._starts]
        alpha = max((known[0] for known in dampings if known is not None), default=0.0)
        radius = self._scheme.alpha_f / (1 - self._scheme.alpha_f)
        joins = self.connectors.are_damped or None in dampings or alpha * h * (1 - radius) ** 2 / 4 > CARRIED
        self._apart = not joins
        if self._apart:
            self._overshoot = Overshoot(self._scheme, float(self._starts[0][1].start.t), dampings)
        elif self._is_passive and np.isfinite(self.connectors.stiffness):
            sizes = self._push, self._accelerations()
            self._started = StartStorage(self.steps, h, sizes, self._excess(dampings))
        elif self._push > ROUNDING * sum(_terms(*start) for start in self._starts):
            self._doubts = [STARTS_DAMPED]
        self._starts = []

    def _excess(self, dampings: list[tuple[float, float] | None]) -> Excess | None:
        """Return the damping beside one beta for all bodies and springs; None: that of a body is not known.

        beta is the least that any of them has, and what others have above it counts: betas that are the same may
        differ in their last digits, on which no bound may depend.
        """
        if None in dampings:
            return None
        betas = [beta for _, beta in dampings]
        beta = min(*betas, self.connectors.covered)
        alphas = [alpha * at.relative**2 for (at, _), (alpha, _) in zip(self._starts, dampings, strict=True) if alpha]
        return Excess(beta, self.connectors.damping + max(alphas, default=0.0), max(betas) - beta)

    def _accelerations(self) -> float:
        """|a|_{K + K_s} of accelerations at the start, whatever joints make of them."""
        parts = np.array([at.accelerations(_start(at, opening)) for at, opening in self._starts])
        steepest = max(at.joints.steepest for at, _ in self._starts)
        own, joined = np.linalg.norm(parts, axis=0)
        return float(np.hypot(own + steepest * joined, np.sqrt(self.connectors.stiffness) * self._push))

    def of_steps(self, h: np.ndarray) -> dict[str, Any]:
        """Return what is known of steps h (S,) for a JointEnergy; after `repeated` and `advance` were asked."""
        started = None if self._started is None else self._started.advance(len(h))
        known = {"even": not self._varies, "apart": self._apart, "started": started}
        return {"steps": self.steps, "h": float(h.max(initial=0.0)), **known}

    def doubts(self, h: np.ndarray, g: np.ndarray) -> list[Doubt]:
        """Return once why the start is not certified; h (S,) : the first steps, g (S,) : energies after them."""
        if not len(g):
            return []
        found, self._doubts = self._doubts, []
        return found if h[0] * self._push > NEGLIGIBLE * g[-1] else []

    def felt(self, stream: str, energies: Sequence[MechanismEnergy]) -> FeltResiduals | None:
        """Return what goes on with the energy of a stream by averages, from where it begins; None: nothing does."""
        if self._share is not None and stream not in self._felt:
            norms, betas = zip(*((energy.norm, energy.beta) for energy in energies), strict=True)
            more = 0.0 if self._overshoot is None else STARTED
            self._felt[stream] = FeltResiduals(self._share, norms, betas, (energies[0].g, energies[0].rough), more)
        return self._felt.get(stream)

    def advance(self, t: np.ndarray) -> np.ndarray:
        """Return what is marched of the start (S, 2) at the next samples t (S,)."""
        if self._starts and len(t):
            self._begin(float(t[0] - self._times[0]))
        more = np.zeros((len(t), 2)) if self._overshoot is None else self._push * self._overshoot.advance(t)
        self._positions = more[:, 0]
        return more

    def repeated(self, t: np.ndarray) -> list[Doubt]:
        """Return once why nothing is certified, if some of the next samples t (S,) show that a step was repeated.

        Before `grown` is asked. Steps are of the size that is tried first until one is repeated. With a spectral
        radius of 1 errors were as in other runs.
        """
        times, is_first = np.append(self._times, t), len(self._times) < 2
        h = np.append([self.step] if is_first and self.step is not None else [], np.diff(times))
        if self._varies or self._scheme is None or not overshoots(self._scheme):
            return []
        self._varies = bool(np.any(np.abs(np.diff(h)) > SAME_STEP * h[1:]))
        return [REPEATED] * self._varies

    def grown(self, t: np.ndarray) -> np.ndarray:
        """Return the product of factors (S,) of steps that grew at once, at the next samples t (S,)."""
        times = np.append(self._times, t)
        self._times, h = times[-2:], np.diff(times)
        ratios = h[1:] / h[:-1]
        grew = np.where((ratios > GREW) & overshoots(self._scheme), ratios, 1.0) if self._scheme else 1.0 + 0 * ratios
        found = self._grown * np.cumprod([step_change(ratio) for ratio in grew])
        self._grown = float(np.append(self._grown, found)[-1])
        return np.append(np.ones(len(t) - len(found)), found)

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
    notes, overshoot = first_steps.repeated(t), first_steps.advance(t)
    grown = first_steps.grown(t)
    of_steps = first_steps.of_steps(next(iter(extensions[0].segments.values()))[0].h)
    for stream in extensions[0].segments:
        blocks = [extension.segments[stream][0] for extension in extensions]
        energies = [shared_energy(run, stream) for run in runs]
        own, felt = joint_growth(energies, blocks, first_steps.steps.impulse), first_steps.felt(stream, energies)
        notes = notes + first_steps.doubts(blocks[0].h, own[0])
        joint = replace(JointEnergy.of_exact_motion(*own), **of_steps)
        joint.peak = joint.norms[0] * joint.peak
        if felt is not None:
            _take_averages(joint, felt, energies, blocks, turned)
        joint.overshoot = overshoot
        _add(joint, first_steps.carried(blocks[0].h, turned), grown)
        for block in blocks:
            block.joint = joint
    for run in runs:
        run.messages += notes
    return notes


def turned_in(extension: Extension, frames: Sequence[np.ndarray], turning: np.ndarray) -> np.ndarray:
    """Return twice the angles (S,) by which frames of bodies, rows (S, 24), and constraints turn in the next steps.

    turning (S,) : of constraints, in rad/s.
    """
    rates = [turning, *(np.linalg.norm(FrameRows.of(rows).w, axis=1) for rows in frames)]
    return 2 * next(iter(extension.segments.values()))[0].h * np.max(rates, axis=0)


def _take_averages(
    joint: JointEnergy,
    felt: FeltResiduals,
    energies: Sequence[MechanismEnergy],
    blocks: Sequence[Block],
    turned: np.ndarray,
) -> None:
    """Take what steps feel of R, or the work of that, where it is smaller than what R varies by."""
    missed = np.linalg.norm([energy.missed(block) for energy, block in zip(energies, blocks, strict=True)], axis=0)
    found = felt.advance(blocks[0].h, [x.chain for x in blocks], joint.steps.impulse * missed, turned)
    stored, beside = np.vstack([joint.stored, found[:2]]), np.vstack([0 * missed, found[2:]])
    levels = joint.norms[0] * stored + beside
    best = np.argmin(levels, axis=0), np.arange(len(missed))
    joint.stored, joint.beside = stored[best], beside[best]
    joint.speed = np.minimum(joint.speed, found[:2].min(axis=0))
    known = np.append(felt.latest * joint.norms[0], levels[1])
    joint.peak, felt.latest = np.minimum(joint.peak, np.maximum(known[1:], known[:-1])), known[-1] / joint.norms[0]


def _add(joint: JointEnergy, more: np.ndarray, grown: np.ndarray) -> None:
    """Add what is beside (S,), and take the product of factors (S,)."""
    joint.beside, joint.speed, joint.peak = joint.beside + more, joint.speed + more, joint.peak + more
    if np.any(grown > 1):
        joint.stored, joint.speed, joint.peak = (grown * x for x in (joint.stored, joint.speed, joint.peak))
        # of the storage that allows it
        joint.started = None if joint.started is None else np.sqrt(3.0) * grown * joint.started
