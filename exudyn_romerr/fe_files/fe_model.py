"""FEModel: what read_body returns, matrices with nodes, elements and sets; and files that keep one."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from ..checks import check_choice
from ..errors import InputError
from ..model.body import ElasticBody
from ..model.matrix_checks import check_not_swapped
from ..report.formats.atomic_write import write_whole
from .file_kind import OF_EXUDYN

MATRICES = ("mass", "stiffness")
SAVED = "exudyn_romerr body"  # how our own files begin
FEW = 5  # arrays that a message names


class FEModel:
    """A body from files: matrices, nodes, elements and sets, all counted from 0.

    mass, stiffness : (N, N), sparse. positions : (nodes, 3), None if no file had them. node_numbers : (nodes,), what
    the file calls them; None if it does not. node_sets : name -> node indices. elements : type ("Tet4", "Hex20", ...)
    -> (e, k) node indices, of known types. held : coordinates that the file holds at zero; they stay in N.
    """

    def __init__(
        self,
        mass: sp.spmatrix,
        stiffness: sp.spmatrix,
        *,
        positions: np.ndarray | None = None,
        node_numbers: np.ndarray | None = None,
        node_sets: dict[str, np.ndarray] | None = None,
        elements: dict[str, np.ndarray] | None = None,
        held: np.ndarray | Sequence[int] = (),
        rayleigh: ArrayLike | None = None,
        fixed: Any = (),
        reference: Any = None,
    ):
        self.mass, self.stiffness = sp.csr_matrix(mass), sp.csr_matrix(stiffness)
        check_not_swapped(self.mass, self.stiffness)
        self.positions, self.node_numbers = positions, node_numbers
        self.node_sets, self.elements = dict(node_sets or {}), dict(elements or {})
        self.held = np.asarray(held, dtype=int)
        self._given = {"rayleigh": rayleigh, "fixed": fixed, "reference": reference}

    @cached_property
    def body(self) -> ElasticBody:
        """The ElasticBody with the rayleigh, fixed and reference that read_body was given."""
        return self.elastic_body(**self._given)

    def elastic_body(
        self,
        rayleigh: ArrayLike | None = None,
        fixed: ArrayLike = (),
        reference: Any = None,
        damping: Any = None,
        modal_damping: ArrayLike | None = None,
    ) -> ElasticBody:
        """Return an ElasticBody of these matrices; what the file holds is fixed, too.

        Parameters
        ----------
        rayleigh, reference, damping, modal_damping
            As ElasticBody takes them.
        fixed : str or sequence of str or int
            Names of node sets, all coordinates of whose nodes are fixed, and numbers of coordinates.

        Raises
        ------
        InputError
            An unknown node set, or what ElasticBody refuses.
        """
        names = [fixed] if isinstance(fixed, str) else list(fixed)
        dofs = [self.held, *(self._coordinates(x) if isinstance(x, str) else [x] for x in names)]
        fixed = np.unique(np.concatenate([np.asarray(x, dtype=float) for x in dofs]))
        held = {"fixed": fixed, "reference": reference, "positions": self.positions}
        return ElasticBody(self.mass, self.stiffness, rayleigh, damping, **held, modal_damping=modal_damping)

    def node(self, number: int) -> int:
        """Return the index of the node that the file calls `number`; InputError if it has none such."""
        found = [] if self.node_numbers is None else np.flatnonzero(self.node_numbers == number)
        if len(found) != 1:
            raise InputError(f"node {number!r} is not among the nodes of the file")
        return int(found[0])

    def to_fem(self) -> Any:
        """Return an exudyn FEMinterface with matrices, nodes, elements, their surface and node sets.

        Raises
        ------
        InputError
            No positions, rotations (6 coordinates a node), or coordinates that the file holds: Exudyn's bodies are
            free solids.
        """
        from ..mbs.access.fem_interface import fem_of  # Exudyn is there only where this is asked for

        return fem_of(self)

    def save(self, path: str | os.PathLike) -> None:
        """Write everything to an .npz file that read_body reads again, faster than text; InputError if it cannot."""
        arrays: dict[str, Any] = {"romerr": np.array(SAVED), "held": self.held}
        for name in MATRICES:
            matrix = getattr(self, name)
            arrays |= {f"{name}/{part}": getattr(matrix, part) for part in ("data", "indices", "indptr")}
        for name in ("positions", "node_numbers"):
            arrays |= {} if getattr(self, name) is None else {name: getattr(self, name)}
        for name in ("node_sets", "elements"):
            arrays |= {f"{name}/{key}": x for key, x in getattr(self, name).items()}
        write_whole(path, lambda stream: np.savez_compressed(stream, **arrays))

    def __repr__(self) -> str:
        nodes = "no nodes" if self.positions is None else f"{len(self.positions)} nodes"
        kinds = ", ".join(f"{len(x)} {kind}" for kind, x in self.elements.items()) or "no elements"
        held = f", {len(self.held)} of them held by the file" if len(self.held) else ""
        sets = f"; sets {', '.join(self.node_sets)}" if self.node_sets else ""
        return f"<FEModel: {self.mass.shape[0]} coordinates{held}, {nodes}, {kinds}{sets}>"

    def _coordinates(self, name: str) -> np.ndarray:
        check_choice("fixed", name, self.node_sets)
        per_node = self.mass.shape[0] // len(self.positions)
        return (per_node * self.node_sets[name][:, None] + np.arange(per_node)).ravel()


def read_saved(path: Path, options: dict[str, Any]) -> FEModel | None:
    """Return the model that FEModel.save wrote; None for an .npz with one matrix, scipy's.

    Raises
    ------
    InputError
        A damaged file, or one that has something else.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            names = file.files
            arrays = {name: file[name] for name in names} if "romerr" in names else None
    except Exception as error:  # damaged bytes make zipfile raise anything
        raise InputError(f"{path} cannot be read: {error}") from error
    if "massMatrix" in names:
        raise InputError(OF_EXUDYN.format(path))
    if arrays is None and "format" not in names:
        found = ", ".join(names[:FEW]) + (" ..." if len(names) > FEW else "")
        raise InputError(f"{path} has {found}: neither a matrix of scipy nor a body of FEModel.save")
    return None if arrays is None else _model_of(arrays, options)


def _model_of(arrays: dict[str, np.ndarray], options: dict[str, Any]) -> FEModel:
    N = len(arrays["mass/indptr"]) - 1
    matrices = [
        sp.csr_matrix(tuple(arrays[f"{name}/{part}"] for part in ("data", "indices", "indptr")), shape=(N, N))
        for name in MATRICES
    ]
    under = {
        kind: {key.removeprefix(f"{kind}/"): x for key, x in arrays.items() if key.startswith(f"{kind}/")}
        for kind in ("node_sets", "elements")
    }
    known = {name: arrays.get(name) for name in ("positions", "node_numbers")}
    return FEModel(*matrices, **known, **under, held=arrays["held"], **options)
