"""Bodies and loads on which rules for the number of modes are judged, and their exact responses.

Bodies are held at one interface by its mean motion (RBE3); a force at another one, or the support's acceleration,
moves them. All modes of the full body, and of each reduced one, are integrated exactly, for loads are linear between
samples: no error of time steps is in any number.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as la
from exudyn.FEM import FEMinterface
from scipy.signal import cont2discrete, lfilter

import exudyn_romerr as romerr
from models import floating
from models.hex_bar import hex_bar
from models.hex_block import hex_block

MOST = 32  # eigenmodes
PERIODS = 12  # of the lowest mode
A_PERIOD = 400  # samples in one of these
DAMPING = 0.01  # ratio at the lowest frequency, and at ten times that
CROOKED = 0.05 * np.array([[0, np.sin(x), 1 - np.cos(x)] for x in np.linspace(0, np.pi, 9)])  # m


class Reduced(NamedTuple):
    """A reduced body: frequencies (n,) in rad/s and shapes (N, n) in modes of the full one."""

    omega: np.ndarray
    shapes: np.ndarray


class Held:
    """A body held at its interface "left": its modes, and bases in coordinates of these.

    fem : its modes are made anew by whoever asks for them. omega (m,) : of all modes in rad/s, modes (N, m). loads,
    outputs : by name, (N,).
    """

    def __init__(self, name: str, fem: FEMinterface, node: int):
        self.name, self.fem = name, fem
        (held, of_held), (nodes, weights) = (floating.interface(fem, side) for side in ("left", "right"))
        self._options = {"positions": fem.GetNodePositionsAsArray(), "reference": romerr.mean_motion(held, of_held)}
        self._matrices = fem.GetMassMatrix(sparse=True), fem.GetStiffnessMatrix(sparse=True)
        undamped = romerr.ElasticBody(*self._matrices, **self._options)
        found = undamped.all_modes()
        self.omega, self.modes = found.omega, undamped.expand(found.shapes)
        self.rayleigh = DAMPING * self.omega[0] * 20 / 11, DAMPING * 2 / (11 * self.omega[0])
        force = np.zeros(undamped.N)
        force[3 * np.asarray(nodes) + 2] = weights
        along = np.tile([0.0, 0.0, 1.0], undamped.N // 3)
        self.loads = {"force": force, "shaken": -(self._matrices[0] @ along)}
        strain = romerr.node_strain("strain", node=node, fem=fem, component="xx")
        self.outputs = {"tip": force, "strain": np.ravel(strain.rows)}

    def new_body(self) -> romerr.ElasticBody:
        """As users of this package have it, nothing computed yet."""
        return romerr.ElasticBody(*self._matrices, rayleigh=self.rayleigh, **self._options)

    @cached_property
    def body(self) -> romerr.ElasticBody:
        """One of them."""
        return self.new_body()

    def hurty_craig_bampton(self, kind: str) -> np.ndarray:
        """Exudyn's modes with "RBE2" or "RBE3" interfaces (N, 6 + MOST): static ones first."""
        floating.craig_bampton(self.fem, ("left", "right"), MOST, kind)
        return self.fem.modeBasis["matrix"].copy()

    @cached_property
    def craig_bampton(self) -> np.ndarray:
        """Those with RBE3 interfaces, made once."""
        return self.hurty_craig_bampton("RBE3")

    @cached_property
    def fixed_frequencies(self) -> np.ndarray:
        """Those (MOST,) of the Craig-Bampton eigenmodes, rad/s: both interfaces stand still."""
        V = self.craig_bampton[:, 6:]
        return np.sqrt(
            np.einsum("ij,ij->j", V, self._matrices[1] @ V) / np.einsum("ij,ij->j", V, self._matrices[0] @ V)
        )

    def reduced(self, V: np.ndarray) -> Reduced:
        """Return a body reduced to the span of V (N, n)."""
        in_modes = self.modes.T @ (self._matrices[0] @ V)
        in_modes = la.orth(in_modes / np.linalg.norm(in_modes, axis=0))
        squares, turn = la.eigh(in_modes.T @ (self.omega[:, None] ** 2 * in_modes))
        return Reduced(np.sqrt(squares), in_modes @ turn)

    @cached_property
    def whole(self) -> Reduced:
        """The full body."""
        return Reduced(self.omega, np.eye(len(self.omega)))


