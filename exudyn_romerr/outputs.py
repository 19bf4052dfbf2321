"""Outputs y = C q (or C q'): what the engineer asks about, and makers of the usual ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError, check_array, check_choice, check_numbers, real_array

if TYPE_CHECKING:
    from .body import ElasticBody

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
        Printed beside values; the code itself is unit-free.
    of : {"displacement", "velocity"}
        y = C q or y = C q'.
    """

    name: str
    rows: Any
    unit: str = "m"
    of: str = "displacement"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise InputError(f"name={self.name!r} of an Output; needed: a non-empty string")
        check_choice(f"of (output {self.name!r})", self.of, ("displacement", "velocity"))

    def resolve(self, body: ElasticBody) -> np.ndarray:
        """Return the rows as (r, N) for this body; InputError if the width is wrong or an entry not finite."""
        name = f"rows of output {self.name!r}"
        rows = real_array(name, self.rows(body) if callable(self.rows) else self.rows)
        return check_array(name, np.atleast_2d(rows), (None, body.N))

    def constant(self, body: ElasticBody, joint: bool = False) -> np.ndarray | float:
        """Return C2 with |C e|_i <= C2_i |e|_M, shape (r,); joint: the one constant of |C e|_2 <= C2 |e|_M.

        C2_i = sqrt(c_i M^-1 c_i^T), paper (27)-(30); joint: largest singular value of C M^-1/2, (28).
        """
        C = body.space.rows(self.resolve(body))
        gram = C @ body.mass_factor.solve(C.T)
        return float(np.sqrt(np.linalg.eigvalsh(gram)[-1])) if joint else np.sqrt(np.diag(gram))


def node_displacement(name: str, *, node: int, component: str = "xyz", unit: str = "m") -> Output:
    """Displacement of one node; component: letters out of "xyz", one row each.

    Raises (when resolved)
    ----------------------
    InputError
        Body without node positions, node out of range, unknown component.
    """
    return Output(name, _node_rows([node], None, component, 0), unit)


def node_velocity(name: str, *, node: int, component: str = "xyz", unit: str = "m/s") -> Output:
    """Velocity of one node; see node_displacement."""
    return Output(name, _node_rows([node], None, component, 0), unit, of="velocity")


def node_rotation(name: str, *, node: int, component: str = "xyz", unit: str = "rad") -> Output:
    """Rotation of a node that has rotational coordinates (6 a node); solids have none: use several nodes."""
    return Output(name, _node_rows([node], None, component, 3), unit)


def mean_displacement(
    name: str,
    *,
    nodes: Sequence[int],
    weights: Sequence[float] | None = None,
    component: str = "xyz",
    unit: str = "m",
) -> Output:
    """Weighted mean displacement of several nodes (weights are scaled to sum 1; default: equal)."""
    return Output(name, _node_rows(nodes, weights, component, 0), unit)


def relative_displacement(name: str, *, node: int, other: int, component: str = "xyz", unit: str = "m") -> Output:
    """Displacement of `node` minus that of `other`."""

    def rows(body: ElasticBody) -> np.ndarray:
        return _node_rows([node], None, component, 0)(body) - _node_rows([other], None, component, 0)(body)

    return Output(name, rows, unit)


def stacked_rows(outputs: Sequence[Output], body: ElasticBody) -> tuple[np.ndarray, np.ndarray, list[slice]]:
    """Return all rows on the free coordinates (R, n_free), which rows are velocities (R,), each output's slice."""
    names = [out.name for out in outputs]
    double = {name for name in names if names.count(name) > 1}
    if double:
        raise InputError(f"outputs: the name {sorted(double)[0]!r} is used more than once")
    rows = [body.space.rows(out.resolve(body)) for out in outputs]
    ends = np.cumsum([0, *(len(r) for r in rows)])
    slices = [slice(a, b) for a, b in pairwise(ends)]
    velocity = np.array([out.of == "velocity" for out, r in zip(outputs, rows, strict=True) for _ in r], dtype=bool)
    return np.vstack(rows) if rows else np.zeros((0, body.free.size)), velocity, slices


def _node_rows(nodes, weights, component: str, offset: int) -> Callable:
    if not isinstance(component, str) or not component or set(component) - set(AXES):
        raise InputError(f"component={component!r}; allowed: letters out of {AXES!r}, such as 'z' or 'xyz'")

    def rows(body: ElasticBody) -> np.ndarray:
        per_node, count = body.dofs_per_node, len(body.positions)
        if offset and per_node != 6:
            raise InputError("node_rotation needs nodes with rotations (6 coordinates); this body has 3 a node")
        numbers = checked_nodes(nodes, count)
        share = np.ones(len(numbers)) if weights is None else check_array("weights", weights, (len(numbers),))
        if not share.sum() > 0:
            raise InputError("weights must have a positive sum")
        C = np.zeros((len(component), body.N))
        for row, letter in enumerate(component):
            np.add.at(C[row], per_node * numbers + offset + AXES.index(letter), share / share.sum())
        return C

    return rows


def checked_nodes(nodes: Sequence[int], count: int) -> np.ndarray:
    """Return node numbers as an int array; InputError names the first outside 0..count-1."""
    numbers = check_numbers("node numbers", nodes)
    wrong = numbers[(numbers < 0) | (numbers >= count) | (numbers != np.round(numbers))]
    if numbers.size == 0 or wrong.size:
        raise InputError(
            f"node {f'{wrong[0]:g}' if wrong.size else 'list is empty'}; allowed: node numbers 0..{count - 1}"
        )
    return numbers.astype(int)
