"""The error space cut into auxiliary modes and the rest: AuxiliaryModes, Split (theory.md 4)."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg as la

from ...checks import check_count
from ...linalg.eigenmodes import count_below
from ...linalg.orthogonalise import without
from ...model.body import ElasticBody
from .decay_rates import DecayRate, rayleigh_rates
from .residual import DualNorms, OutputNorms

AUTO_SHARE = 0.05  # of |C|_{K^-1} that may be left above the auxiliary modes
AUTO_CAP = 60  # modes, where the reduced body rings in no more
LARGEST_CAP = 200  # modes, where it does
AUTO_WITHOUT_OUTPUTS = 20


class AuxiliaryModes:
    """m modes P (n_free, m) of the full body; full-size, offline.

    V, W : basis of the reduced body. asked : m, or "auto", chosen by the rows of `outputs` that were requested (R,).

    Attributes
    ----------
    omega (m,), cut : rad/s; every other mode has omega >= cut (inf if P is complete).
    cap_note : the note for the plan if "auto" stopped at its cap, else None.
    ringing_note : what to tell the reader if the reduced body rings in more modes than "auto" may take, else None.
    """

    def __init__(
        self,
        body: ElasticBody,
        V: np.ndarray,
        W: np.ndarray,
        asked: int | str,
        outputs: OutputNorms,
        requested: np.ndarray,
    ):
        if body.proportional is None:
            body.require_rayleigh("auxiliary modes")
        self.body = body
        self._bases = V, W
        self.cap_note: str | None = None
        self.ringing_note: str | None = None
        least = 1 if body.modal is None else body.modal.count
        if asked == "auto":
            asked = max(self._auto_count(outputs, requested), least)
        of = "free coordinates; or 'auto'" + (f"; {least} have damping ratios of their own" if body.modal else "")
        modes = body.modes(check_count("auxiliary_modes", asked, body.free.size, of, least))
        self.omega, self.P, self.cut = modes.omega, modes.shapes, modes.cut

    @cached_property
    def Y_K(self) -> np.ndarray:
        """K P Omega^-1 where |.|_{K^-1} is the 2-norm: orthonormal columns."""
        return self.body.stiffness_factor.half_multiply(self.P / self.omega)

    @cached_property
    def Y_M(self) -> np.ndarray:
        """M P where |.|_{M^-1} is the 2-norm, P where |.|_M is: orthonormal columns."""
        return self.body.mass_factor.half_multiply(self.P)

    @cached_property
    def residual(self) -> np.ndarray:
        """|K phi - omega^2 M phi|_{K^-1} / |phi|_K of every mode (m,): how exact the computed modes are."""
        solved = self.body.stiffness_factor.half_solve(self.body.M @ (self.P * self.omega))
        return np.linalg.norm(self.Y_K - solved, axis=0)

    def _auto_count(self, outputs: OutputNorms, requested: np.ndarray) -> int:
        """Smallest m with |C|_rest <= 5 % of |C|_{K^-1} for every output, at most 60, or as the body rings."""
        body = self.body
        cap = min(AUTO_CAP, body.free.size)
        if not requested.any():
            return min(AUTO_WITHOUT_OUTPUTS, cap)
        left = self._share_above(cap, outputs, requested)
        if left[-1] > AUTO_SHARE:
            cap = max(cap, self._ringing(cap))
            left = self._share_above(cap, outputs, requested)
        if left[-1] > AUTO_SHARE:
            self.cap_note = f"'auto' stopped at {cap} modes with {100 * left[-1]:.2g} % of |C| above them"
            return cap
        self.ringing_note = None
        return int(np.argmax(left <= AUTO_SHARE)) + 1

    def _share_above(self, m: int, outputs: OutputNorms, requested: np.ndarray) -> np.ndarray:
        """The largest |C|_rest/|C|_{K^-1} of all outputs that decide, above 1, 2, ... m modes (m,)."""
        modes = self.body.modes(m)
        seen = requested & (outputs.C_K > 0)  # rows that see free coordinates
        share = np.cumsum((outputs.C[seen] @ modes.shapes / modes.omega) ** 2, axis=1) / outputs.C_K[seen, None] ** 2
        return np.sqrt(np.max(np.maximum(1 - share, 0.0), axis=0, initial=0.0))

    def _ringing(self, known: int) -> int:
        """Number of modes below what the reduced body's highest mode rings at, at most 200; at least `known` are.

        In those the error rings with the reduced body. What varies so fast is paid for in full where it is bounded.
        """
        body, (V, W) = self.body, self._bases
        squares = la.eigvals(W.T @ (body.K @ V), W.T @ (body.M @ V))
        highest = float(np.sqrt(np.max(np.abs(squares))))
        if highest <= body.modes(known).cut:
            return known
        found = count_below(body.M, body.K, highest)
        if found > LARGEST_CAP:
            self.ringing_note = (
                f"the reduced body rings in {found} modes of the full one, and 'auto' follows {LARGEST_CAP}: bounds "
                f"are larger than they need be, the more so the more modes ring; auxiliary_modes={found} follows all"
            )
        return min(found, LARGEST_CAP)


class Split(DualNorms):
    """The rest R_rest = (I - M P P^T) R above auxiliary modes P, its norms, and P^T R; full-size, offline."""

    def __init__(self, modes: AuxiliaryModes, whole: DualNorms):
        super().__init__(whole.map, whole.initial_state, whole.kind, whole.has_initial_error)
        self.modes, self._whole = modes, whole

    # columns where norms of the rest are 2-norms: not kept beside those of the whole
    Y_M = property(lambda self: without(self.modes.Y_M, self._whole.Y_M))
    Y_K = property(lambda self: without(self.modes.Y_K, self._whole.Y_K))
    Y_static = property(lambda self: without(self.modes.Y_M, self._whole.Y_static))

    @cached_property
    def rates(self) -> list[DecayRate]:
        """Admissible decay rates of the rest; none if nothing is left."""
        cut = self.modes.cut
        return rayleigh_rates((cut, *self.modes.body.proportional)) if np.isfinite(cut) else []

    @cached_property
    def PL(self) -> np.ndarray:
        """P^T [L, K q0, M q0'], with Omega^2 P^T M in place of P^T K, which cancels."""
        omega, MP = self.modes.omega, self.body.M @ self.modes.P
        PL = self.map.seen_by(self.modes.P.T)
        coordinates, MPV = self.map.coordinates, MP.T @ self.map.V
        PL[:, coordinates.stiffness_slot] = omega[:, None] ** 2 * MPV
        if coordinates.has_damping:
            PL[:, coordinates.damping_slot] = (2 * self.body.damping_ratios(omega) * omega)[:, None] * MPV
        if self.initial_state is None:
            return PL
        q0, q0_t = self.initial_state
        return np.column_stack([PL, omega**2 * (MP.T @ q0), MP.T @ q0_t])


def above(rows: OutputNorms, modes: AuxiliaryModes) -> OutputNorms:
    """Return norms of output rows on the rest above auxiliary modes; static_rows are C K^-1 L_rest."""
    rest = OutputNorms(rows.body, rows.C, rows.velocity_rows, rows.dual)
    rest.Y_C_M, rest.Y_C_K = without(modes.Y_M, rows.Y_C_M), without(modes.Y_K, rows.Y_C_K)
    return rest
