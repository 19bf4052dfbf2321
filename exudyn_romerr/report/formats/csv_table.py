"""A report as columns over time: for pandas, and as CSV."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Iterator, Sequence
from itertools import count
from typing import Any

import numpy as np

from ..data import OutputReport, ReportData
from ..scope import COUPLED, FROZEN, NOT_CERTIFIED
from ..wording import SHORT, estimate_scope, under, widest_scope
from .atomic_write import write_whole


def columns(report: ReportData) -> dict[str, np.ndarray]:
    """Return everything over time, so that pandas.DataFrame(columns(report)) is a table.

    Parameters
    ----------
    report : BoundReport

    Returns
    -------
    dict
        Name -> (T,). "t [s]" ("load factor" of a static solve); then for every row of every output, here tip z in m,
        "tip z [m]", "tip z bound [m]" (the best), "tip z bound auxiliary [m]" (each estimator), "tip z corrected [m]"
        and "tip z corrected bound [m]" (with auxiliary modes), "tip z estimate [m]" and "tip z uncertainty [m]" (its
        half width) with their parts, such as "tip z estimate basis [m]" and "tip z uncertainty steps [m]" (where an
        estimate is known), "tip z round-off [m]", "tip z true error [m]" (if a truth was compared); then "position
        bound auxiliary" and "velocity bound auxiliary" of |e|_M and |e'|_M. Where the scope is not complete the names
        of bounds say so: "tip z bound, inputs frozen [m]", "tip z reduction error bound, to first order [m]" (without
        the time steps, which estimates have in them); those of estimates only with inputs frozen. Bounds of a run
        that is not certified: "tip z bound, not certified [m]".

    Notes
    -----
    A name that is there already gets " (2)". An unknown bound is inf. Does not cover: causes and node_bound, which
    save() keeps.
    """
    named = [("load factor" if report.time == "static" else "t [s]", report.t)]
    for out in report.outputs.values():
        for row, name in enumerate(out.row_names):
            named += [(_name(name, what, "", out.unit), x[:, row]) for what, x in series_of(out, report.scope)]
    for kind, bounds in (("position", report.position_bound), ("velocity", report.velocity_bound)):
        named += [(f"{kind} bound {e}{under(report.scope, e, report.uncertified)}", x) for e, x in bounds.items()]
    found: dict[str, np.ndarray] = {}
    for name, x in named:
        others = (other for i in count(2) if (other := f"{name} ({i})") not in found)
        found[name if name not in found else next(others)] = x
    return found


def largest(report: ReportData) -> dict[str, float]:
    """Return the largest absolute value over time of every row of every output, its estimate and bound.

    Names are those of columns(report) with "largest": "tip z largest [m]", "tip z bound largest [m]".
    """
    return {
        _name(name, what, "largest", out.unit): float(np.max(np.abs(x[:, row])))
        for out in report.outputs.values()
        for row, name in enumerate(out.row_names)
        for what, x in main_series(out, report.scope).items()
    }


def write_csv(report: ReportData, path: str | os.PathLike) -> None:
    """Write columns(report) as CSV (RFC 4180, a header, decimal points, all digits; inf for no finite bound).

    UTF-8; with a byte order mark if a name has other letters than English ones, for Excel would misread them.

    Raises
    ------
    InputError
        The file cannot be written; one that was there is as it was.
    """
    table = columns(report)
    data = csv_bytes(table, zip(*(x.tolist() for x in table.values()), strict=True))
    write_whole(path, lambda stream: stream.write(data))


def _name(*parts: str) -> str:
    """Words of a column's name, the last of which is a unit; those that are empty are left out."""
    return " ".join(filter(None, [*parts[:-1], parts[-1] and f"[{parts[-1]}]"]))


def main_series(out: OutputReport, scope: dict[str, str]) -> dict[str, np.ndarray]:
    """Return value, "", estimate and half width, where there are any, and best bound (T, r), named as they hold."""
    condition = _condition(out, scope)
    found = {"": out.value, f"estimate{condition}": out.estimate, f"uncertainty{condition}": out.uncertainty}
    found[_bound(out, scope)] = out.bound["best"]
    return {what: x for what, x in found.items() if x is not None}


def series_of(out: OutputReport, scope: dict[str, str]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield everything that is known of an output over time (T, r), with what it is called; the value is ""."""
    (_, value), *estimates, (bound, best) = main_series(out, scope).items()
    condition = _condition(out, scope)
    yield from (("", value), (bound, best))
    yield from ((_bound(out, scope, e), x) for e, x in out.bound.items() if e != "best")
    if out.corrected is not None:
        yield "corrected", out.corrected
        yield f"corrected bound{under(scope, doubts=out.uncertified)}", out.corrected_bound
    yield from estimates
    if out.estimate is not None:
        yield from ((f"estimate {cause}{condition}", x) for cause, x in out.estimate_parts.items())
        for check, x in out.uncertainty_parts.items():  # what bounds that are not certified leave is not proved
            doubt = f" ({NOT_CERTIFIED})" if check == "proved" and out.uncertified else ""
            yield f"uncertainty {check}{doubt}{condition}", x
    yield "round-off", out.round_off
    if out.error is not None:
        yield "true error", out.error


def _bound(out: OutputReport, scope: dict[str, str], e: str = "best") -> str:
    """What bounds are called: beside estimates of a mechanism, with time steps, what they are of."""
    is_of_modes = (widest_scope(scope) if e == "best" else scope[e]) == COUPLED
    name = "" if e == "best" else f" {e}"
    return f"{'reduction error ' * is_of_modes}bound{name}{under(scope, e, out.uncertified)}"


def _condition(out: OutputReport, scope: dict[str, str]) -> str:
    """What estimates hold under; that they are of first order "about" says."""
    return SHORT[FROZEN] if estimate_scope(out, scope) == FROZEN else ""


def csv_bytes(head: Iterable[str], lines: Iterable[Sequence[Any]]) -> bytes:
    """Return a table as CSV in UTF-8, with a byte order mark if it has other letters than English ones."""
    text = io.StringIO(newline="")
    csv.writer(text).writerows([head, *lines])
    found = text.getvalue()
    return found.encode("utf-8" if found.isascii() else "utf-8-sig")  # Excel needs the mark
