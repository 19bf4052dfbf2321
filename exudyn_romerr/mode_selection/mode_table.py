"""ModeTable: which coordinate of a reduced body is which, and what it does; as text, CSV and HTML.

Without any run there are frequencies, effective masses, damping.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from html import escape
from itertools import chain, zip_longest
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy.linalg as la

from ..report.formats.atomic_write import write_whole
from ..report.formats.html_page import document, html_table, paragraph
from ..report.verdict_text import aligned
from ..report.wording import digits, percent, rounded_up, with_unit

if TYPE_CHECKING:
    import os

    from ..model.body import ElasticBody
    from .without_modes import InRun

ALONE = "Each coordinate alone, in the order of the body's; effective mass beside those before it"
HELD = "Frequencies of the body as it is held in its frame; of the full model none is missed (Sylvester's law)"
WITHOUT = "About what errors of sensors would grow by, at most, without the coordinate, to first order"
LACKS = "Not there, the lowest of the full body: {}."
MISSED = "Missed most in the run: {} of the strain energy that is missed; the rest is in others."
MOST, MUCH = 5, 10.0  # modes that are named; a relative difference of which no percentage is told
MISSING = 0.1  # of a mode's mass: one of which the basis lacks more is told to be missing
MORE = 6  # modes of the full body that are looked at beside as many as the basis has
LITTLE = 0.01  # of the strain energy that is missed: less is not told
TINY = np.finfo(float).tiny
Share = tuple[int, float, float]  # number of a mode from 0, rad/s, share


class Column(NamedTuple):
    """Head, a value a line, and how one is printed."""

    head: str
    values: Sequence
    said: Callable[[Any], str] = str


@dataclass(frozen=True)
class ModeTable:
    """What is known of the n coordinates of a reduced body; print() it.

    Attributes
    ----------
    name : of the body
    kinds : (n,) texts, "static, interface 2 ('right'), displacement x", "eigenmode 1"
    why : why there are so many, and which interface was left out
    coordinates : .omega (n,) rad/s, .zeta (n,), .mass (n, 3), effective, shares of the body's by direction
    frequencies : .reduced, .full (n,) rad/s, .off, .within (n,): relative difference and how far off it may be;
        .missing, .missed: (number, rad/s, share) of modes of the full body that are not there. None: not known
    in_run : .energy (n,), .sensors {name: (unit, (n,))}; None: no report was given
    notes : what is not known, and why
    """

    name: str
    kinds: Sequence[str]
    why: str
    coordinates: Coordinates
    frequencies: Frequencies | None
    in_run: InRun | None
    notes: Sequence[str]

    def blocks(self) -> Iterator[tuple[str, list[Column]]]:
        """Yield tables: caption, columns."""
        of, run, numbers = self.coordinates, self.in_run, Column("coordinate", range(len(self.kinds)))
        columns = [
            numbers,
            Column("is", self.kinds),
            Column("alone [Hz]", of.omega / (2 * np.pi), partial(digits, count=4)),
        ]
        columns += [] if of.zeta is None else [Column("damping", of.zeta, _ratio)]
        for what, x in () if of.mass is None else (("mass", of.mass), ("sum", np.cumsum(of.mass, axis=0))):
            columns += [Column(f"{what} {axis}", x[:, i], _share) for i, axis in enumerate("xyz")]
        yield ALONE, columns + ([] if run is None else [Column("strain energy", run.energy, _share)])
        if self.frequencies is not None:
            yield HELD, _of_modes(self.frequencies)
        if run is not None and run.sensors:
            grown = [Column(name, x, lambda x, unit=unit: _grown(x, unit)) for name, (unit, x) in run.sensors.items()]
            yield WITHOUT, [numbers, *grown]

    def tables(self) -> list[tuple[str, tuple[str, ...], list[tuple[str, ...]]]]:
        """Return caption, head and lines of all tables, as texts."""
        return [
            (title, tuple(c.head for c in of), [*zip(*(map(c.said, c.values) for c in of), strict=True)])
            for title, of in self.blocks()
        ]

    def lines(self) -> list[str]:
        """Return what stands below: modes that are not there, what is not known."""
        of = self.frequencies
        if of is None:
            return [*self.notes]
        lacks = [f"{_mode(k, w)} ({percent(x)} of it)" for k, w, x in of.missing]
        missed = [f"{_mode(k, w)} {percent(x)}" for k, w, x in of.missed]
        found = [text.format(", ".join(x[:MOST])) for text, x in ((LACKS, lacks), (MISSED, missed)) if x]
        return [*found, *self.notes]

    def __str__(self) -> str:
        tables = (["", f"{title}:", *aligned([head, *rows])] for title, head, rows in self.tables())
        return "\n".join([f"{self.name}: {self.why}.", *chain(*tables), "", *self.lines()]).rstrip()

    def save(self, path: str | os.PathLike) -> None:
        """Write it: .csv with all digits, a line for each coordinate (mode k of the body in line k), or .html.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        write_tables([self], path)


