"""Saves a report as npz: plain arrays, and one JSON text beside them; load.py reads it again."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from ..data import DICTS, NODE_DICTS, OPTIONAL, NodeFields
from .atomic_write import write_whole

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable

    from ..data import ReportData
    from ..scope import Doubt

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
    arrays.update({f"position/{e}": x for e, x in report.position_bound.items()})
    arrays.update({f"velocity/{e}": x for e, x in report.velocity_bound.items()})
    if isinstance(report.nodes, NodeFields):
        arrays.update(_at_nodes(report.nodes))
    for i, out in enumerate(report.outputs.values()):
        arrays[f"output/{i}/value"], arrays[f"output/{i}/round_off"] = out.value, out.round_off
        for kind in OPTIONAL:
            if getattr(out, kind) is not None:
                arrays[f"output/{i}/{kind}"] = getattr(out, kind)
        for kind in DICTS:
            arrays.update({f"output/{i}/{kind}/{e}": x for e, x in getattr(out, kind).items()})
    for i, body in enumerate(report.bodies):  # of a mechanism: whole reports
        arrays.update({f"body/{i}/{key}": x for key, x in arrays_of(body).items()})
    return arrays


def _at_nodes(nodes: NodeFields) -> dict[str, np.ndarray]:
    arrays = {f"node/{e}": x for e, x in nodes.bound.items()}
    for kind in NODE_DICTS:
        arrays.update({f"nodes/{kind}/{e}": np.asarray(x) for e, x in getattr(nodes, kind).items()})
    return arrays if nodes.positions is None else {**arrays, "nodes/positions": nodes.positions}


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
