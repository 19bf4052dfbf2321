"""load_report: a saved report read again."""

from __future__ import annotations

import itertools
import json
import os
from functools import partial

import numpy as np

from ...errors import InputError
from ..data import DICTS, NODE_DICTS, OPTIONAL, NodeFields, Plan
from ..mechanism_report import MechanismReport, OfBodies
from ..report import BoundReport, OutputReport
from ..scope import NOT_CERTIFIED, Doubt
from .npz_file import FORMAT, OF_OUTPUTS, OF_REPORT

OLDER = Doubt("the messages say why", "see the messages")  # of a run of an older version, which kept no more
SWEPT = "; of a sweep, romerr collect FOLDER makes a table"


def load_report(path: str | os.PathLike) -> BoundReport:
    """Read a report that BoundReport.save wrote.

    Raises
    ------
    InputError
        No such file or no permission, truncated, not a report, or written by another format version.
    """
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
        found = json.loads(str(arrays["meta"]))["format"]
        if found == FORMAT:
            return report_of(arrays, os.fspath(path))
    except IsADirectoryError as error:
        raise InputError(f"{path} is a folder; pass one of the files that report.save wrote there{SWEPT}") from error
    except FileNotFoundError as error:
        raise InputError(f"{path} is no file; pass the name given to report.save") from error
    except PermissionError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    except Exception as error:  # damaged bytes make zipfile, zlib, numpy and json raise a dozen types
        raise InputError(f"{path} is no report of exudyn_romerr, or it is truncated") from error
    raise InputError(f"{path} has format {found!r}; this version reads format {FORMAT}: save it again")


def report_of(arrays: dict[str, np.ndarray], origin: str) -> BoundReport:
    """Return the report that npz_file.arrays_of took apart; origin: the file that they were in.

    What older files lack is as the fields of a new report are.
    """
    meta = json.loads(str(arrays["meta"]))
    outputs = [_output(arrays, meta, i) for i in range(len(meta["outputs"]))]
    computed, left_out = meta["plan"]
    make, bounds = BoundReport, [_under(arrays, kind) for kind in ("position/", "velocity/")]
    if not bounds[0]:  # of a mechanism: bodies have such, if anything has
        make, bounds = partial(MechanismReport, bodies=_bodies(arrays, origin)), [OfBodies(), OfBodies()]
    return make(
        arrays["t"],
        *bounds,
        outputs={out.name: out for out in outputs},
        plan=Plan(tuple(computed), tuple(map(tuple, left_out))),
        nodes=_at_nodes(arrays),
        origin=origin,
        uncertified=_doubts(meta, meta.get("uncertified")),
        **{name: meta[name] for name in OF_REPORT if name in meta},
        **dict(zip(("ended_by", "on_purpose"), meta.get("ended_by", ()), strict=False)),
    )


def _output(arrays: dict, meta: dict, i: int) -> OutputReport:
    known = {name: meta[key][i] for key, name in OF_OUTPUTS.items() if key in meta}
    known = {name: tuple(x) if isinstance(x, list) else x for name, x in known.items()}
    doubts = _doubts(meta, meta["uncertified_outputs"][i] if "uncertified_outputs" in meta else None)
    own = _under(arrays, f"output/{i}/")
    fields = {kind: _under(own, f"{kind}/") for kind in DICTS} | {kind: own.get(kind) for kind in OPTIONAL}
    fields |= {kind: own[kind] for kind in ("value", "round_off")}
    return OutputReport(*meta["outputs"][i], **fields, **known, uncertified=doubts)


def _doubts(meta: dict, found: list | None) -> tuple[Doubt, ...]:
    """Why nothing of a report, or of an output, is certified."""
    if found is None:
        return (OLDER,) if meta["scope_reason"].endswith(NOT_CERTIFIED) else ()
    return tuple(Doubt(*parts) for parts in found)


def _at_nodes(arrays: dict) -> NodeFields | None:
    if not (bound := _under(arrays, "node/")):
        return None
    of = _under(arrays, "nodes/")
    found = {kind: _under(of, f"{kind}/") for kind in NODE_DICTS}
    found["instant"] = {e: float(t) for e, t in found["instant"].items()}
    return NodeFields(bound, positions=of.get("positions"), **found)


def _bodies(arrays: dict, origin: str) -> tuple[BoundReport, ...]:
    """The reports of a mechanism's bodies."""
    count = next(i for i in itertools.count() if f"body/{i}/t" not in arrays)
    return tuple(report_of(_under(arrays, f"body/{i}/"), origin) for i in range(count))


def _under(arrays: dict, prefix: str) -> dict[str, np.ndarray]:
    return {key.removeprefix(prefix): value for key, value in arrays.items() if key.startswith(prefix)}
