"""Unknowns of the march beside the coordinates of the mbs: one place that knows which is where, and how they turn.

Order: of every floating body its frame (dr, dphi), modes, kept vectors; then all other coordinates, of other nodes
with Euler parameters (dr, dphi) too. Oscillators of all bodies stand behind them. Readings have frames of bodies in
these bodies' axes; all else is in global axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .body import Body
from .rotations import (
    along_screw,
    global_rates,
    parameter_rates,
    rotation_matrix,
    times,
    times_transposed,
    turned_parameters,
)


@dataclass(frozen=True)
class TurningNode:
    """A node with Euler parameters: its coordinates in the mbs (7,), reference (7,), where its six unknowns begin.

    is_frame : of a floating body, whose axes readings have.
    """

    own: np.ndarray
    reference: np.ndarray
    at: int
    is_frame: bool

    def parameters(self, q: np.ndarray) -> np.ndarray:
        """Return its Euler parameters (..., 4)."""
        return self.reference[3:] + q[..., self.own[3:]]

    @property
    def shifts_and_turns(self) -> tuple[slice, slice]:
        """Its unknowns dr, and dphi."""
        return slice(self.at, self.at + 3), slice(self.at + 3, self.at + 6)


class Unknowns:
    """Sizes: n_q coordinates of the mbs, n_a unknowns, m oscillators, in all n = n_a + m.

    blocks, waves : slices of each body's unknowns and oscillators. plain : (coordinates, unknowns) that are the same.
    kept : unknowns of kept vectors, which the mbs of the run does not have; own : all others. nodes : with Euler
    parameters, those of bodies first. turns : unknowns of their rotations.
    """

    def __init__(self, bodies: Sequence[Body], others: Sequence[tuple[np.ndarray, np.ndarray | None]], n_q: int):
        """Lay out unknowns.

        Parameters
        ----------
        others : of every other node its coordinates, and its reference (7,) where these are Euler parameters
        """
        self.bodies, self.n_q = list(bodies), n_q
        self.nodes: list[TurningNode] = []
        self.blocks, self.waves = [], []
        own, at, kept, first = [], [], [], 0
        for body in bodies:
            self.nodes.append(TurningNode(body.place.frame, body.place.reference, first, True))
            self.blocks.append(slice(first, first + 6 + body.na))
            own += [*body.place.modal]
            at += range(first + 6, first + 6 + body.n)
            kept += range(first + 6 + body.n, first + 6 + body.na)
            first += 6 + body.na
        for mine, reference in others:
            if reference is not None:
                self.nodes.append(TurningNode(mine, reference, first, False))
                first += 6
            else:
                own += [*mine]
                at += range(first, first + len(mine))
                first += len(mine)
        self.n_a, self.plain = first, (np.array(own, int), np.array(at, int))
        self.kept = np.array(kept, int)
        self.own = np.setdiff1d(np.arange(first), self.kept)
        for body in bodies:
            self.waves.append(slice(first, first + body.m))
            first += body.m
        self.n = first
        self.turns = np.array([i for node in self.nodes for i in range(node.at + 3, node.at + 6)], int)

    def of_vectors(self) -> list[list[int]]:
        """Return of each body its unknowns of vectors: kept ones, oscillators."""
        parts = zip(self.bodies, self.blocks, self.waves, strict=True)
        return [[*range(at.start + 6 + b.n, at.stop), *range(wave.start, wave.stop)] for b, at, wave in parts]

    @property
    def largest_size(self) -> float:
        """Of the largest body, m."""
        return max(body.size for body in self.bodies)

    def steps(self, share: float) -> np.ndarray:
        """Return finite motions (n,): turns by `share` rad, all else what moves nodes by that share of their body."""
        found = np.full(self.n, share * self.largest_size)
        found[self.turns] = share
        for body, block, wave in zip(self.bodies, self.blocks, self.waves, strict=True):
            found[block.start + 6 : block.stop] = share * body.size / body.largest[: body.na]
            found[wave] = share * body.size / body.largest[body.na :]
        return found

    def jacobians(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return J, J', J'' (3, ..., n_q, n_a): dq = J z of unknowns z in axes of bodies, with rates in global."""
        J = np.zeros((3, *q.shape[:-1], self.n_q, self.n_a))
        own, at = self.plain
        J[0][..., own, at] = 1.0
        for node in self.nodes:
            p, (dr, dphi) = node.parameters(q), node.shifts_and_turns
            A = rotation_matrix(p) if node.is_frame else np.eye(3)
            J[0][..., node.own[:3], dr] = A
            for part, x in zip(J, (p, v[..., node.own[3:]], a[..., node.own[3:]]), strict=True):
                part[..., node.own[3:], dphi] = parameter_rates(x) @ A
        return J

    def inverses(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return H, H', H'' (3, ..., n_a, n_q): z = H dq in global axes."""
        H = np.zeros((3, *q.shape[:-1], self.n_a, self.n_q))
        own, at = self.plain
        H[0][..., at, own] = 1.0
        for node in self.nodes:
            p, (dr, dphi) = node.parameters(q), node.shifts_and_turns
            H[0][..., dr, node.own[:3]] = np.eye(3)
            for part, x in zip(H, (p, v[..., node.own[3:]], a[..., node.own[3:]]), strict=True):
                part[..., dphi, node.own[3:]] = global_rates(x)
        return H

    def in_body_axes(self, z: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return unknowns z (..., n or n_a) with frames of bodies turned from global axes into the bodies'."""
        return self._turned(z, q, times_transposed)

    def in_global_axes(self, z: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return unknowns, or forces on them, turned back."""
        return self._turned(z, q, times)

    def _turned(self, z: np.ndarray, q: np.ndarray, turn: object) -> np.ndarray:
        z = z.copy()
        for node in self.nodes:
            if node.is_frame:
                A = rotation_matrix(node.parameters(q))
                for part in node.shifts_and_turns:
                    z[..., part] = turn(A, z[..., part])
        return z

    def moved(self, states: Sequence[np.ndarray], z: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return states q, q', ... (..., n_q) moved by finite unknowns z, z', ... (..., n_a) in global axes.

        Frames move along the screw of their dr and dphi, as bodies do in Motion.moved.
        """
        moved = [x.copy() for x in states]
        own, at = self.plain
        for x, y in zip(moved, z, strict=True):
            x[..., own] += y[..., at]
        for node in self.nodes:
            place, turn = node.own[:3], node.own[3:]
            shift, phi = ([y[..., part] for y in z] for part in node.shifts_and_turns)
            p = [node.parameters(states[0]), *(x[..., turn] for x in states[1:])]
            turned = turned_parameters(p, phi)
            for x, before, there, by in zip(moved, p, turned, along_screw(phi, shift), strict=True):
                x[..., place] += by
                x[..., turn] += there - before
        return moved
