"""EnrichedBody: a floating body with auxiliary vectors beside its modes, as part of a linearised mechanism."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...basis.basis import Basis
from ...basis.enrichment import Enrichment
from ...basis.shape_sums import ShapeSums, contracted
from ...checks import check_count
from ...errors import AssumptionError
from ...estimators.coupled_energy import CorrectedEnergy
from ...estimators.rigid_motion import Deformations
from ...linalg.blocked_products import consecutive
from ...model.floating_frame import moment_of, skew, unit_inertia
from ...model.outputs import stacked_rows
from ...model.shared_body import made_once
from ...offline.options import BoundOptions
from ...offline.prepare import prepare
from ...residual.interface_stiffening import rigid_response, with_rigid_interfaces
from ...residual.problem import Deferred
from ...residual.residual import ResidualMap
from ..access.reduced_damping import damping_products
from ..floating.input_terms import InputTerms
from ..floating.sampler import Sampler

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...model.body import ElasticBody
    from ...model.floating_frame import FrameMotion
    from ...offline.prepared import Offline
    from ...report.scope import Scene
    from ..floating.actions import Actions
    from ..floating.floating_body import FloatingBody, ReducedMatrices
    from ..floating.frame_support import Support

# vectors of "auto": 20 static responses (those to the inertia of 14 modes and of the frame are 26) and a round of
# responses to their own inertia; 14 more where a third deform rigid interfaces or damping is not Rayleigh's; 34 more
# of a LARGE body (coordinates) that nothing damps: once its vectors are made they cost little
VECTORS, STIFF, UNDAMPED, LARGE = 26, 40, 60, 20_000
DIFFERENCE = 1e-4  # of coordinates and rates, to differentiate by: inertia forces are polynomials of low degree


class Couplings(NamedTuple):
    """Columns (T, k + m, m) of M, D, K that belong to P, and rows (T, m, k) of D and K; M is symmetric."""

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    D_rows: np.ndarray
    K_rows: np.ndarray


def count_of(most: int, is_damped: bool, is_easy: bool) -> int:
    """Return how many vectors "auto" is, of so many that there can be."""
    undamped = UNDAMPED if most > LARGE else VECTORS
    return min((VECTORS if is_easy else STIFF) if is_damped else undamped, most)


class EnrichedBody:
    """Offline part of the feedback of one body: vectors P, their coupling to the mechanism, bounds of modes and P.

    Attributes
    ----------
    m : number of vectors. keeps : (m,) bool, those that leave the interfaces rigid that the modes make rigid: all, if
    these make none rigid. first : (m,) bool, those that fewer would have been. deformations : what bounds rows of
    modes, vectors and the rest. columns, frame, modal : coordinates in the mbs, of its frame, its modes. offline,
    sampler : of the body on modes and vectors. midpoint_residual : as asked for. note : line for the plan. flex,
    shapes (N, n + m) : the body as it is in the mbs, its modes and vectors. sums : of these. damping : X^T D Y.
    """

    def __init__(
        self,
        flex: FloatingBody,
        body: ElasticBody,
        model: ReducedMatrices,
        actions: Actions,
        support: Support,
        scene: Scene,
        columns: np.ndarray,
        terms: InputTerms,
        options: BoundOptions,
    ):
        self._actions, self._terms, self.midpoint_residual = actions, terms, options.midpoint_residual
        self._frame, self.frame_size = model.frame, model.frame.size
        self.columns, (self.frame, self.modal) = columns, np.split(columns, [model.frame.size])
        body.modes(1)  # first, and the next: they take factorisations beside those that are kept
        rigid = cache(lambda: None if scene.stiff is None else with_rigid_interfaces(body, scene.stiff))
        if scene.stiff is not None:
            rigid_response(body, scene.stiff, stacked_rows(options.outputs, body)[0], rigid)
        Z = body.space
        inertia, loads, wrenches = (
            Z.loads(part)
            for part in (
                unit_inertia(flex.mass, flex.positions),
                np.hstack([*(load.columns for load in actions.loads), np.zeros((body.N, 0))]),
                np.hstack([*(place.columns for place in actions.wrenches), np.zeros((body.N, 0))]),
            )
        )
        V_y, asked = Z.coordinates("V", model.held), options.auxiliary_modes
        if asked == "auto":
            asked = count_of(len(V_y), model.D.any(), scene.stiff is None and any(model.rayleigh))
        asked = check_count("auxiliary_modes", asked, len(V_y), "free coordinates; or 'auto'")
        try:
            found = made_once(
                body,
                "vectors",
                (V_y, loads, wrenches, asked, scene.stiff and scene.stiff.Z),
                lambda: Enrichment(body, V_y, inertia, loads, wrenches, asked, rigid()),  # noqa: F821
            )
        except AssumptionError as error:
            raise AssumptionError(f"{', '.join(place.name for place in actions.wrenches)}: {error}") from error
        del rigid
        P, self.m, self.keeps, self.first = Z.expand(found.P), found.P.shape[1], found.keeps, found.first
        highest = found.omega.max(initial=0.0)
        count = f"{asked} vectors{found.beside(asked)}"
        self.note = f"estimator 'auxiliary': {count}, up to {highest:.4g} rad/s, reacting with the mechanism"
        self.damping = partial(damping_products, body)
        self.flex, self.shapes = flex, np.hstack([model.V, P])
        held = self.shapes if model.rigid is None else np.hstack([model.held, P])
        self._couple(flex, held, model.V.shape[1])
        # where forces act: their motion by P (3, m); torques do not care
        self._moved_loads = [(not load.torque) * load.place.columns[:, :3].T @ P for load in actions.loads]
        self._force(body, V_y, found.P)
        del P, V_y, found, inertia, loads, wrenches  # of a large body they take memory that is short now
        wide = InputTerms(actions, support, flex, held, model.rigid and model.rigid.beside(self.m))
        self._prepare(body, held, wide, actions, scene, options)

    def _couple(self, flex: FloatingBody, held: np.ndarray, n: int) -> None:
        """Matrices between the body's coordinates and P, and of P (m, m), behind n modes; held : see RigidPart."""
        sums = self.sums = ShapeSums.of(flex.mass, flex.stiffness, flex.positions, self.shapes)
        V, P = slice(n), slice(n, None)
        self.K_PP, self.K_VP = sums.K[P, P], sums.K[V, P]
        D = self.damping(held, held[:, P], sums.M[:, P], sums.K[:, P])
        self.D_VP, self.D_PP = D[V], D[P]
        # of unit vectors: sum M P, sum x_i M P_j, V_i^T M P_j, P_i^T M P_j
        self._pull, self._arms = sums.pull[:, P].copy(), sums.of_x[:, :, P].copy()
        self._of_V, self._of_P = sums.of_U[:, :, V, P].copy(), sums.of_U[:, :, P, P].copy()

    def _force(self, body: ElasticBody, V: np.ndarray, P: np.ndarray) -> None:
        """-P^T R = -P^T L z of the modes alone."""
        residual = ResidualMap(body, V, body.space.loads(self._terms.columns))
        self._layout, self._forcing = residual.coordinates, -residual.seen_by(P.T)

    def _prepare(self, body, V: np.ndarray, terms: InputTerms, actions: Actions, scene: Scene, options) -> None:
        self.deformations = Deformations.of(body, V, options.outputs, self.flex.mass)
        kept = {name: getattr(options, name) for name in ("outputs", "residual", "kernels", "time")}
        self.offline: Offline = prepare(
            body,
            Basis(V, note=f"{V.shape[1]} modes and auxiliary vectors"),
            BoundOptions(inputs=Deferred(lambda: terms.columns, terms.made_of), estimators="auxiliary", **kept),
            sampled_inputs=True,
            scene=replace(scene, corrected=True, coupled_energy=CorrectedEnergy, minor=terms.minor),
        )
        self.sampler, self._rest_rows = Sampler.of(self._frame, actions, terms, self.offline), self._rests()

    def use(self, actions: Actions) -> EnrichedBody:
        """Take loads whose functions of time may be other ones than before; return itself."""
        self._actions, self.sampler = actions, replace(self.sampler, actions=actions)
        return self

    def rest(self, q: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Inputs (p,) beside which modes and vectors q (n + m,) rest, from those of the modes alone."""
        known, none = u.copy(), np.zeros((1, len(q)))
        known[len(u) - self._terms.unknown :] = 0.0
        first = self._terms.first_load  # after what turns with the frame, which is at rest
        wider = np.concatenate([known[:first], np.zeros(self.sampler.terms.first_load - first), known[first:]])
        return self.sampler.balanced(q[None], none, none, wider[None])[0]

    def forces(self, q: np.ndarray, q_t: np.ndarray, q_tt: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Return -P^T R (S, m) of samples of the reduced body."""
        return self._layout(q, q_t, q_tt, u) @ self._forcing.T

    def moved(self, own: slice, states: Sequence[np.ndarray], e: np.ndarray) -> list[np.ndarray]:
        """Return q, q_t, q_tt (S, k + m) of frame, modes and vectors in states of the mbs moved by e (3, S, size)."""
        columns, frame, pairs = consecutive(self.columns), consecutive(self.frame), zip(states, e, strict=True)
        found = [np.hstack([x[:, columns] + dx[:, columns], dx[:, own]]) for x, dx in pairs]
        bent = self._frame.bend(*([x[:, frame] for x in of] for of in (states, e)))
        for x, beside in zip(found, bent, strict=True):
            x[:, : self.frame_size] += beside
        return found

    def static_rest(self, t: np.ndarray, states: Sequence[np.ndarray], keeps: bool = False) -> np.ndarray:
        """Return -C K^-1 R (S, R) of a motion q, q_t, q_tt (S, k + m) of frame, modes and vectors.

        keeps : K^-1 of the body with interfaces as rigid as its modes make them; as free, if these make none rigid.
        """
        q, q_t, q_tt, u, _ = self.sampler(t, *states)
        return self.offline.balance.coordinates(q, q_t, q_tt, u) @ self._rest_rows[keeps].T

    def _rests(self) -> list[np.ndarray]:
        """Rows -C K^-1 L of R = L z, z as it is, not packed: with free interfaces, and with those of the modes."""
        free, rigid = -self.offline.estimators["auxiliary"].static_rows, self.offline.static_errors
        rows, packing = [free, free if rigid is None else rigid[1]], self.offline.packing
        return rows if packing is None else [x @ np.hstack([self.offline.coordinates.T_q, packing.T_u]) for x in rows]

    def couplings(self, t: np.ndarray, states: Sequence[np.ndarray]) -> Couplings:
        """Return what couples P to the mechanism at times t (T,), states q, q_t, q_tt (T, k) of the body in the mbs.

        Acceleration of a node by P in the frame: P y'' + 2 w~ P y' + S P y, velocities by the mbs:
        A^T r' - (x + u)~ w + V q'.
        """
        size = self._frame.size
        frame, modal = ([x[:, part] for x in states] for part in (slice(0, size), slice(size, None)))
        motion, rates = self._frame.motion(*frame), self._frame.rates(frame[0])
        arms = self._arms + np.einsum("tn,ijnm->tijm", modal[0], self._of_V)
        w, S = 2 * skew(motion.w), motion.S
        M, D, K = (self._columns(motion.A, rates, arms, turning) for turning in (np.eye(3)[None], w, S))
        D += np.vstack([np.zeros((size, self.m)), self.D_VP, self.D_PP])
        K += np.vstack([np.zeros((size, self.m)), self.K_VP, self.K_PP])
        inputs, D_rows, K_rows = self._by_the_frame(t, states)
        K[:, 3:size] += rates.swapaxes(1, 2) @ self._moved_arms(motion, inputs, S, arms, modal)
        D_rows = np.concatenate([D_rows, self.D_VP.T - contracted(w, self._of_V).swapaxes(1, 2)], axis=2)
        K_rows = np.concatenate(
            [K_rows, self.K_VP.T + contracted(S.swapaxes(1, 2), self._of_V).swapaxes(1, 2)], axis=2
        )
        return Couplings(M, D, K, D_rows, K_rows)

    def _columns(self, A: np.ndarray, rates: np.ndarray, arms: np.ndarray, turning: np.ndarray) -> np.ndarray:
        """Work of M (turning P) on the coordinates of the body in the mbs and on P, (T, k + m, m)."""
        moment = moment_of(np.einsum("tjk,tikm->tijm", np.broadcast_to(turning, A.shape), arms))
        of_modes, of_P = (contracted(turning, of) for of in (self._of_V, self._of_P))
        parts = [A @ turning @ self._pull, rates.swapaxes(1, 2) @ moment, of_modes, of_P]
        return np.concatenate([np.broadcast_to(part, (len(A), *part.shape[1:])) for part in parts], axis=1)

    def _moved_arms(
        self, motion: FrameMotion, inputs: np.ndarray, S: np.ndarray, arms: np.ndarray, modal
    ) -> np.ndarray:
        """Moments (T, 3, m) of inertia forces and loads of the reduced motion on nodes that P moves.

        Not of gravity: Exudyn's LoadMassProportional turns a body by its undeformed mass centre.
        """
        b, w = motion.local(motion.r_tt), 2 * skew(motion.w)
        products = self._pull[:, None] * b[:, None, :, None] + np.einsum("tkl,tljm->tjkm", S, arms)
        rates = np.einsum("tn,ljnm->tljm", modal[1], self._of_V)
        products += np.einsum("tkl,tljm->tjkm", w, rates) + np.einsum("tn,kjnm->tjkm", modal[2], self._of_V)
        for i, moved in enumerate(self._moved_loads):
            first = self._terms.first_load + 3 * i
            products -= moved[:, None] * inputs[:, None, first : first + 3, None]
        return moment_of(products)

    def _by_the_frame(self, t: np.ndarray, states: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Inputs, and D and K (T, m, size) of P by the frame: how inertia forces and loads on P turn with it."""
        size, by = self._frame.size, np.zeros((3, 4 * self._frame.size + 1, states[0].shape[1]))
        step = DIFFERENCE * np.eye(size, by.shape[2])  # of rates, then of coordinates, both ways; at last none
        by[1, : 2 * size] = by[0, 2 * size : -1] = np.concatenate([step, -step])
        q, q_t, q_tt = ((x[:, None] + dx).reshape(-1, x.shape[1]) for x, dx in zip(states, by, strict=True))
        motion = self._frame.motion(*(x[:, :size] for x in (q, q_t, q_tt)))
        inputs = self._terms.values(
            self._actions, np.repeat(t, by.shape[1]), motion, *(x[:, size:] for x in (q, q_t, q_tt))
        )
        inputs = inputs.reshape(len(t), by.shape[1], -1)
        found = inputs[:, :-1] @ self._forcing[:, self._layout.input_slot].T
        found = found.reshape(len(t), 2, 2, size, self.m).swapaxes(3, 4)
        D, K = np.moveaxis((found[:, :, 1] - found[:, :, 0]) / (2 * DIFFERENCE), 1, 0)
        return inputs[:, -1], D, K
