"""One report of a run that was made in intervals, each of which goes on from the one before."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .formats.npz_file import DICTS, OPTIONAL
from .scope import SCOPES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .report import BoundReport, OutputReport


def joined_in_time(reports: Sequence[BoundReport]) -> BoundReport:
    """Return one report of all; the first instant of each is the last of the one before, and is taken once.

    Parameters
    ----------
    reports : at least one, in the order of time
        Of the same bodies; an output counts that all have.

    Returns
    -------
    BoundReport
        Of the type of the last. Does not cover: bounds at nodes.
    """
    last = reports[-1]
    if len(reports) == 1:
        return last
    names = [name for name in last.outputs if all(name in report.outputs for report in reports)]
    bodies = [getattr(report, "bodies", ()) for report in reports]
    mechanism = {"bodies": tuple(map(joined_in_time, zip(*bodies, strict=True)))} if bodies[0] else {}
    return replace(
        last,
        t=_in_a_row([report.t for report in reports]),
        position_bound=_of_keys([report.position_bound for report in reports]),
        velocity_bound=_of_keys([report.velocity_bound for report in reports]),
        outputs={name: _output([report.outputs[name] for report in reports]) for name in names},
        scope={e: max((of.scope[e] for of in reports if e in of.scope), key=SCOPES.index) for e in last.scope},
        messages=list(dict.fromkeys(message for report in reports for message in report.messages)),
        uncertified=_doubts(reports),
        nodes=None,
        **mechanism,
    )


def _output(outs: Sequence[OutputReport]) -> OutputReport:
    last = outs[-1]
    optional = {name: [getattr(out, name) for out in outs] for name in OPTIONAL}
    given = {name: None if any(x is None for x in of) else _in_a_row(of) for name, of in optional.items()}
    dicts = {name: _of_keys([getattr(out, name) for out in outs]) for name in DICTS}
    arrays = {name: _in_a_row([getattr(out, name) for out in outs]) for name in ("value", "round_off")}
    beside = next((out.beside_steps for out in outs if out.beside_steps), ())
    return replace(last, **arrays, **given, **dicts, beside_steps=beside, uncertified=_doubts(outs))


def _in_a_row(arrays: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([arrays[0], *(array[1:] for array in arrays[1:])])


def _of_keys(dicts: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Arrays of the keys that all have; a mechanism's dict of none stays what it is."""
    keys = [key for key in dicts[-1] if all(key in of for of in dicts)]
    return {key: _in_a_row([of[key] for of in dicts]) for key in keys} if keys else dicts[-1]


def _doubts(of: Sequence[Any]) -> tuple:
    return tuple({doubt.cause: doubt for one in of for doubt in one.uncertified}.values())