def _of_modes(of: Frequencies) -> list[Column]:
    hertz = zip(("reduced [Hz]", "full [Hz]"), (of.reduced, of.full), strict=True)
    columns = [Column("mode", range(1, len(of.off) + 1))]
    columns += [Column(head, x / (2 * np.pi), partial(digits, count=5)) for head, x in hertz]
    columns.append(Column("off by at most", np.abs(of.off) + of.within, _off))
    columns += [] if of.zeta is None else [Column("mode's damping", of.zeta, _ratio)]
    return [*columns, Column("mainly coordinate", of.mainly)]


def write_tables(tables: Sequence[ModeTable], path: str | os.PathLike) -> None:
    """Write tables of bodies into one file: .csv, or else HTML; InputError if it cannot be written."""
    text = _csv(tables) if str(path).lower().endswith(".csv") else _page(tables)
    write_whole(path, lambda stream: stream.write(text.encode("utf-8")))


def _csv(tables: Sequence[ModeTable]) -> str:
    of = [
        {c.head: np.asarray(c.values).tolist() for _, columns in table.blocks() for c in columns} for table in tables
    ]
    names, stream = list(dict.fromkeys(name for one in of for name in one)), io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow(["body", *names])
    for table, one in zip(tables, of, strict=True):
        rows = zip_longest(*(one.get(name, []) for name in names), fillvalue="")
        writer.writerows([table.name, *row] for row in rows)
    return stream.getvalue()


def _page(tables: Sequence[ModeTable]) -> str:
    parts = []
    for of in tables:
        parts += [f"<h1>Modes of {escape(of.name)}</h1>", paragraph(f"{of.why}.")]
        parts += [html_table(title, head, *rows, kind="numbers") for title, head, rows in of.tables()]
        parts += map(paragraph, of.lines())
    return document("Modes", parts)


def _ratio(x: float) -> str:
    return percent(x) or "over 10"


def _off(x: float) -> str:
    return f"{rounded_up(100 * x, 2)} %" if x < MUCH else "more than 10 times"


def _grown(x: float, unit: str) -> str:
    return with_unit(digits(x, 2), unit) if np.isfinite(x) else "more than it shows"


def _share(x: float) -> str:
    return f"{100 * x:.2f} %".replace("-0.00", "0.00")


def _mode(k: int, omega: float) -> str:
    return f"mode {k + 1} at {digits(omega / (2 * np.pi), 4)} Hz"


# --- what is known of coordinates without any run ---


@dataclass(frozen=True)
class Coordinates:
    """Each of n coordinates alone: omega (n,) rad/s, zeta (n,), None: not known; mass (n, 3) by direction.

    mass : effective, as shares of the body's, of what a coordinate adds to those before it; None: not known.
    """

    omega: np.ndarray
    zeta: np.ndarray | None
    mass: np.ndarray | None


@dataclass(frozen=True)
class Frequencies:
    """Modes of the reduced body beside those of the full one, both as they are held in the frame, lowest first.

    reduced, full (n,) rad/s; zeta (n,) or None. off (n,) : reduced / full - 1; within (n,) : how far off that may be.
    mainly (n,) : the coordinate with the largest share of the mode's strain energy.
    missing : (number, rad/s, share of it) of modes of the full body that the basis lacks, lowest first.
    missed : (number, rad/s, share of the strain energy missed in a run), largest first.
    """

    reduced: np.ndarray
    full: np.ndarray
    zeta: np.ndarray | None
    off: np.ndarray
    within: np.ndarray
    mainly: np.ndarray
    missing: Sequence[Share]
    missed: Sequence[Share] = ()


