"""Unknowns of the march beside the coordinates of the mbs: one place that knows which is where, and how they turn.

Order: of every floating body its frame (dr, dphi), modes, kept vectors; then all other coordinates, of other nodes
with Euler parameters (dr, dphi) too. Oscillators of all bodies stand behind them. Readings have frames of bodies in
these bodies' axes; all else is in global axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

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
    """Sizes: n_q coordinates of the mbs, n_1 of them of first order, n_a unknowns, m oscillators, n = n_a + m in all.

    blocks, waves : slices of each body's unknowns and oscillators. plain : slices of (coordinates, unknowns) that are
    the same, but for units. kept : unknowns of kept vectors, which the mbs of the run does not have; own : all
    others. nodes : with Euler parameters, those of bodies first. turns : unknowns of their rotations. first_order :
    unknowns whose rates are coordinates of first order; speed : these rates at the largest of these coordinates.
    """

    def __init__(
        self,
        bodies: Sequence[Body],
        others: Sequence[tuple[np.ndarray, np.ndarray | None]],
        n_q: int,
        first_order: np.ndarray | None = None,
        duration: float = 1.0,
    ):
        """Lay out unknowns.

        Parameters
        ----------
        others : of every other node its coordinates, and its reference (7,) where these are Euler parameters
        first_order : the largest of each coordinate of first order, which Rows have last; n_q : without these
        duration : of the run, s
        """
        largest = np.zeros(0) if first_order is None else first_order
        self.n_1 = len(largest)
        others, n_q = [*others, (n_q + np.arange(self.n_1), None)], n_q + self.n_1
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
        self.n_a, self.plain = first, _runs(np.array(own, int), np.array(at, int))
        self.kept = np.array(kept, int)
        self.own = np.setdiff1d(np.arange(first), self.kept)
        for body in bodies:
            self.waves.append(slice(first, first + body.m))
            first += body.m
        self.n = first
        self.first_order = slice(self.n_a - self.n_1, self.n_a)
        self.speed, self.units = 0.0, np.ones(n_q)
        if self.n_1:  # while others move by a body's size along the run, these come to their largest
            self.speed = self.largest_size / duration
            self.units[n_q - self.n_1 :] = np.where(largest > 0, largest, 1.0) / self.speed
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
        for own, at in self.plain:
            J[0][..., own, at] = np.diag(self.units[own])
        for node in self.nodes:
            p, (dr, dphi) = node.parameters(q), node.shifts_and_turns
            A = rotation_matrix(p) if node.is_frame else np.eye(3)
            J[0][..., node.own[:3], dr] = A
            for part, x in zip(J, (p, v[..., node.own[3:]], a[..., node.own[3:]]), strict=True):
                part[..., node.own[3:], dphi] = parameter_rates(x) @ A
        return J

    def by_unknowns(self, X: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return X J (T, r, n_a) of X (T, r, n_q) in states q (T, n_q); J as `jacobians` has it, zero of vectors."""
        found = np.zeros((*X.shape[:-1], self.n_a))
        for own, at in self.plain:
            found[..., at] = X[..., own] * self.units[own]
        for node in self.nodes:
            p, (dr, dphi) = node.parameters(q), node.shifts_and_turns
            A = rotation_matrix(p) if node.is_frame else np.eye(3)
            found[..., dr] = X[..., node.own[:3]] @ A
            found[..., dphi] = X[..., node.own[3:]] @ (parameter_rates(p) @ A)
        return found

    def by_coordinates(self, X: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Return X H (T, r, n_q) of X (T, r, n_a or n): unknowns z = H dq in global axes, zero of vectors."""
        found = np.zeros((*X.shape[:-1], self.n_q))
        for own, at in self.plain:
            found[..., own] = X[..., at] / self.units[own]
        for node in self.nodes:
            dr, dphi = node.shifts_and_turns
            found[..., node.own[:3]] = X[..., dr]
            found[..., node.own[3:]] = X[..., dphi] @ global_rates(node.parameters(q))
        return found

    def of_coordinates(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, e: np.ndarray) -> np.ndarray:
        """Return e (T, 3, n_q, columns), with rates, in unknowns (T, 3, n, columns) in global axes; no vectors."""
        z = np.zeros((*e.shape[:2], self.n, e.shape[3]))
        for own, at in self.plain:
            z[:, :, at] = e[:, :, own] / self.units[own, None]
        for node in self.nodes:
            dr, dphi = node.shifts_and_turns
            z[:, :, dr] = e[:, :, node.own[:3]]
            H = [global_rates(x) for x in (node.parameters(q), v[:, node.own[3:]], a[:, node.own[3:]])]
            d = e[:, :, node.own[3:]]
            for order in range(3):
                z[:, order, dphi] = sum(comb(order, k) * (H[k] @ d[:, order - k]) for k in range(order + 1))
        return z

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
        for x, y in zip(moved, z, strict=True):
            for own, at in self.plain:
                x[..., own] += y[..., at] * self.units[own]
        for node in self.nodes:
            place, turn = node.own[:3], node.own[3:]
            shift, phi = ([y[..., part] for y in z] for part in node.shifts_and_turns)
            p = [node.parameters(states[0]), *(x[..., turn] for x in states[1:])]
            turned = turned_parameters(p, phi)
            for x, before, there, by in zip(moved, p, turned, along_screw(phi, shift), strict=True):
                x[..., place] += by
                x[..., turn] += there - before
        return moved


def _runs(own: np.ndarray, at: np.ndarray) -> list[tuple[slice, slice]]:
    """Slices of two arrays of numbers, in each of which both count up by one."""
    breaks = np.flatnonzero((np.diff(own) != 1) | (np.diff(at) != 1)) + 1
    pairs = zip(np.split(own, breaks), np.split(at, breaks), strict=True)
    return [(slice(x[0], x[-1] + 1), slice(y[0], y[-1] + 1)) for x, y in pairs if len(x)]
