"""Bodies as FEModel.save and Exudyn's FEMinterface.SaveToFile keep them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.sparse as sp

from ..errors import InputError
from ..model.solid_elements import NODES
from .fe_model import FEModel, saved_model

if TYPE_CHECKING:
    from pathlib import Path

TRUST = (
    "{} holds Python objects (pickle), which may run any code while they are read. If you trust it pass "
    "unpickle=True; FEMinterface.SaveToFile('name.hdf5') writes a file that needs no trust"
)
FEW = 5  # arrays that a message names


def read_saved(path: Path, kind: str, unpickle: bool, options: dict[str, Any]) -> FEModel | None:
    """Return the body; None for a file with one matrix, scipy's.

    kind : "npz", "hdf5" or "pickle".

    Raises
    ------
    InputError
        A pickle without unpickle=True, a damaged file, one that lacks a matrix or nodes, h5py is not installed.
    """
    if kind == "pickle" and not unpickle:
        raise InputError(TRUST.format(path))
    try:
        if kind == "npz":
            return _npz(path, unpickle, options)
        data = _unpickled(path) if kind == "pickle" else _hdf5(path)
    except InputError:
        raise
    except Exception as error:  # damaged bytes make zipfile, pickle and h5py raise anything
        raise InputError(f"{path} cannot be read: {error}") from error
    return _of_interface(data, path, options)


def _npz(path: Path, unpickle: bool, options: dict[str, Any]) -> FEModel | None:
    with np.load(path, allow_pickle=False) as file:
        if "romerr" in file.files:
            return saved_model({name: file[name] for name in file.files}, **options)
        if "massMatrix" not in file.files:
            if "format" in file.files:
                return None
            found = ", ".join(file.files[:FEW]) + (" ..." if len(file.files) > FEW else "")
            raise InputError(f"{path} has {found}: neither a matrix of scipy nor what Exudyn saves")
    if not unpickle:
        raise InputError(TRUST.format(path))
    with np.load(path, allow_pickle=True) as file:
        data = {name: file[name] for name in ("nodes", "elements", "massMatrix", "stiffnessMatrix", "nodeSets")}
    return _of_interface({name: x.item() if x.ndim == 0 else x.tolist() for name, x in data.items()}, path, options)


def _unpickled(path: Path) -> dict:
    import pickle

    with open(path, "rb") as stream:
        return pickle.load(stream)


def _hdf5(path: Path) -> dict:
    try:
        import h5py
    except ImportError as error:
        raise InputError(f"{path.name} needs h5py: pip install h5py") from error
    with h5py.File(path, "r") as file:
        return {name: _value(file[name]) for name in file}


def _value(item: Any) -> Any:
    """What Exudyn's SaveDictToHDF5 keeps: dicts, lists, sparse matrices, arrays, texts, numbers."""
    kind = item.attrs.get("datatype")
    if kind == "csr_matrix":
        parts = {name: item[name][()] for name in item}
        return sp.csr_matrix((parts["data"], parts["indices"], parts["indptr"]), shape=tuple(parts["shape"]))
    if kind == "list":
        return [_value(item[f"item_{i}"]) for i in range(len(item))]
    if kind == "dict":
        return {name: _value(item[name]) for name in item}
    if kind == "NoneType":
        return None
    value = item[()]
    return value.decode() if isinstance(value, bytes) else value


def _of_interface(data: Any, path: Path, options: dict[str, Any]) -> FEModel:
    if not isinstance(data, dict) or "nodes" not in data:
        raise InputError(f"{path} cannot be read: it is not what FEMinterface.SaveToFile writes")
    for name in ("massMatrix", "stiffnessMatrix"):
        if not sp.issparse(data.get(name)):
            raise InputError(f"{path} has no {name}; import or compute it before SaveToFile")
    if set(data["nodes"]) != {"Position"}:
        raise InputError(f"{path} has nodes {', '.join(data['nodes']) or 'of no kind'}; known: Position")
    positions = np.asarray(data["nodes"]["Position"], dtype=float)
    if data["massMatrix"].shape[0] != positions.size:
        raise InputError(
            f"{path} has {data['massMatrix'].shape[0]} coordinates and {len(positions)} nodes; needed: 3 each"
        )
    elements: dict[str, list] = {}
    for part in data["elements"]:
        for kind, x in part.items():
            if kind in NODES and len(x):
                elements.setdefault(kind, []).append(np.asarray(x, dtype=int))
    sets = {str(part["Name"]): np.asarray(part["NodeNumbers"], dtype=int) for part in data["nodeSets"]}
    return FEModel(
        data["massMatrix"],
        data["stiffnessMatrix"],
        positions=positions,
        node_numbers=np.arange(len(positions)),
        node_sets=sets,
        elements={kind: np.vstack(x) for kind, x in elements.items()},
        **options,
    )