def coordinates_of(
    V: np.ndarray, mass: Any, stiffness: Any, D: np.ndarray | None, directions: np.ndarray | None
) -> Coordinates:
    """Return what is known of coordinates, V (N, n).

    mass, stiffness : (N, N). D (n, n), of the reduced body, directions (N, 3), unit translations : None: not known.
    """
    carried = mass @ V
    m, k = (np.einsum("ij,ij->j", V, x) for x in (carried, stiffness @ V))
    omega = np.sqrt(np.maximum(k, 0.0) / m)
    zeta = None if D is None else np.diag(D) / np.maximum(2 * omega * m, TINY)
    share = None
    if directions is not None:
        size = np.sqrt(m)
        lower = la.cholesky(V.T @ carried / size / size[:, None], lower=True)
        total = np.einsum("ij,ij->j", directions, mass @ directions)
        share = la.solve_triangular(lower, (carried / size).T @ directions, lower=True) ** 2 / total
    return Coordinates(omega, zeta, share)


def frequencies_of(body: ElasticBody, V: np.ndarray, W: np.ndarray, D: np.ndarray | None) -> Frequencies:
    """Return frequencies of the body, held, and of its reduction by V, W (n_free, n).

    The full ones are proved: Sylvester's law of inertia finds none missed, and of a pair with theta = omega^2 there
    is an eigenvalue with |theta / lambda - 1| <= |K x - theta M x|_{K^-1} / |x|_K (Bauer and Fike's theorem for the
    symmetric K^-1/2 M K^-1/2).

    Raises
    ------
    AssumptionError
        A mode was missed.
    """
    M, K = W.T @ (body.M @ V), W.T @ (body.K @ V)
    if W is V:
        inverse, shapes = la.eigh(M, K)
        left = shapes
    else:
        inverse, left, shapes = (np.real(x) for x in la.eig(M, K, left=True))
    order = np.argsort(-inverse)
    left, shapes, reduced = left[:, order], shapes[:, order], 1 / np.sqrt(np.maximum(inverse[order], TINY))
    n = len(reduced)
    modes = body.modes(min(n + MORE, body.free.size))
    full, X = modes.omega, modes.shapes
    within = residual_share(body, X, full)[:n]
    energy = np.abs(shapes * (K @ shapes))
    zeta = None
    if D is not None:
        m, d = (np.einsum("ik,ij,jk->k", left, x, shapes) for x in (M, D))
        zeta = d / (2 * reduced * m)
    size = np.sqrt(np.einsum("ij,ij->j", V, body.M @ V))
    gram, seen = V.T @ (body.M @ V) / size / size[:, None], (V / size).T @ (body.M @ X)
    lacks = 1 - np.einsum("ik,ik->k", seen, la.solve(gram, seen, assume_a="pos"))
    missing = [(int(k), float(full[k]), float(lacks[k])) for k in np.flatnonzero(lacks > MISSING)]
    return Frequencies(reduced, full[:n], zeta, reduced / full[:n] - 1, within, energy.argmax(axis=0), missing)


def residual_share(body: ElasticBody, X: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Return |K x - omega^2 M x|_{K^-1} / |x|_K of columns of X (n_free, k)."""
    factor = body.stiffness_factor
    left = factor.half_solve(body.K @ X - (body.M @ X) * omega**2)
    return np.linalg.norm(left, axis=0) / np.linalg.norm(factor.half_multiply(X), axis=0)


def missed_modes(body: ElasticBody, count: int, P: np.ndarray, squares: np.ndarray) -> list[Share]:
    """Return (number, rad/s, share) of the lowest modes by their share of the strain energy of an error P x.

    P (n_free, m) : vectors beside the modes of the basis. squares (m, m) : sum of x x^T over the run.
    """
    modes = body.modes(min(count, body.free.size))
    seen = modes.shapes.T @ (body.M @ P)
    energy = modes.omega**2 * np.einsum("ki,ij,kj->k", seen, squares, seen)
    total = np.einsum("ij,ij->", P.T @ (body.K @ P), squares)
    order = np.argsort(-energy)
    return [(int(k), float(modes.omega[k]), float(energy[k] / total)) for k in order if energy[k] > LITTLE * total]
