"""Reduced bodies at the edge of double precision, with load, steps and exact motion of the full body."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import exudyn as exu
import numpy as np

import exudyn_romerr as romerr
from models import exact, floating, linkage
from models import extreme_bodies as bodies
from models.precise import PreciseModes

ALL = ("fast", "convolution", "energy", "auxiliary")
FIFTY_DIGITS = "modes, 50 digits"
CLOSED_FORM = "closed form of all modes, 80 bits"


@dataclass(frozen=True)
class Scene:
    """A reduced body under the load b sin(W t); samples are exact ones of the reduced body, None: Exudyn's solver."""

    body: romerr.ElasticBody
    basis: romerr.Basis
    load: np.ndarray
    W: float
    t: np.ndarray
    samples: tuple[np.ndarray, np.ndarray, np.ndarray] | None
    row: np.ndarray
    truth: Any
    method: str
    start: tuple[np.ndarray, np.ndarray] | None = None
    options: dict = field(default_factory=dict)

    def force(self, t: Any) -> Any:
        """Return the load's factor at time t."""
        return np.sin(self.W * t)

    def report(self) -> romerr.BoundReport:
        """Return the bounds of displacement y and velocity v by all estimators."""
        outputs = [romerr.Output("y", self.row), romerr.Output("v", self.row, of="velocity")]
        options = {"outputs": outputs, "estimators": ALL, "initial": self.start, **self.options}
        if self.samples is None:
            return self._simulated(options)
        traj = romerr.Trajectory(self.t, *self.samples, self.force(self.t))
        common = {"inputs": self.load, "input_function": self.force}
        return romerr.evaluate(self.body, self.basis, traj, **common, **options)

    def _simulated(self, options: dict) -> romerr.BoundReport:
        mbs = exu.SystemContainer().AddSystem()
        flex = romerr.add_reduced_body(
            mbs, self.body, self.basis, inputs=self.load[:, None], input_function=self.force
        )
        monitor = romerr.attach(mbs, flex, **options)
        mbs.Assemble()
        simulationSettings = exu.SimulationSettings()
        simulationSettings.timeIntegration.endTime = self.t[-1]
        simulationSettings.timeIntegration.numberOfSteps = len(self.t) - 1
        simulationSettings.timeIntegration.verboseMode = 0
        simulationSettings.solution.file.write = False
        mbs.SolveDynamic(simulationSettings)
        return monitor.report()


def small(
    matrices: bodies.Matrices,
    rayleigh: tuple[float, float] = (0.0, 0.0),
    *,
    n: int = 1,
    periods: float = 3.0,
    steps: int = 200,
    W: float = 0.7,
    at: int = -1,
    seen: int = 0,
    size: float = 1.0,
    t: np.ndarray | None = None,
    solved: bool = False,
    start: tuple[np.ndarray, np.ndarray] | None = None,
    kept: tuple[np.ndarray, np.ndarray] | None = None,
    **options: Any,
) -> Scene:
    """Return a Scene of the n lowest modes; periods, W: of the first one. start, kept: full and reduced state."""
    M, K = matrices
    body = romerr.ElasticBody(M, K, rayleigh=rayleigh)
    basis, omega = romerr.modal_basis(body, n), float(body.modes(1).omega[0])
    load, W = size * np.eye(len(M))[at], W * omega
    t = np.linspace(0, periods * 2 * np.pi / omega, steps + 1) if t is None else t
    samples = None if solved else exact.reduced_solution(body, basis, load[:, None], 1.0, W, kept).motion(t)
    truth = PreciseModes(M, K, rayleigh, load, W, *(start or ()))
    return Scene(body, basis, load, W, t, samples, np.eye(len(M))[seen], truth, FIFTY_DIGITS, start, options)


