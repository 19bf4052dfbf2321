"""A report as .npz file: plain arrays, and one JSON text beside them; written, and its fields read again."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ...errors import InputError
from ..data import DICTS, NODE_DICTS, OPTIONAL, NodeFields, OutputReport, Plan, ReportData
from ..scope import NOT_CERTIFIED, Doubt
from .atomic_write import write_whole

FORMAT = 2  # of the saved file; a file of another format is refused
# fields that the JSON text has: of the report under their own names, of outputs as lists under these
OF_REPORT = ("made", "planned_end", "scope", "scope_reason", "reasons", "messages", "time", "total_mass", "remainder")
OF_OUTPUTS = {
    "quantities": "quantity",
    "labels": "labels",
    "estimate_scopes": "estimate_scope",
    "tolerances": "tolerance",
    "stopped": "stopped",
    "beside_steps": "beside_steps",
}
OLDER = Doubt("the messages say why", "see the messages")  # of a run of an older version, which kept no more
SWEPT = "; of a sweep, romerr collect FOLDER makes a table"


def write_npz(report: ReportData, path: str | os.PathLike) -> None:
    """Write everything to one .npz file; InputError if it cannot be written."""
    arrays = arrays_of(report)
    write_whole(path, lambda stream: np.savez_compressed(stream, **arrays))


def arrays_of(report: ReportData) -> dict[str, np.ndarray]:
    """Return everything as plain arrays; "meta" is a text, in JSON."""
    arrays = {"meta": np.array(json.dumps(_meta(report))), "t": report.t}
    arrays |= _named("position/", report.position_bound) | _named("velocity/", report.velocity_bound)
    for i, out in enumerate(report.outputs.values()):
        own = {kind: getattr(out, kind) for kind in ("value", "round_off", *OPTIONAL)}
        for kind in DICTS:
            own |= _named(f"{kind}/", getattr(out, kind))
        arrays |= _named(f"output/{i}/", own)
    for i, body in enumerate(report.bodies):  # of a mechanism: whole reports
        arrays |= _named(f"body/{i}/", arrays_of(body))
    if isinstance(nodes := report.nodes, NodeFields):
        arrays |= _named("node/", nodes.bound) | _named("nodes/", {"positions": nodes.positions})
        for kind in NODE_DICTS:
            arrays |= _named(f"nodes/{kind}/", getattr(nodes, kind))
    return arrays


def _named(prefix: str, of: dict[str, Any]) -> dict[str, np.ndarray]:
    return {f"{prefix}{key}": np.asarray(x) for key, x in of.items() if x is not None}


def _plain(doubts: Iterable[Doubt]) -> list[tuple[str, ...]]:
    return [doubt.__getnewargs__() for doubt in doubts]


def _meta(report: ReportData) -> dict:
    outputs = report.outputs.values()
    return {
        "format": FORMAT,
        "outputs": [(out.name, out.unit, out.of) for out in outputs],
        **{key: [getattr(out, name) for out in outputs] for key, name in OF_OUTPUTS.items()},
        "uncertified": _plain(report.uncertified),
        "uncertified_outputs": [_plain(out.uncertified) for out in outputs],
        "ended_by": [report.ended_by, report.on_purpose],
        "plan": [report.plan.computed, report.plan.left_out],
        **{name: getattr(report, name) for name in OF_REPORT},
    }


# --- read again ---


def read_npz(path: str | os.PathLike, make: Callable[[dict[str, np.ndarray], str], Any]) -> Any:
    """Return the report that write_npz wrote, by make(arrays, name of the file); InputError if there is none."""
    try:
        with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {key: file[key] for key in file.files}
        found = json.loads(str(arrays["meta"]))["format"]
        if found == FORMAT:
            return make(arrays, os.fspath(path))
    except IsADirectoryError as error:
        raise InputError(f"{path} is a folder; pass one of the files that report.save wrote there{SWEPT}") from error
    except FileNotFoundError as error:
        raise InputError(f"{path} is no file; pass the name given to report.save") from error
    except PermissionError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    except Exception as error:  # damaged bytes make zipfile, zlib, numpy and json raise a dozen types
        raise InputError(f"{path} is no report of exudyn_romerr, or it is truncated") from error
    raise InputError(f"{path} has format {found!r}; this version reads format {FORMAT}: save it again")


def fields_of(arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """Return the fields of the report that was taken apart, but for bodies; what older files lack is left out."""
    meta = json.loads(str(arrays["meta"]))
    outputs = [_output(arrays, meta, i) for i in range(len(meta["outputs"]))]
    computed, left_out = meta["plan"]
    return {
        "t": arrays["t"],
        **{f"{kind}_bound": _under(arrays, f"{kind}/") for kind in ("position", "velocity")},
        "outputs": {out.name: out for out in outputs},
        "plan": Plan(tuple(computed), tuple(map(tuple, left_out))),
        "nodes": _at_nodes(arrays),
        "uncertified": _doubts(meta, meta.get("uncertified")),
        **{name: meta[name] for name in OF_REPORT if name in meta},
        **dict(zip(("ended_by", "on_purpose"), meta.get("ended_by", ()), strict=False)),
    }


def bodies_of(arrays: dict[str, np.ndarray]) -> list[dict[str, np.ndarray]]:
    """Return what the reports of a mechanism's bodies were taken apart into."""
    count = next(i for i in itertools.count() if f"body/{i}/t" not in arrays)
    return [_under(arrays, f"body/{i}/") for i in range(count)]


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
    bound, of = _under(arrays, "node/"), _under(arrays, "nodes/")
    if not (bound or of):
        return None
    found = {kind: _under(of, f"{kind}/") for kind in NODE_DICTS}
    found["instant"] = {e: float(t) for e, t in found["instant"].items()}
    return NodeFields(bound, positions=of.get("positions"), **found)


def _under(arrays: dict, prefix: str) -> dict[str, np.ndarray]:
    return {key.removeprefix(prefix): value for key, value in arrays.items() if key.startswith(prefix)}
