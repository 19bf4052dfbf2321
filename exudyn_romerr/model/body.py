"""ElasticBody: the full-order model M q'' + D q' + K q = B u, checked once, with its solves and modes."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ..checks import check_count
from ..errors import AssumptionError, InputError
from ..linalg import oscillator
from ..linalg.eigenmodes import ModalDamping, Modes, lowest_modes
from ..linalg.free_mass_matrix import FreeMassFactor, FreeMassMatrix, damping_of, explicit
from ..linalg.oscillator import Constants
from ..linalg.symmetric_factor import MANY, SymmetricFactor, faster_solver
from .admissible_space import MassOrthogonal, MeanMotion, space_of
from .matrix_checks import (
    check_damping,
    check_mass,
    check_masses,
    check_not_swapped,
    check_stiffness,
    checked_dofs,
    checked_matrix,
    checked_positions,
    checked_ratios,
    checked_rayleigh,
    precision,
)

ALL_MODES_LIMIT = 2000  # dense eigenproblem: above this the time and memory of the full spectrum are prohibitive


class ElasticBody:
    """A linear elastic body M q'' + D q' + K q = B u with N coordinates, some of them fixed.

    Parameters
    ----------
    mass, stiffness : scipy.sparse matrix or ndarray, (N, N)
        Symmetric; mass positive definite, stiffness positive definite once `fixed` is taken out. In single precision
        they are computed with in double; reports say what their rounding leaves open.
    rayleigh : (float, float), optional
        (alpha, beta) in 1/s and s: D = alpha M + beta K. Neither rayleigh nor damping: undamped.
    damping : scipy.sparse matrix or ndarray, (N, N), optional
        Any dissipative matrix, x^T D x >= 0; need not be symmetric (gyroscopic parts do no work).
    modal_damping : float or sequence of float, optional
        Ratios of the lowest modes (a float: of all) of the body as it is held; `rayleigh` damps those above them.
    fixed : sequence of int
        Coordinates held at zero. They count in N and keep their rows in V, B and output rows.
    positions : ndarray, (nodes, 3), optional
        Node positions in the length unit of the model; N / nodes must be 3 or 6 coordinates a node.
    reference : mean_motion(nodes, weights), optional
        Holds the body by conditions instead of `fixed`: the mean motion of some nodes is zero, as at Exudyn's RBE3
        interfaces. V must meet them; loads that would move the nodes are taken up where they are held.
    rigid : sequence of sequences of int
        Nodes of parts that move as rigid bodies, as Exudyn's RBE2 interfaces do; with `fixed` only.

    Raises
    ------
    InputError
        Shapes, nan or inf, asymmetry, mass not positive definite, both rayleigh and damping.
    AssumptionError
        Stiffness singular after supports (the message says how many rigid-body modes are left), or
        damping that feeds energy in.

    Does not cover: frames that move, nonlinear stiffness.
    """

    modal: ModalDamping | None = None
    _modes: Modes | None = None

    def __init__(
        self,
        mass: Any,
        stiffness: Any,
        rayleigh: ArrayLike | None = None,
        damping: Any = None,
        fixed: ArrayLike = (),
        positions: Any = None,
        reference: MeanMotion | MassOrthogonal | None = None,
        rigid: Sequence[Sequence[int]] = (),
        modal_damping: ArrayLike | None = None,
    ):
        self.results: dict[tuple[str, bytes], Any] = {}  # see shared_body.made_once
        self.precision = {"mass": precision(mass), "stiffness": precision(stiffness), "damping": precision(damping)}
        self.mass = checked_matrix("mass", mass, None)
        self.N = self.mass.shape[0]
        self.stiffness = checked_matrix("stiffness", stiffness, self.N)
        self.positions = checked_positions(positions, self.N)
        self.fixed = checked_dofs(fixed, self.N)
        check_not_swapped(self.mass, self.stiffness)
        if self.fixed.size == self.N:
            raise InputError(f"fixed lists all {self.N} coordinates; at least one must stay free")
        self.space = space_of(self, reference, rigid)
        self.free = self.space.free
        self.M, self.K = self.space.pencil(self.mass, self.stiffness)
        if rayleigh is not None and damping is not None:
            raise InputError("rayleigh and damping were both given; pass one of them (or neither: undamped)")
        self.rayleigh = checked_rayleigh(rayleigh) if damping is None else None
        self.damping = None if damping is None else checked_matrix("damping", damping, self.N, symmetric=False)
        help_at_hand = faster_solver(self.free.size)
        if help_at_hand:
            warnings.warn(help_at_hand, stacklevel=2)
        self.M = self.M if self.damping is None else explicit(self.M)
        weighed, of = (self.mass, np.arange(self.N)) if isinstance(self.M, FreeMassMatrix) else (self.M, self.free)
        check_masses(weighed, of)
        check_mass(self.mass_factor)
        if self.free.size > MANY:
            del self.mass_factor  # made again for the norms that need it: before these, others take the memory
        check_stiffness(self.K, self.M, self.stiffness_factor, self.fixed.size, self.precision["stiffness"])
        if self.damping is not None:
            check_damping(self.D)
        if modal_damping is not None:
            self._take_ratios(modal_damping)

    @classmethod
    def from_fem(
        cls,
        fem: Any,
        rayleigh: ArrayLike | None = None,
        fixed: ArrayLike = (),
        reference: Any = None,
        modal_damping: ArrayLike | None = None,
    ) -> ElasticBody:
        """Take mass, stiffness and node positions from an Exudyn FEMinterface (3 coordinates a node).

        Raises
        ------
        InputError
            The fem has no matrices yet, or one of the checks of ElasticBody fails.
        """
        if any(matrix is None or not np.size(matrix) for matrix in (fem.massMatrix, fem.stiffnessMatrix)):
            raise InputError("fem has no mass or stiffness matrix; import or compute them before from_fem")
        return cls(
            fem.GetMassMatrix(sparse=True),
            fem.GetStiffnessMatrix(sparse=True),
            rayleigh=rayleigh,
            fixed=fixed,
            positions=fem.GetNodePositionsAsArray(),
            reference=reference,
            modal_damping=modal_damping,
        )

    @cached_property
    def D(self) -> sp.csc_matrix | ModalDamping | None:
        """Damping on the free coordinates, for products; None if undamped."""
        if self.modal is not None:
            return self.modal
        if self.damping is not None:
            return self.space.matrix(self.damping)
        alpha, beta = self.rayleigh
        return damping_of(self.M, self.K, alpha, beta) if alpha or beta else None

    @property
    def dofs_per_node(self) -> int:
        """3 (solids) or 6 (beams, shells); InputError without node positions."""
        if self.positions is None:
            raise InputError("body has no node positions; pass positions=(nodes, 3) to ElasticBody")
        return self.N // len(self.positions)

    @cached_property
    def total_mass(self) -> float | None:
        """Mass of the whole body from a rigid translation; None without node positions."""
        if self.positions is None:
            return None
        translation = np.zeros(self.N)
        translation[:: self.dofs_per_node] = 1.0
        return float(translation @ (self.mass @ translation))

    @cached_property
    def mass_factor(self) -> SymmetricFactor | FreeMassFactor:
        """Factorisation of M on the free coordinates, made once."""
        return self.M.factor() if isinstance(self.M, FreeMassMatrix) else SymmetricFactor(self.M)

    @cached_property
    def stiffness_factor(self) -> SymmetricFactor:
        """Factorisation of K on the free coordinates, made once."""
        return SymmetricFactor(self.K)

    def expand(self, values: np.ndarray) -> np.ndarray:
        """Return displacements of all N coordinates (N, ...) from those of the free ones."""
        return self.space.expand(values)

    def modes(self, m: int) -> Modes:
        """Return the m lowest undamped modes on the free coordinates, none missed (Sylvester's inertia count).

        Raises
        ------
        InputError
            m is not in 1 .. number of free coordinates.
        AssumptionError
            The inertia count found more modes than the solver did; the message names the interval.
        """
        m = check_count("number of modes", m, self.free.size, "free coordinates")
        if self._modes is None or self._modes.omega.size < m:
            found = lowest_modes(self.M, self.K, m, self.stiffness_factor)
            self._modes = found if self.modal is None else self.modal.aligned(found)
        return self._modes.first(m)

    def all_modes(self) -> Modes:
        """Return every mode; refused by AssumptionError above 2000 free coordinates (dense eigenproblem)."""
        if self.free.size > ALL_MODES_LIMIT:
            raise AssumptionError(
                f"the full spectrum of {self.free.size} coordinates was asked for; allowed up to "
                f"{ALL_MODES_LIMIT}. Use kernels='certified', which needs omega_1 only"
            )
        return self.modes(self.free.size)

    def damping_ratios(self, omega: np.ndarray) -> np.ndarray:
        """Return zeta of the lowest modes, omega (m,) in rad/s; AssumptionError for a general damping matrix."""
        if self.modal is not None:
            return self.modal.ratios_of(omega)
        return oscillator.damping_ratios(omega, *self.require_rayleigh("modal damping ratios"))

    @property
    def proportional(self) -> tuple[float, float] | None:
        """(alpha, beta) of the modes above those with ratios of their own; None for a general matrix."""
        return self.rayleigh if self.modal is None else self.modal.rayleigh

    def require_rayleigh(self, who: str) -> tuple[float, float]:
        """Return (alpha, beta) or raise AssumptionError naming `who` needs them."""
        if self.rayleigh is None:
            found = "a general damping matrix" if self.modal is None else "ratios by mode"
            raise AssumptionError(
                f"{who} need Rayleigh damping, found {found}; pass rayleigh=(alpha, beta), "
                "or ask for estimators=('energy', 'fast') and kernels='certified': they take any dissipative damping"
            )
        return self.rayleigh

    def constants(self) -> Constants:
        """Return C1, C11, C12 as suprema over time from closed forms of all modes (theory.md 1, 2).

        C11 = max|Phi11|_M, C12 = max|Phi12|_M. C1 bounds max|Phi|: the root of the squared suprema of its
        four blocks, which is max|Phi21| to nine digits where the hump is high.

        Raises
        ------
        AssumptionError
            Damping not diagonal in modes, or more than 2000 free coordinates.
        """
        _ = self.modal or self.require_rayleigh("constants C1, C11, C12")
        omega = self.all_modes().omega
        s_max = oscillator.largest_impulse_response(omega, self.damping_ratios(omega))
        C1 = oscillator.largest_state_response(omega, s_max)
        return Constants(C1=C1, C11=1.0, C12=float(np.max(s_max)))

    def _take_ratios(self, given: float | Sequence[float]) -> None:
        if self.damping is not None:
            raise InputError("modal_damping and damping were both given; pass one of them")
        ratios = checked_ratios(given, self.free.size)
        if not ratios.ndim and self.free.size > ALL_MODES_LIMIT:
            few = f"more than the {ALL_MODES_LIMIT} that are computed: pass a list, one for each of the lowest modes"
            raise AssumptionError(f"modal_damping={float(ratios):g} is for all modes; {self.free.size} are {few}")
        modes = self.modes(ratios.size if ratios.ndim else self.free.size)
        self.modal = ModalDamping(self.M, self.K, modes, np.broadcast_to(ratios, modes.omega.shape), self.rayleigh)
        self.rayleigh = None