@dataclass
class Case:
    """A body, a load, its course over time. highest : frequency in rad/s above which it has 1 % of its power."""

    held: Held
    load: str
    course: str

    @property
    def name(self) -> str:
        """Of the case."""
        return f"{self.held.name}, {self.load}, {self.course}"

    @cached_property
    def t(self) -> np.ndarray:
        """Samples (T,), s."""
        return np.arange(PERIODS * A_PERIOD + 1) * 2 * np.pi / (self.held.omega[0] * A_PERIOD)

    @cached_property
    def force(self) -> np.ndarray:
        """The course (T,)."""
        x = self.held.omega[0] * self.t / (2 * np.pi)  # periods of the lowest mode
        return {
            "ramp": np.where(x < 3, np.sin(np.pi * np.minimum(x, 3) / 6) ** 2, 1.0),
            "pulse": np.where(x < 0.25, np.sin(4 * np.pi * x) ** 2, 0.0),
            "sweep": np.sin(np.pi * 6 * x**2 / PERIODS) * np.minimum(1.0, x),  # up to 6 times the lowest frequency
            "sudden": np.minimum(x * A_PERIOD, 1.0),  # within a sample
        }[self.course]

    @cached_property
    def highest(self) -> float:
        """See the class; inf: there is no such frequency."""
        if self.course == "sudden":
            return np.inf
        power = np.abs(np.fft.rfft(self.force - self.force[-1] * self.t / self.t[-1], 16 * len(self.t))) ** 2
        share = np.cumsum(power) / power.sum()
        return 2 * np.pi * np.searchsorted(share, 0.99) / (16 * len(self.t) * self.t[1])

    def gains(self, of: Reduced) -> np.ndarray:
        """What the load does to the modes of a reduced body (n,)."""
        return of.shapes.T @ (self.held.modes.T @ self.held.loads[self.load])

    def motion(self, of: Reduced, order: int = 0) -> np.ndarray:
        """Coordinates (T, n) of the modes of a reduced body; order 1: their rates."""
        alpha, beta = self.held.rayleigh
        numerator, found = [1.0] + [0.0] * order, np.empty((len(self.t), len(of.omega)))
        for k, (omega, gain) in enumerate(zip(of.omega, self.gains(of), strict=True)):
            damped = [1.0, alpha + beta * omega**2, omega**2]
            b, a, _ = cont2discrete((numerator, damped), self.t[1], "foh")
            found[:, k] = lfilter(np.ravel(b), a, gain * self.force)
        return found

    def shown(self, of: Reduced) -> dict[str, np.ndarray]:
        """What outputs show (T,)."""
        x = self.motion(of)
        return {name: x @ (of.shapes.T @ (self.held.modes.T @ row)) for name, row in self.held.outputs.items()}

    @cached_property
    def truth(self) -> dict[str, np.ndarray]:
        """That of the full body."""
        return self.shown(self.held.whole)

    def errors(self, of: Reduced) -> dict[str, float]:
        """Largest errors over largest values, by output."""
        pairs = ((name, x, self.truth[name]) for name, x in self.shown(of).items())
        return {name: float(np.abs(x - y).max() / np.abs(y).max()) for name, x, y in pairs}


def bodies() -> Iterator[Held]:
    """Yield the bodies."""
    for name, of in (("bar", "bar_fine"), ("rotor", "rotor")):
        fem = floating.load_fem(of)
        yield Held(name, fem, _near_left(fem))
    straight, crooked = hex_bar(8), hex_bar(8, shifts=CROOKED)
    plate = hex_block((10, 4, 1), (0.4, 0.2, 0.005))
    block = hex_block((5, 2, 2), (0.3, 0.1, 0.12))
    for name, fem in (("slender", straight), ("crooked", crooked), ("plate", plate), ("block", block)):
        yield Held(name, fem, _near_left(fem))


def _near_left(fem: FEMinterface) -> int:
    """The node on the upper edge, a tenth of the length from the held interface."""
    x = fem.GetNodePositionsAsArray()
    low, size = x.min(axis=0), np.ptp(x, axis=0)
    return int(np.argmin(np.linalg.norm((x - low) / size - [0.1, 0.5, 1.0], axis=1)))


def cases(held: Held) -> Iterator[Case]:
    """Yield all loads of a body."""
    for load, course in (
        ("force", "ramp"),
        ("force", "pulse"),
        ("force", "sweep"),
        ("force", "sudden"),
        ("shaken", "pulse"),
        ("shaken", "sweep"),
    ):
        yield Case(held, load, course)
