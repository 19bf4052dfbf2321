"""Which coordinate of a floating body is what: static mode of which interface and direction, or eigenmode."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...model.admissible_space import MeanMotion, mean_motion
from .reference_search import holds, rigid_motions_in, still_nodes, unmarked

if TYPE_CHECKING:
    from .floating_body import FloatingBody

DIRECTIONS = ("displacement x", "displacement y", "displacement z", "rotation x", "rotation y", "rotation z")
# of a mode's largest displacement: what it moves an interface by beside its own direction. In N/m Exudyn's RBE3 modes
# of a wishbone have up to 0.0025 of it, their own direction 0.24 and more
REST = 0.03
STILL = 1e-3  # the same of the interface that holds the frame: Exudyn's RBE3 modes move it by up to 1e-4
SIX = len(DIRECTIONS)
HCB = "HCBmodes"  # fem.modeBasis["type"] of ComputeHurtyCraigBamptonModes
WHY = (
    "The first interface has none ({}): its 6 would move the body as a rigid one, as the frame does with coordinates "
    "of its own. The frame is fixed to it (excludeRigidBodyMotion=True, Exudyn's default)"
)
NONE_LEFT_OUT = (
    "No interface was left out, so modes move the body as a rigid one, as its frame does, too: compute them with "
    "excludeRigidBodyMotion=True"
)


@dataclass(frozen=True)
class Interface:
    """Nodes that static modes move in one direction each, {coordinate: direction}; name, nodes in words."""

    name: str
    where: str
    modes: dict[int, str]

    def called(self, number: int) -> str:
        """How it is called."""
        return f"interface {number}{self.name and f' ({self.name})'}"


def kinds(flex: FloatingBody, V: np.ndarray) -> tuple[list[str], str]:
    """Return of each coordinate what it is, and why there are so many."""
    found = _interfaces(flex, V)
    held = [one for one in found if not one.modes]
    moved = sorted((one for one in found if one.modes), key=lambda one: min(one.modes))
    first = 2 if held or not rigid_motions_in(V, flex) else 1
    said, n = {}, V.shape[1]
    for number, one in enumerate(moved, first):
        said |= {j: f"static, {one.called(number)}, {way}" for j, way in one.modes.items()}
    if not moved and (flex.fem.modeBasis or {}).get("type") == HCB:
        said = _by_place(n - len(flex.fem.eigenValues), first)
    others = [j for j in range(n) if j not in said]
    said |= {j: f"eigenmode {k}" for k, j in enumerate(others, 1)}
    return [said[j] for j in range(n)], _why(n, len(others), first, moved, held)


def _why(n: int, eigenmodes: int, first: int, moved: list[Interface], held: list[Interface]) -> str:
    """Why there are so many coordinates."""
    static, count = n - eigenmodes, len(moved) or (n - eigenmodes) // SIX
    parts = [f"{static} static modes of {count} interface{'' if count == 1 else 's'}"] if static else []
    parts += [f"{eigenmodes} eigenmode{'' if eigenmodes == 1 else 's'}"] if eigenmodes else []
    said, which = f"{n} coordinates: {' and '.join(parts)}", "interface 1, the first of those given"
    if not static and not held:
        return f"{said}; rigid motions are left out, for the frame has these"
    if held:
        which = f"{held[0].called(1)}: {held[0].where}"
    why = NONE_LEFT_OUT if first == 1 else WHY.format(which)
    return ". ".join([said, why, *(f"I{x.called(k)[1:]}: {x.where}" for k, x in enumerate(moved, first))])


def _by_place(static: int, first: int) -> dict[int, str]:
    """Static modes as ComputeHurtyCraigBamptonModes has them in order, where nothing tells the nodes."""
    return {j: f"static, interface {first + j // SIX}, {DIRECTIONS[j % SIX]} (by its place)" for j in range(static)}


def _interfaces(flex: FloatingBody, V: np.ndarray) -> list[Interface]:
    """Nodes that modes move in one direction each; of those that none moves, those that move least."""
    found: dict[tuple, Interface] = {}
    least, digits = STILL, 4 - math.floor(math.log10(np.ptp(flex.positions, axis=0).max()))
    for name, motion in _candidates(flex, V):
        moves = _moves(flex, V, motion)
        ways, modes = np.nonzero(np.abs(moves) > REST)
        key, largest = tuple(sorted(modes.tolist())), np.abs(moves).max()
        if (
            len(set(ways)) < len(ways)
            or len(set(modes)) < len(modes)
            or (largest >= least if not key else key in found)
        ):
            continue
        least = least if key else largest
        where = ", ".join(f"{round(x, digits) + 0.0:g}" for x in motion.weights @ flex.positions[motion.nodes])
        signs = ("-" if move < 0 else "" for move in moves[ways, modes])
        named = {int(j): f"{sign}{DIRECTIONS[way]}" for way, j, sign in zip(ways, modes, signs, strict=True)}
        found[key] = Interface(name, f"{len(motion.nodes)} nodes about {where}", named)
    return [*found.values()]


def _candidates(flex: FloatingBody, V: np.ndarray) -> list[tuple[str, MeanMotion]]:
    """Node sets of the fem, of markers, and those where exact zeros of modes tell them (RBE2)."""
    sets = getattr(flex.fem, "nodeSets", None) or []
    given = [(repr(x.get("Name", "")), x.get("NodeNumbers", ()), x.get("NodeWeights", ())) for x in sets]
    given += [(name, nodes, ()) for name, nodes, _ in given]
    given += [(name, x.nodes, x.weights) for name, x in flex.known.get("interfaces", {}).items()]
    given += [("", sorted(nodes), ()) for nodes in [*unmarked(flex, V), still_nodes(flex, V).tolist()]]
    return [(name, motion) for name, nodes, weights in given if (motion := _motion(flex, nodes, weights)) is not None]


def _motion(flex: FloatingBody, nodes: Any, weights: Any) -> MeanMotion | None:
    try:
        found = mean_motion(nodes, weights if len(weights) else None)
    except InputError:
        return None
    return found if holds(found.nodes[found.weights > 0], flex.positions) else None


def _moves(flex: FloatingBody, V: np.ndarray, motion: MeanMotion) -> np.ndarray:
    """Mean displacements, and rotations times the radius, of nodes by modes (6, n), over the largest of each mode."""
    arms = flex.positions[motion.nodes] - motion.weights @ flex.positions[motion.nodes]
    moves = motion.motion_rows(flex.positions) @ V
    moves[3:] *= np.sqrt(motion.weights @ np.einsum("ij,ij->i", arms, arms))
    return moves / np.abs(V).max(axis=0)
