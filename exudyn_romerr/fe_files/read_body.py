"""read_body: a body from the files that finite-element programs write."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from ..errors import InputError
from .abaqus_input import read_input
from .ansys_files import read_ansys_mesh, read_full
from .assembled import assembled
from .fe_data import Matrix, Mesh
from .fe_model import FEModel, read_saved
from .file_kind import KNOWN, KNOWN_MESHES, MATRICES, MESHES, known_kind, not_known
from .matrix_files import OF_CALCULIX, read_matrix
from .nastran_files import read_bulk, read_nastran

ANSYS_MESHES = (".cdb", ".rst")
OF_ABAQUS = {"stiffness": "STIF", "mass": "MASS"}  # in the names of its files
BY_CALCULIX = re.compile(r"SOLVER *= *MATRIXSTORAGE", re.IGNORECASE)
BY_ABAQUS = re.compile(r"^\*(MATRIX GENERATE|MATRIX OUTPUT|PART|ASSEMBLY|INSTANCE)\b", re.IGNORECASE | re.MULTILINE)


def read_body(
    path: str | os.PathLike,
    *,
    mass: str | os.PathLike | None = None,
    stiffness: str | os.PathLike | None = None,
    mesh: str | os.PathLike | None = None,
    rayleigh: ArrayLike | None = None,
    fixed: ArrayLike = (),
    reference: Any = None,
) -> FEModel:
    """Read mass and stiffness, and what else is there: nodes, elements, node sets, supports.

    Parameters
    ----------
    path : path
        Abaqus: .inp, with JOB_MASS1.mtx and JOB_STIF1.mtx beside it (both formats of *Matrix Output). CalculiX: .inp
        or .sti, with JOB.sti, .mas and .dof beside it. Ansys: .full (extra [ansys]), with .cdb or .rst of that name
        for nodes. Nastran: .pch with DMIG (extra [nastran]). Matrix Market .mtx or .mtx.gz, Harwell-Boeing (HBMAT of
        Ansys), scipy's .npz: the stiffness matrix, with mass=. What FEModel.save wrote: .npz. Other endings: by what
        is in the file.
    mass, stiffness : path, optional
        The file of that matrix, where its name does not tell, or the matrix itself is in none of the above. Of
        Nastran: its name in the file, "MAAX".
    mesh : path, optional
        The file with nodes, where it is another one: .inp, .cdb, .rst, or Nastran's bulk data .bdf, .dat, .nas, .blk.
    rayleigh, fixed, reference
        Of `.body`, as ElasticBody takes them; fixed may name node sets.

    Returns
    -------
    FEModel
        `.body` (ElasticBody), `.node_sets`, `.to_fem()` (exudyn FEMinterface); nodes count from 0 in ascending order
        of the file's numbers, `.node_numbers`.

    Raises
    ------
    InputError
        A file that is missing, damaged, of no known kind, or lacks something: the message says what and how to get
        it. A package that is not installed.

    Does not cover: several parts or instances, constraints between nodes (*Equation, *Tie, RBE2 ... refused where the
    reader sees them), damping matrices, superelements, units (those of the files are kept).
    """
    path = Path(path)
    options = {"rayleigh": rayleigh, "fixed": fixed, "reference": reference}
    for name, other in (("path", path), ("mesh", mesh)):
        if other is not None and not os.path.isfile(other):
            raise InputError(f"{name}={os.fspath(other)!r} is no file")
    kind = known_kind("path", path)
    nodes = None if mesh is None else _mesh(Path(mesh))
    if kind == "pch":
        *pair, own = read_nastran(path, mass, stiffness)
        return assembled(*pair, nodes or own, **options)
    if kind == "full":
        return assembled(*read_full(path), nodes or _beside(path, ANSYS_MESHES), **options)
    if kind in MESHES:
        pair = [_matrix(path, kind, given, word) for word, given in (("stiffness", stiffness), ("mass", mass))]
        return assembled(*pair, nodes or _mesh(path), **options)
    if kind == "npz" and mass is None and (found := read_saved(path, options)) is not None:
        return found
    if kind in MATRICES:
        of_calculix = path.suffix.lower() in OF_CALCULIX.values()
        beside = _beside(path, (".inp",)) if of_calculix and nodes is None else None
        return assembled(*_pair(path, mass, stiffness), nodes or beside, **options)
    raise not_known("path", path, KNOWN)


def _mesh(path: Path) -> Mesh:
    kind = known_kind("mesh", path, KNOWN_MESHES)
    if kind == "deck":
        return read_input(path)
    if kind in ("cdb", "rst"):
        return read_ansys_mesh(path, archive=kind == "cdb")
    if kind in ("bulk", "pch"):
        return read_bulk(path)
    raise not_known("mesh", path, KNOWN_MESHES)


def _beside(path: Path, endings: tuple[str, ...]) -> Mesh | None:
    """The mesh in a file of the same name, if there is one."""
    return next((_mesh(other) for end in endings if (other := path.with_suffix(end)).is_file()), None)


def _pair(path: Path, mass: Any, stiffness: Any) -> list[Matrix]:
    if mass is None and stiffness is None:
        other, name = _counterpart(path), path.name.upper()
        mass, stiffness = (path, other) if "MASS" in name or name.endswith(".MAS") else (other, path)
    return [read_matrix(_existing(name, x or path), name) for name, x in (("stiffness", stiffness), ("mass", mass))]


def _counterpart(path: Path) -> Path:
    """The file whose name says MASS where this one says STIF, or the other way round."""
    pairs = (("STIF", "MASS"), ("MASS", "STIF"), ("stiffness", "mass"), ("mass", "stiffness"))
    found = [path.with_name(path.name.replace(one, other)) for one, other in pairs]
    if path.suffix.lower() in OF_CALCULIX.values():
        found += [path.with_suffix(ending) for ending in OF_CALCULIX.values()]
    for beside in found:
        if beside != path and beside.is_file():
            return beside
    raise InputError(f"{path.name} has one matrix; pass mass= and stiffness=, the files of both")


def _matrix(path: Path, kind: str, given: Any, word: str) -> Matrix:
    """The matrix that belongs to a mesh: the one given; of an .inp JOB_MASS1.mtx of the only step, or JOB.mas."""
    if given is not None:
        return read_matrix(_existing(word, given), word)
    if kind != "deck":
        raise InputError(f"{path} has nodes and no matrices; pass mass= and stiffness=, the files of both")
    pattern = re.compile(rf"{re.escape(path.stem)}_?{OF_ABAQUS[word]}\d+\.mtx", re.IGNORECASE)
    of_calculix = path.with_suffix(OF_CALCULIX[word])
    found = sorted(other for other in path.parent.iterdir() if pattern.fullmatch(other.name))
    found = found or [of_calculix] * of_calculix.is_file()
    if not found:
        raise InputError(f"{_nothing_beside(path, word)}; or pass {word}=, its file")
    if len(found) > 1:
        raise InputError(f"beside {path.name} are {', '.join(x.name for x in found)}; pass {word}=, one of them")
    return read_matrix(found[0], word)


def _existing(name: str, path: Any) -> Path:
    if not os.path.isfile(path):
        raise InputError(f"{name}={os.fspath(path)!r} is no file")
    return Path(path)


def _nothing_beside(path: Path, word: str) -> str:
    """That an .inp lacks a matrix, and how its program, both if it does not tell, writes it."""
    text = path.read_text(encoding="utf-8", errors="replace")
    mtx, mas = f"{path.stem}_{OF_ABAQUS[word]}1.mtx", f"{path.stem}{OF_CALCULIX[word]}"
    by_calculix = f"CalculiX writes with *Frequency, solver=MatrixStorage, {path.stem}.dof beside it"
    if BY_CALCULIX.search(text):
        return f"there is no {mas} beside {path.name}: the {word} matrix, which {by_calculix}"
    by_both = "" if BY_ABAQUS.search(text) else f" ({mas}, which {by_calculix}, will do, too)"
    return (
        f"there is no {mtx} beside {path.name}: the {word} matrix, which Abaqus writes after *Matrix Generate, "
        f"stiffness, mass and *Matrix Output, stiffness, mass{by_both}"
    )