def scaled_linkage(factor: float, steps: int = 200) -> Scene:
    """Return the suspension linkage of `factor` times steel's modulus, 12 of 114 coordinates, solved by Exudyn."""
    steel, B, tip = linkage.build()
    beta = steel.rayleigh[1] / np.sqrt(factor)  # the same damping ratios
    options = {"rayleigh": (0.0, beta), "fixed": steel.fixed, "positions": steel.positions}
    body = romerr.ElasticBody(steel.mass, factor * steel.stiffness, **options)
    load, W = linkage.AMPLITUDE * B[:, 0], 2 * np.pi * linkage.FREQUENCY
    truth = exact.full_solution(body, load[:, None], 1.0, W)
    basis, t = romerr.krylov_basis(body, B, 12), np.linspace(0, 2, steps + 1)
    return Scene(body, basis, load, W, t, None, tip.resolve(body)[0], truth, CLOSED_FORM)


def chain(zeta: float = 0.0, by: str = "alpha", N: int = 5, **options: Any) -> Scene:
    """Return a Scene of N masses, the first mode with damping ratio zeta by alpha or beta."""
    omega = 2 * np.sin(np.pi / 2 / (N + 1))
    rayleigh = (2 * zeta * omega, 0.0) if by == "alpha" else (0.0, 2 * zeta / omega)
    return small(bodies.chain(N), rayleigh, **options)


def big_steps(angle: float) -> Scene:
    """Return 60 steps of `angle` rad of the higher of two kept modes, solved by Exudyn."""
    fastest = 2 * np.sin(np.pi / 6)
    return chain(0.02, n=2, t=np.arange(61) * angle / fastest, W=5e-3, solved=True)


def uneven() -> Scene:
    """Return steps of 1e-6 to 1 s, in random order."""
    h = 10 ** np.random.default_rng(0).uniform(-6, 0, 200)
    return chain(0.01, t=np.concatenate([[0.0], np.cumsum(h)]))


def off_the_basis() -> Scene:
    """Return free motion, critically damped, of one mode far faster than the full body in its random state."""
    M, K = bodies.slender_beam(100.0, turned=True)
    x, v = np.linalg.solve(K, M @ np.random.default_rng(1).standard_normal((len(M), 2))).T
    omega = float(romerr.ElasticBody(M, K).modes(1).omega[0])
    speed = 1e3 * omega * np.sqrt(x @ M @ x)
    kept = np.zeros(1), np.full(1, speed)
    return small((M, K), (2 * omega, 0.0), size=0.0, start=(x, omega * v), kept=kept, auxiliary_modes=len(M))


def too_fast() -> str:
    """Return why there is no bound of a rotor that is driven above the lowest frequency of its shaft."""
    scene = floating.rotor(6, h=1e-4, t_end=0.03, speed=2000.0)
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(scene.mbs, flex, outputs=[scene.sensors["rim local"]], scope="inputs frozen")
    scene.solve()
    return monitor.report().reason("auxiliary").split("; ")[1]  # the first part says what it assumes


def clusters(distance: float, m: int) -> Scene:
    """Return clustered modes of which m auxiliary ones cut a cluster."""
    return small(bodies.clustered(distance), (1e-3, 1e-3), auxiliary_modes=m)


def beam(slenderness: float, turned: bool) -> Scene:
    """Return a slender beam loaded at its end across."""
    return small(bodies.slender_beam(slenderness, turned), n=2, at=-4, seen=-4)


def resonant() -> float:
    """Frequency of the second mode of the chain over the first, but for 1e-9."""
    return float(np.sin(np.pi / 6) / np.sin(np.pi / 12)) * (1 + 1e-9)


def multiple(m: int) -> Scene:
    """Return modes that are equal to the last bit, of which m auxiliary ones cut a cluster."""
    return small(bodies.multiple(), at=2, seen=2, auxiliary_modes=m)


def held(hold: float) -> Scene:
    """Return a free body, held by almost nothing, for three periods of its first elastic mode."""
    return small(bodies.almost_free(hold), n=2, periods=6e-6, W=1e6)
