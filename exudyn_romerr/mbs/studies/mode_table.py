"""mode_table: which coordinate of a reduced body is which, what it is worth, and what it does in a run."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...basis.basis import Basis
from ...checks import check_type
from ...errors import InputError, RomErrError
from ...mode_selection.mode_table import (
    MORE,
    Frequencies,
    ModeTable,
    coordinates_of,
    frequencies_of,
    missed_modes,
    residual_share,
)
from ...mode_selection.without_modes import InRun
from ...model.admissible_space import MeanMotion
from ...model.body import ElasticBody
from ..access.reduced_body import ReducedBody
from ..floating.floating_body import FloatingBody
from ..floating.reference_search import (
    find_reference,
    held_body,
    holds,
    motion_of,
    rigid_motions_in,
    still_nodes,
    unmarked,
)

if TYPE_CHECKING:
    from ...report.report import BoundReport

DIRECTIONS = ("displacement x", "displacement y", "displacement z", "rotation x", "rotation y", "rotation z")
# of a mode's largest displacement: what it moves an interface by beside its own direction. In N/m Exudyn's RBE3 modes
# of a wishbone have up to 0.0025 of it, their own direction 0.24 and more
REST = 0.03
STILL = 1e-3  # the same of the interface that holds the frame: Exudyn's RBE3 modes move it by up to 1e-4
SIX = len(DIRECTIONS)
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
    if not moved and (flex.fem.modeBasis or {}).get("type") == "HCBmodes":  # of ComputeHurtyCraigBamptonModes
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
    motions = [(name, motion_of(nodes, weights)) for name, nodes, weights in given]
    return [(name, x) for name, x in motions if x is not None and holds(x.nodes[x.weights > 0], flex.positions)]


def _moves(flex: FloatingBody, V: np.ndarray, motion: MeanMotion) -> np.ndarray:
    """Mean displacements, and rotations times the radius, of nodes by modes (6, n), over the largest of each mode."""
    arms = flex.positions[motion.nodes] - motion.weights @ flex.positions[motion.nodes]
    moves = motion.motion_rows(flex.positions) @ V
    moves[3:] *= np.sqrt(motion.weights @ np.einsum("ij,ij->i", arms, arms))
    return moves / np.abs(V).max(axis=0)


NO_DAMPING = "Damping is not known: the body was not read from its mbs, as a solve does that is watched."
NO_RUN = (
    "What modes do in the run is not known: the report was loaded, or is of a body alone in a frame that it does not "
    "move; romerr modes tells it."
)
EIGENMODE = 1e-6  # of K x - omega^2 M x: what solvers leave of an eigenmode is less


def mode_table(
    flex: FloatingBody | ReducedBody | ElasticBody, report: BoundReport | None = None, *, basis: Basis | None = None
) -> ModeTable:
    """Tell of each coordinate of a reduced body what it is: static mode of which interface and direction, eigenmode.

    Beside it: frequency, damping ratio and effective mass; frequencies of the reduced body with how far they are off
    those of the full one at most; modes that the basis lacks.

    Parameters
    ----------
    flex : FloatingBody, ReducedBody or ElasticBody
        As made by floating_body or add_reduced_body; or a full body, with basis=.
    report : BoundReport, optional
        Of a run of this body in a mechanism: adds shares of the strain energy, and what the error of each sensor
        would grow by without a mode.
    basis : Basis
        Of an ElasticBody.

    Returns
    -------
    ModeTable

    Raises
    ------
    InputError
        No body; a basis that is missing or does not fit; a fem without modes; a report of other bodies.

    Notes
    -----
    Effective mass: of the part of a mode that those before it do not span, so that the sum over a complete basis is
    the body's mass less what its supports carry; free eigenmodes have none. Does not cover: floating bodies whose
    frame follows the modes (excludeRigidBodyMotion=False), which are not compared with the full model.
    """
    if isinstance(flex, FloatingBody):
        return _of_floating(flex, report)
    if isinstance(flex, ReducedBody):
        flex, basis = flex.body, flex.basis
    check_type("flex", flex, ElasticBody)
    check_type("basis", basis, Basis)
    if report is not None:
        raise InputError("report= is for floating bodies; reports of linear ones keep no coordinates of the run")
    return _of_linear(flex, basis)


def _of_linear(body: ElasticBody, basis: Basis) -> ModeTable:
    V, W = basis.restricted_to(body)
    damping = [np.zeros((basis.n, basis.n)) if body.D is None else X.T @ (body.D @ V) for X in (V, W)]
    directions = None
    if body.positions is not None:
        directions = np.tile(np.eye(body.dofs_per_node)[:, :3], (len(body.positions), 1))
    found = coordinates_of(basis.V, body.mass, body.stiffness, damping[0], directions)
    modes, left = frequencies_of(body, V, W, damping[1]), residual_share(body, V, found.omega)
    named = [f"eigenmode at {x / (2 * np.pi):.4g} Hz" for x in found.omega]
    named = [name if x < EIGENMODE else "vector" for name, x in zip(named, left, strict=True)]
    return ModeTable("linear body", named, f"{basis.n} coordinates: {basis.note}", found, modes, None, ())


def _of_floating(flex: FloatingBody, report: BoundReport | None) -> ModeTable:
    numbers, rayleigh = flex.known.get("reduction", (None, (0.0, 0.0)))
    V, D = ((flex.fem.modeBasis or {}).get("matrix"), None) if numbers is None else (numbers[0], numbers[-1])
    if np.shape(V)[:1] != (flex.mass.shape[0],):
        raise InputError(f"fem has no modes of its {flex.mass.shape[0]} coordinates; compute them before mode_table")
    run = None if report is None or report.modes is None else _in_run(flex, report, V)
    modes, notes = None, [NO_DAMPING] if D is None else []
    notes += [NO_RUN] if run is None and report is not None else []
    try:
        modes = _frequencies(flex, V, D, rayleigh, run)
    except RomErrError as error:
        notes.append(f"Not compared with the full model: {str(error).rstrip('.')}.")
    found = coordinates_of(V, flex.mass, flex.stiffness, D, np.tile(np.eye(3), (len(flex.positions), 1)))
    return ModeTable(f"body {flex.number}", *kinds(flex, V), found, modes, run, notes)


def _in_run(flex: FloatingBody, report: BoundReport, V: np.ndarray) -> InRun:
    """What the modes do in the run of a report, of the sensors that it has."""
    found = report.modes.in_run
    own = found.get(flex.number)
    if own is None or len(own.energy) != V.shape[1]:
        raise InputError(
            f"report is of bodies {', '.join(map(str, found))}, not of body {flex.number} with {V.shape[1]} modes"
        )
    return replace(own, sensors={name: x for name, x in own.sensors.items() if name in report.outputs})


def _frequencies(
    flex: FloatingBody, V: np.ndarray, D: np.ndarray | None, rayleigh: tuple[float, float], run: InRun | None
) -> Frequencies:
    """Frequencies of the body as it is held in its frame, by what was found of it in an mbs, if it was read."""
    reference = find_reference(flex, V, flex.known.get("interfaces", {}))
    held = held_body(flex, rayleigh, reference)
    own = held.space.coordinates("V", V if reference.held is None else reference.held)
    found = frequencies_of(held, own, own, D)
    if run is None or not np.any(run.squares):
        return found
    vectors = held.space.coordinates("vectors", run.vectors)
    return replace(found, missed=missed_modes(held, V.shape[1] + MORE, vectors, run.squares))
