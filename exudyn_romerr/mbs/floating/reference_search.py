"""Which reference conditions hold a floating body in its frame: candidates tried against its modes (theory.md 7)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ...basis.enrichment import Enrichment
from ...errors import AssumptionError, InputError, RomErrError
from ...linalg.orthogonalise import m_orthonormal
from ...linear.residual.interface_stiffening import with_rigid_interfaces
from ...model.admissible_space import (
    HELD,
    MassOrthogonal,
    MeanMotion,
    Space,
    mean_motion,
    rigid_modes,
    rigid_parts,
)
from ...model.floating_frame import unit_inertia
from ...model.shared_body import keep_with, shared_body
from ..access.mbs_items import Items
from .built_in import as_built_in
from .floating_body import read_object
from .frame_node import RigidPart
from .loads_and_joints import read_actions

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...model.body import ElasticBody
    from .floating_body import FloatingBody, ReducedMatrices
    from .loads_and_joints import Actions

MASS_ORTHOGONAL = "rigid motions, M-orthogonal"
OF_THE_FRAME = (
    "modes: up to {:.1e} of one (mass norm) moves the body as a rigid one, which is taken for motion of its frame to "
    "first order"
)
CURE = (
    "name those that the modes were made with, nodes and weights of the interface that holds them: "
    "floating_body(fem, items, reference=romerr.mean_motion(nodes, weights))"
)
CONTAINED = 1e-4  # of a rigid motion in the mass norm: less than this is not made by the modes, so they make it
WITHOUT_RIGID = (
    "modes can move the body as a rigid one, in {} of 6 ways, as its frame does: no conditions hold it then. Compute "
    "them without: excludeRigidBodyMotion=True (the default) in fem.ComputeHurtyCraigBamptonModes, "
    "excludeRigidBodyModes=6 in fem.ComputeEigenmodes"
)
# |Rg T_j|_M of a mode over that of the mode: what Exudyn's solvers leave is 1e-6 to 1e-3. Modes that other conditions
# hold have 0.3 and more of it, and their frame is not that of the conditions at hand
SMALL = 0.03
VECTORS = 26  # static ones of a body, beside those that deform rigid interfaces


@dataclass(frozen=True, eq=False)
class SeenBody:
    """What an mbs has of a floating body now.

    model : reduced matrices, held by reference conditions. actions : what acts on it, and does work. idle : markers
    that the conditions hold still. held : the full body, held.
    """

    flex: FloatingBody
    model: ReducedMatrices
    actions: Actions
    idle: set[int]
    reference: Reference
    held: ElasticBody

    @cached_property
    def stiff(self) -> Space | None:
        """Space of interfaces that the modes make rigid, or None."""
        return stiff_space(self.flex, self.model.V, self.actions.interfaces())

    @property
    def basis(self) -> str:
        """The line of a plan that says how it is reduced."""
        N, n = self.model.V.shape
        return f"basis: {n} modes of object {self.flex.number}, in place of {N:,} coordinates"

    def forces(self) -> tuple[np.ndarray, np.ndarray]:
        """Columns (n_free, w) of wrenches, (n_free, p) of loads."""
        none = np.zeros((self.held.N, 0))
        wrenches, loads = ([none, *(x.columns for x in of)] for of in (self.actions.wrenches, self.actions.loads))
        return self.held.space.loads(np.hstack(wrenches)), self.held.space.loads(np.hstack(loads))

    def enrichment(self, count: int) -> tuple[Enrichment, bool]:
        """Return what the modes miss most: `count` vectors at most, those that deform rigid interfaces not counted.

        And whether they leave interfaces where they are; where modes cannot move these one by one vectors do.
        """
        Z, (wrenches, loads) = self.held.space, self.forces()
        V, inertia = Z.coordinates("V", self.model.held), Z.loads(unit_inertia(self.flex.mass, self.flex.positions))
        rigid = None if self.stiff is None else with_rigid_interfaces(self.held, self.stiff)
        of = self.held, V, inertia
        most = min(count, len(V) - V.shape[1]), rigid
        try:
            return Enrichment(*of, loads, wrenches, *most), True
        except AssumptionError:
            return Enrichment(*of, np.hstack([loads, wrenches]), wrenches[:, :0], *most), False


def seen_body(
    mbs: Any, flex: FloatingBody, load_factor: Callable[[float], float] | None = None
) -> tuple[SeenBody, Items]:
    """Read a body, and all items of its mbs; load_factor : what a static solver scales constant loads with."""
    mbs = as_built_in(mbs, [flex])
    items, model = Items(mbs), read_object(mbs, flex)
    actions = read_actions(items, flex, model, load_factor)
    flex.known["interfaces"] = interfaces = actions.interfaces()
    reference = find_reference(flex, model.V, interfaces)
    held = held_body(flex, model.rayleigh, reference)
    return SeenBody(flex, reference.of(model), actions, actions.drop_idle(held), reference, held), items


@dataclass(frozen=True)
class Reference:
    """Conditions found: `conditions` for ElasticBody, or coordinates `fixed` and parts `rigid`; their source.

    held (N, n) : the modes without what they move in spite of the conditions, `moves` (6, n) of Rg moves; share : the
    size of that. None: the conditions hold the modes as they are.
    """

    conditions: MeanMotion | MassOrthogonal | None
    source: str
    fixed: tuple[int, ...] = ()
    rigid: tuple[tuple[int, ...], ...] = ()
    held: np.ndarray | None = None
    moves: np.ndarray | None = None
    share: float = 0.0

    def of(self, model: ReducedMatrices) -> ReducedMatrices:
        """Return the body as it is in the mbs, with the modes that the conditions hold and what is beside them."""
        if self.moves is None:
            return replace(model, held=model.V)
        return replace(model, held=self.held, rigid=RigidPart(self.moves, self.share, model.rayleigh[0]))

    @property
    def lines(self) -> tuple[str, ...]:
        """Lines of the plan."""
        found = f"floating body: held in its frame by {self.source}"
        return (found,) if self.moves is None else (found, OF_THE_FRAME.format(self.share))


def find_reference(flex: FloatingBody, V: np.ndarray, interfaces: dict[str, MeanMotion]) -> Reference:
    """Return the conditions that every mode meets, found before if they are those of the same interfaces.

    Parameters
    ----------
    interfaces : dict
        Where markers act: name -> nodes and weights. They come first, since a wrench on the reference does no work.

    Raises
    ------
    InputError
        reference= was given and the modes do not meet it.
    AssumptionError
        No candidate fits, or several that differ.
    """
    its_interfaces, its_V, found = flex.known.get("reference", ({}, V, None))
    same = [*its_interfaces] == [*interfaces] and all(its_interfaces[x] is interfaces[x] for x in interfaces)
    if found is None or not same or not np.array_equal(its_V, V):
        found = _search(flex, V, interfaces)
        if found.source in interfaces:  # else node sets, or modes, decided
            flex.known["reference"] = interfaces, V, found
    return found


def _search(flex: FloatingBody, V: np.ndarray, interfaces: dict[str, MeanMotion]) -> Reference:
    if flex.interfaces == "rigid":
        return _rigid_interfaces(flex, V, [set(motion.nodes.tolist()) for motion in interfaces.values()])
    if flex.reference is not None:
        off, found = _misfit(flex.reference, flex, V), Reference(flex.reference, "reference= of floating_body")
        if off > HELD:
            found = _nearly(found, flex, V) if np.isfinite(off) else replace(found, share=np.inf)
        if found.share > SMALL:
            raise InputError(
                f"reference= does not fit the modes: {found.share:.1e} of one is rigid motion that it does not hold; "
                f"allowed {SMALL:g}; {_cure(flex, V)}"
            )
        return found
    tried, groups = {}, (interfaces, _node_sets(flex.fem), {MASS_ORTHOGONAL: MassOrthogonal()})
    for candidates in groups:
        tried |= {name: _misfit(candidate, flex, V) for name, candidate in candidates.items()}
        fits = {name: candidate for name, candidate in candidates.items() if tried[name] <= HELD}
        if fits:
            return _the_only(fits, flex)
    still = still_nodes(flex, V)
    if holds(still, flex.positions):
        return Reference(None, f"{still.size} nodes that no mode moves", _coordinates(still))
    known = (Reference(x, name) for group in groups for name, x in group.items() if np.isfinite(tried[name]))
    near = [_nearly(reference, flex, V) for reference in known]
    best = min(near, key=lambda found: found.share, default=None)
    if best is not None and best.share <= SMALL:
        return best
    shares = ", ".join(f"{found.source} {found.share:.1e}" for found in near)
    raise AssumptionError(
        "no reference conditions fit the modes, so the body's place in its frame is not known; tried (largest share "
        f"of a mode that is rigid motion in spite of them, allowed {SMALL:g}): {shares}; {_cure(flex, V)}"
    )


def _cure(flex: FloatingBody, V: np.ndarray) -> str:
    """What to do where no conditions fit: others help only if the modes do not make rigid motions themselves."""
    count = rigid_motions_in(V, flex)
    return WITHOUT_RIGID.format(count) if count else CURE


def rigid_motions_in(V: np.ndarray, flex: FloatingBody) -> int:
    """How many rigid motions are combinations of the modes."""
    motions, moved = (m_orthonormal(flex.mass, x) for x in (rigid_modes(flex.positions), V))
    inside = np.linalg.svd(motions.T @ (flex.mass @ moved), compute_uv=False)
    return int(np.count_nonzero(1.0 - inside**2 < CONTAINED**2))


def _nearly(reference: Reference, flex: FloatingBody, V: np.ndarray) -> Reference:
    """Take from the modes the rigid motion that conditions do not hold; inf: nothing else is left of one."""
    C, Rg = reference.conditions.rows(flex.positions, flex.mass), rigid_modes(flex.positions)
    moves, held = np.zeros((6, V.shape[1])), V
    for _ in range(2):  # once more, for what rounding left
        more = np.linalg.solve(C @ Rg, C @ held)
        moves, held = moves + more, held - Rg @ more
    rigid, whole = (np.sqrt(np.einsum("ij,ij->j", x, flex.mass @ x)) for x in (Rg @ moves, V))
    return replace(reference, held=held, moves=moves, share=float(np.max(rigid / whole)))


def held_body(flex: FloatingBody, rayleigh: tuple[float, float], reference: Reference) -> ElasticBody:
    """Return the full body, held in its frame by the conditions."""
    held = reference.fixed, reference.rigid, reference.conditions
    body = shared_body(flex.mass, flex.stiffness, flex.positions, rayleigh, *held, flex.modal_damping)
    keep_with(flex.fem, body)
    return body


def require_still_interface(flex: FloatingBody, V: np.ndarray) -> np.ndarray:
    """Return the nodes that no mode moves; AssumptionError unless they hold the body, as RBE2 modes do."""
    still = still_nodes(flex, V)
    if flex.reference is not None or not holds(still, flex.positions):
        raise AssumptionError(
            f"interfaces='rigid' is for RBE2 modes, which leave the nodes of one interface still; found {still.size} "
            "still nodes; use interfaces='free'"
        )
    return still


def _rigid_interfaces(flex: FloatingBody, V: np.ndarray, interfaces: list[set[int]]) -> Reference:
    """The model of RBE2 modes: nodes that no mode moves are fixed, those of all other interfaces rigid."""
    still = require_still_interface(flex, V)
    moving = [nodes for nodes in interfaces if not np.isin(list(nodes), still).all()]
    rigid = [part for part in _merged(moving) if _is_rigid(list(part), flex.positions, V)]
    text = f"{still.size} nodes that no mode moves, {len(rigid)} rigid interfaces"
    return Reference(None, text, _coordinates(still), tuple(rigid))


def stiff_space(flex: FloatingBody, V: np.ndarray, interfaces: dict[str, MeanMotion]) -> Space | None:
    """Return the coordinates of the body whose interfaces are as rigid as RBE2 modes make them.

    None if the truth has rigid interfaces too, or if the modes are of another kind. Interfaces of fewer than three
    nodes do not count: modes cannot make them rigid. Those without a marker are found by modes that vanish there.
    """
    if flex.interfaces == "rigid" or flex.reference is not None or not holds(still_nodes(flex, V), flex.positions):
        return None
    wide = [set(motion.nodes.tolist()) for motion in interfaces.values() if holds(motion.nodes, flex.positions)]
    found = _rigid_interfaces(flex, V, wide + unmarked(flex, V))
    fixed = np.array(found.fixed)
    return Space(len(V), fixed, None, rigid_parts(found.rigid, fixed, flex.positions) if found.rigid else ())


def unmarked(flex: FloatingBody, V: np.ndarray) -> list[set[int]]:
    """Nodes at which the same modes vanish, not all: fixed-interface eigenmodes and static modes of other interfaces.

    Exact zeros, which Exudyn's modes have there; whether such nodes move as one rigid body is not looked at.
    """
    vanish = ~V.reshape(len(flex.positions), 3, -1).any(axis=1)
    vanish[vanish.all(axis=1)] = False
    kinds = np.unique(vanish[vanish.any(axis=1)], axis=0)
    # rotations vanish on their axes, too: some nodes have more zeros than the others of their interface
    groups = (np.flatnonzero((vanish | ~kind).all(axis=1)) for kind in kinds)
    return [set(nodes.tolist()) for nodes in groups if holds(nodes, flex.positions)]


def _merged(sets: list[set[int]]) -> list[tuple[int, ...]]:
    """Node sets of interfaces; those that share nodes are one."""
    merged: list[set[int]] = []
    for nodes in sets:
        touching = [other for other in merged if other & nodes]
        merged = [other for other in merged if not other & nodes] + [nodes.union(*touching)]
    return sorted(tuple(sorted(nodes)) for nodes in merged)


def still_nodes(flex: FloatingBody, V: np.ndarray) -> np.ndarray:
    return np.flatnonzero(~V.reshape(len(flex.positions), -1).any(axis=1))


def _coordinates(nodes: np.ndarray) -> tuple[int, ...]:
    return tuple((3 * nodes[:, None] + np.arange(3)).ravel().tolist())


def _is_rigid(nodes: list[int], positions: np.ndarray, V: np.ndarray) -> bool:
    """Whether all modes move the nodes as one rigid body."""
    motions = np.linalg.qr(rigid_modes(positions[nodes] - positions[nodes].mean(axis=0)))[0]
    part = V.reshape(len(positions), 3, -1)[nodes].reshape(3 * len(nodes), -1)
    return bool(np.max(np.abs(part - motions @ (motions.T @ part))) <= HELD * np.max(np.abs(V)))


def _misfit(candidate: Any, flex: FloatingBody, V: np.ndarray) -> float:
    """|C V| over |C| |V|, largest over conditions and modes; inf if C leaves a rigid motion."""
    try:
        C = candidate.rows(flex.positions, flex.mass)
    except RomErrError:
        return np.inf
    held = C @ rigid_modes(flex.positions - flex.positions.mean(axis=0))
    length = np.linalg.norm(held, axis=1)
    if (
        not length.all()
        or np.linalg.cond(held / length[:, None] / np.linalg.norm(held / length[:, None], axis=0)) > 1e10
    ):
        return np.inf
    size = np.outer(np.linalg.norm(C, axis=1), np.linalg.norm(V, axis=0))
    return float(np.max(np.abs(C @ V) / size))


def _node_sets(fem: Any) -> dict[str, MeanMotion]:
    """Node sets of the fem of at least three nodes, with their weights."""
    found = {
        f"node set {entry.get('Name', '')!r}": motion_of(entry.get("NodeNumbers", ()), entry.get("NodeWeights", ()))
        for entry in getattr(fem, "nodeSets", None) or []
        if len(entry.get("NodeNumbers", ())) >= 3
    }
    return {name: motion for name, motion in found.items() if motion is not None}


def motion_of(nodes: Any, weights: Any) -> MeanMotion | None:
    """Return the mean motion of nodes with weights, which are equal where none are given; None: it is none."""
    try:
        return mean_motion(nodes, weights if len(weights) else None)
    except InputError:
        return None


def _the_only(fits: dict[str, Any], flex: FloatingBody) -> Reference:
    """The one candidate that fits; several must be the same conditions."""
    (name, first), *others = fits.items()
    rows = first.rows(flex.positions, flex.mass)
    differing = [other for other, c in others if not _same_space(rows, c.rows(flex.positions, flex.mass))]
    if differing:
        raise AssumptionError(
            f"the modes fit several reference conditions that differ: {', '.join([name, *differing])}; {CURE}"
        )
    return Reference(first, name)


def _same_space(C: np.ndarray, other: np.ndarray) -> bool:
    Q = np.linalg.qr((C / np.linalg.norm(C, axis=1)[:, None]).T)[0]
    other = other / np.linalg.norm(other, axis=1)[:, None]
    return bool(np.max(np.abs(other - (other @ Q) @ Q.T)) < HELD)


def holds(nodes: np.ndarray, positions: np.ndarray) -> bool:
    if nodes.size < 3:
        return False
    arms = positions[nodes] - positions[nodes].mean(axis=0)
    lengths = np.linalg.svd(arms, compute_uv=False)
    return bool(lengths[1] > HELD * lengths[0])
