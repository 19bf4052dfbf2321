"""Saves a report as npz: plain arrays, and one JSON text beside them; load.py reads it again."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..data import DICTS, NODE_DICTS, OPTIONAL, NodeFields, ReportData
from ..scope import Doubt
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


def write_npz(report: ReportData, path: str | os.PathLike) -> None:
    """Write everything to one .npz file; InputError if it cannot be written."""
    arrays = arrays_of(report)
    write_whole(path, lambda stream: np.savez_compressed(stream, **arrays))


def arrays_of(report: ReportData) -> dict[str, np.ndarray]:
    """Return everything as plain arrays; "meta" is a text, in JSON."""
    arrays = {"meta": np.array(json.dumps(_meta(report))), "t": report.t}
    arrays |= _under("position/", report.position_bound) | _under("velocity/", report.velocity_bound)
    for i, out in enumerate(report.outputs.values()):
        own = {kind: getattr(out, kind) for kind in ("value", "round_off", *OPTIONAL)}
        for kind in DICTS:
            own |= _under(f"{kind}/", getattr(out, kind))
        arrays |= _under(f"output/{i}/", own)
    for i, body in enumerate(report.bodies):  # of a mechanism: whole reports
        arrays |= _under(f"body/{i}/", arrays_of(body))
    if isinstance(nodes := report.nodes, NodeFields):
        arrays |= _under("node/", nodes.bound) | _under("nodes/", {"positions": nodes.positions})
        for kind in NODE_DICTS:
            arrays |= _under(f"nodes/{kind}/", getattr(nodes, kind))
    return arrays


def _under(prefix: str, of: dict[str, Any]) -> dict[str, np.ndarray]:
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
