"""Outputs y = C q (or C q'), how they are seen in global axes, and makers of the usual ones at nodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..checks import check_array, check_choice, check_nodes, real_array
from ..errors import InputError
from .admissible_space import mean_motion
from .body import ElasticBody
from .floating_frame import FrameMotion, FramePose, skew
from .solid_elements import STRAINS, strain_rows

AXES = "xyz"


@dataclass(frozen=True)
class Output:
    """A named linear output of a body.

    Parameters
    ----------
    name : str
        Unique among the outputs of a report.
    rows : ndarray, (N,) or (r, N); or callable body -> such rows
        Rows of C. A callable is resolved by attach / evaluate, which know the body.
    unit : str
        Printed beside values; the code itself is unit-free, and what is in which unit nobody knows but the user.
    of : {"displacement", "velocity", "position"}
        y = C q or y = C q'; in global axes also y = C (x + q).
    frame : {"body", "global"}
        Axes of y. "global", floating bodies only: rows are vectors, three rows each in body axes; the output is what
        an observer at rest sees of them, the motion of the frame included.
    axes : str
        Which components of each vector an output in global axes shows.
    labels : tuple of str
        Names of its rows, as they are shown; () for "row 1", "row 2", ...
    quantity : str
        What it shows, "displacement", "velocity", "position", "rotation", "strain", "stress", where that is known: a
        unit of length that is given for all outputs is that of some of these, see report/data.py. "": not known.
    """

    name: str
    rows: Any
    unit: str = ""
    of: str = "displacement"
    frame: str = "body"
    axes: str = AXES
    labels: tuple[str, ...] = ()
    quantity: str = ""
    is_requested: ClassVar[bool] = True  # by the user: it is in reports, and decides on the number of auxiliary modes

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise InputError(f"name={self.name!r} of an Output; needed: a non-empty string")
        if not isinstance(self.unit, str):
            raise InputError(f"unit={self.unit!r} of output {self.name!r}; needed: a string, such as 'm'")
        known = ("displacement", "velocity", *(("position",) if self.frame == "global" else ()))
        check_choice(f"of (output {self.name!r})", self.of, known)
        check_choice(f"frame (output {self.name!r})", self.frame, ("body", "global"))

    def resolve(self, body: ElasticBody) -> np.ndarray:
        """Return the rows as (r, N) for this body; InputError if the width is wrong or an entry not finite."""
        name = f"rows of output {self.name!r}"
        rows = real_array(name, self.rows(body) if callable(self.rows) else self.rows)
        rows = check_array(name, np.atleast_2d(rows), (None, body.N))
        if self.frame == "global" and len(rows) % 3:
            raise InputError(f"{name} are {len(rows)}; in global axes they are vectors, three rows each")
        shown = len(rows) if self.frame == "body" else len(rows) // 3 * len(self.axes)
        if len(self.labels) not in (0, shown):
            raise InputError(f"labels={self.labels!r} of output {self.name!r}; it has {shown} rows, each needs one")
        return rows

    def view(self, body: ElasticBody) -> View | None:
        """Return how the output is seen from outside the frame; None in body axes."""
        if self.frame == "body":
            return None
        if body.positions is None:
            raise InputError(f"output {self.name!r} is in global axes; the body has no node positions")
        rows, nodes = self.resolve(body), len(body.positions)
        places = (rows @ body.positions.ravel()).reshape(-1, 3)
        shift = (rows @ np.tile(np.eye(3), (nodes, 1))).reshape(-1, 3, 3)[:, 0, 0]
        return View(tuple(AXES.index(a) for a in self.axes), places, shift, self.of)

    def constant(self, body: ElasticBody, joint: bool = False) -> np.ndarray | float:
        """Return C2 with |C e|_i <= C2_i |e|_M, shape (r,); joint: the one constant of |C e|_2 <= C2 |e|_M.

        C2_i = sqrt(c_i M^-1 c_i^T), paper (27)-(30); joint: largest singular value of C M^-1/2, (28).
        """
        C = body.space.rows(self.resolve(body))
        gram = C @ body.mass_factor.solve(C.T)
        return float(np.sqrt(np.linalg.eigvalsh(gram)[-1])) if joint else np.sqrt(np.diag(gram))


@dataclass(frozen=True)
class View:
    """Vectors C q of k places, seen in global axes: A C q, and A (C q' + w~ C q) of velocities.

    Values include what the frame itself moves the places: A C (x + u) + s r, less the same in the reference pose
    (displacement) or not (position).

    Attributes
    ----------
    axes : components (0, 1, 2) of each vector that the output shows. blind : whether all of its error is the frame's,
    of which nothing is known: bounds are inf.
    places : (k, 3) C x; shift : (k,) s, C of a unit translation. of : "displacement", "velocity", "position".
    """

    axes: tuple[int, ...]
    places: np.ndarray
    shift: np.ndarray
    of: str
    blind: bool = False

    def matrices(self, frame: np.ndarray) -> np.ndarray:
        """Return H (S, r, R) with output = H (rows in body axes); velocities see the displacement rows first."""
        rows, count = FrameMotion.of(frame), len(self.places)
        parts = [rows.A @ skew(rows.w), rows.A] if self.of == "velocity" else [rows.A]
        wide = [np.einsum("kl,sij->skilj", np.eye(count), part[:, list(self.axes)]) for part in parts]
        return np.concatenate([part.reshape(len(frame), count * len(self.axes), 3 * count) for part in wide], axis=2)

    def values(self, base: np.ndarray, frame: np.ndarray, pose: FramePose) -> np.ndarray:
        """Return the output (S, r) of the base rows' values (S, R)."""
        rows = FrameMotion.of(frame)
        turn, shift = {
            "displacement": (rows.A - pose.A, rows.r - pose.r),
            "position": (rows.A, rows.r),
            "velocity": (rows.A @ skew(rows.w), rows.r_t),
        }[self.of]
        carried = np.einsum("sij,kj->ski", turn, self.places) + self.shift[:, None] * shift[:, None]
        own = np.einsum("srk,sk->sr", self.matrices(frame), base)
        return own + carried[:, :, list(self.axes)].reshape(len(frame), -1)


class InternalOutput(Output):
    """An output beside those that were asked for: "auto" chooses auxiliary modes without it."""

    is_requested: ClassVar[bool] = False


def node_displacement(name: str, *, node: int, component: str = "xyz", unit: str = "", frame: str = "body") -> Output:
    """Displacement of one node; component: letters out of "xyz", one row each; frame: "body" or "global" axes.

    Raises (when resolved)
    ----------------------
    InputError
        Body without node positions, node out of range, unknown component.
    """
    return nodes_output(name, [node], None, component, unit, "displacement", frame)


def node_velocity(name: str, *, node: int, component: str = "xyz", unit: str = "", frame: str = "body") -> Output:
    """Velocity of one node; see node_displacement."""
    return nodes_output(name, [node], None, component, unit, "velocity", frame)


def node_rotation(name: str, *, node: int, component: str = "xyz", unit: str = "rad") -> Output:
    """Rotation of a node that has rotational coordinates (6 a node); solids have none: use several nodes."""
    return Output(name, _node_rows([node], None, component, 3), unit, labels=tuple(component), quantity="rotation")


def mean_displacement(
    name: str,
    *,
    nodes: ArrayLike,
    weights: ArrayLike | None = None,
    component: str = "xyz",
    unit: str = "",
    frame: str = "body",
) -> Output:
    """Weighted mean displacement of several nodes (weights are scaled to sum 1; default: equal)."""
    return nodes_output(name, nodes, weights, component, unit, "displacement", frame)


def mean_rotation(
    name: str,
    *,
    nodes: ArrayLike,
    weights: ArrayLike | None = None,
    component: str = "xyz",
    unit: str = "rad",
) -> Output:
    """Weighted mean rotation of several nodes of a solid in body axes, as MarkerSuperElementRigid takes it."""
    axes = _checked_axes(component)

    def rows(body: ElasticBody) -> np.ndarray:
        if body.dofs_per_node != 3:
            raise InputError("mean_rotation is for solids (3 coordinates a node); use node_rotation")
        check_nodes(nodes, len(body.positions))
        return mean_motion(nodes, weights).motion_rows(body.positions)[3:][[AXES.index(a) for a in axes]]

    return Output(name, rows, unit, labels=tuple(axes), quantity="rotation")


def relative_displacement(name: str, *, node: int, other: int, component: str = "xyz", unit: str = "") -> Output:
    """Displacement of `node` minus that of `other`."""

    def rows(body: ElasticBody) -> np.ndarray:
        return _node_rows([node], None, component, 0)(body) - _node_rows([other], None, component, 0)(body)

    return Output(name, rows, unit, labels=tuple(_checked_axes(component)), quantity="displacement")


def node_strain(name: str, *, node: int, fem: Any, component: str | None = None, unit: str = "") -> Output:
    """Strain of the deformed body at one node, in body axes: the mean of B_e(x_node) q over its elements e.

    Parameters
    ----------
    name : str
    node : int
        Node number of the fem.
    fem : FEMinterface
        Nodes and elements (Tet4, Tet10, Hex8, Hex20) are read; the quadratic meshes of ngsolve too.
    component : {"xx", "yy", "zz", "yz", "xz", "xy"}, optional
        One row; default: all six, in this order, which is Exudyn's. Shears are engineering shears, 2 eps_ij, as
        ComputePostProcessingModes has them (ComputePostProcessingModesNGsolve has eps_ij).
    unit : str

    Returns
    -------
    Output
        One row, or six.

    Raises
    ------
    InputError
        No elements or unknown ones, nodes in none of them, node out of range, an element that is flat or turned
        inside out, unknown component.

    Notes
    -----
    Equal to a sensor of StrainLocal where that is right: Exudyn's ComputePostProcessingModes takes quadratic
    tetrahedra for linear ones. Does not cover: beams, shells, strain inside elements (pass rows of your own).
    """
    return _strain_output(name, np.eye(6), node, fem, component, unit, "strain")


def node_stress(
    name: str, *, node: int, fem: Any, material: Any, component: str | None = None, unit: str = ""
) -> Output:
    """Stress of the deformed body at one node, in body axes: y = E times the strain there, see node_strain.

    Parameters
    ----------
    name, node, fem, component, unit
        See node_strain; nothing is printed behind stresses unless unit= says what, such as "Pa" where the model is in
        SI units, "MPa" in t, mm, s.
    material : KirchhoffMaterial
        Exudyn's, as for ComputePostProcessingModes; only its elasticityTensor (6, 6) is read.

    Returns
    -------
    Output
        One row, or six: xx, yy, zz, yz, xz, xy, as sensors of StressLocal have them.

    Raises
    ------
    InputError
        See node_strain; a material without elasticityTensor, or with one that is not (6, 6).

    Notes
    -----
    Does not cover: nodes where two materials meet, thermal stress, plasticity, the error of the mesh.
    """
    tensor = getattr(material, "elasticityTensor", None)
    if tensor is None:
        raise InputError(
            f"material={material!r} has no elasticityTensor; pass KirchhoffMaterial(youngsModulus, poissonsRatio) of "
            "exudyn.FEM, of a mesh with several materials that at the node"
        )
    tensor = check_array("material.elasticityTensor", tensor, (6, 6))
    return _strain_output(name, tensor, node, fem, component, unit, "stress")


def _strain_output(
    name: str, tensor: np.ndarray, node: int, fem: Any, component: str | None, unit: str, quantity: str
) -> Output:
    if component is not None:
        check_choice("component", component, STRAINS)
    rows = tensor @ strain_rows(fem, node)
    if component is None:
        return Output(name, rows, unit, labels=STRAINS, quantity=quantity)
    return Output(name, rows[STRAINS.index(component)], unit, labels=(component,), quantity=quantity)


class StackedRows(NamedTuple):
    """Rows of some outputs on the free coordinates: C (R, n_free), which are velocities (R,), each output's part."""

    C: np.ndarray
    velocity: np.ndarray
    slices: list[slice]


def stacked_rows(outputs: Sequence[Output], body: ElasticBody) -> StackedRows:
    """Return the rows of all outputs; a velocity in global axes has its displacement rows before its own."""
    parts = []
    for out in outputs:
        rows, velocity = body.space.rows(out.resolve(body)), out.of == "velocity"
        parts.append([(rows, False), (rows, True)] if velocity and out.frame == "global" else [(rows, velocity)])
    ends = np.cumsum([0, *(sum(len(rows) for rows, _ in part) for part in parts)])
    flat = [pair for part in parts for pair in part]
    return StackedRows(
        np.vstack([rows for rows, _ in flat]) if flat else np.zeros((0, body.free.size)),
        np.array([velocity for rows, velocity in flat for _ in rows], dtype=bool),
        [slice(a, b) for a, b in pairwise(ends)],
    )


def nodes_output(name, nodes, weights, component: str, unit: str, of: str, frame: str) -> Output:
    """Output of weighted nodes: components in body axes, or whole vectors of which global ones are shown."""
    axes = _checked_axes(component)
    rows = _node_rows(nodes, weights, component if frame == "body" else AXES, 0)
    return Output(name, rows, unit, of, frame, axes, tuple(axes), quantity=of)


def _checked_axes(component: str) -> str:
    if not isinstance(component, str) or not component or set(component) - set(AXES):
        raise InputError(f"component={component!r}; allowed: letters out of {AXES!r}, such as 'z' or 'xyz'")
    return component


def _node_rows(nodes, weights, component: str, offset: int) -> Callable:
    _checked_axes(component)

    def rows(body: ElasticBody) -> np.ndarray:
        per_node, count = body.dofs_per_node, len(body.positions)
        if offset and per_node != 6:
            raise InputError("node_rotation needs nodes with rotations (6 coordinates); this body has 3 a node")
        numbers = check_nodes(nodes, count)
        share = np.ones(len(numbers)) if weights is None else check_array("weights", weights, (len(numbers),))
        if not share.sum() > 0:
            raise InputError("weights must have a positive sum")
        C = np.zeros((len(component), body.N))
        for row, letter in enumerate(component):
            np.add.at(C[row], per_node * numbers + offset + AXES.index(letter), share / share.sum())
        return C

    return rows
