"""Extreme cases: each with its truth, each a valid bound of known sharpness, or a clear refusal.

rows() runs all of them (15 s), table(rows()) is what examples/numerical_stability.py prints. Needs mpmath.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

import exudyn_romerr as romerr
from models import extreme_bodies as bodies
from models import extreme_scenes as scenes

INSTANTS = 25  # at which truth and bound are compared
RATIOS = (1e3, 1e6, 1e9)
WIDTH = 118  # of the table, in characters


@dataclass(frozen=True)
class Case:
    """limit: of the effectivity of the best bound of y. says: words that the report must contain."""

    name: str
    build: Callable[[], scenes.Scene]
    limit: float
    says: str = ""


@dataclass(frozen=True)
class Refusal:
    """build raises one of the package's errors, or returns the report's reason for having no bound."""

    name: str
    build: Callable[[], str]
    says: str


@dataclass(frozen=True)
class Row:
    """What was found. excess: what -> largest true error - bound - round-off over the instants, over its size."""

    case: Case | Refusal
    method: str = ""
    bound: float = np.nan
    error: float = np.nan
    effectivity: float = np.nan
    excess: dict[str, float] = field(default_factory=dict)
    text: str = ""


def cases() -> list[Case | Refusal]:
    small, chain = scenes.small, scenes.chain
    return [
        *(Case(f"omega ratio {r:.0e}, light mass", partial(small, bodies.light_mass(r)), 1.1) for r in RATIOS),
        *(Case(f"omega ratio {r:.0e}, all coupled", partial(small, bodies.graded(r)), 300) for r in RATIOS),
        *(
            Case(f"the same, all modes auxiliary, {r:.0e}", partial(small, bodies.graded(r), auxiliary_modes=6), 1.1)
            for r in RATIOS[:2]
        ),
        *(Case(f"omega ratio {r:.0e}, stiff link", partial(small, bodies.stiff_link(r)), 1.1) for r in RATIOS[:2]),
        Refusal("omega ratio 1e9, stiff link", partial(small, bodies.stiff_link(1e9)), "16 digits hold nothing"),
        Case("soft: 1e-6 of steel", partial(scenes.scaled_linkage, 1e-6), 300),
        Case("near-rigid: 1e6 times steel", partial(scenes.scaled_linkage, 1e6), 50),
        Case("zeta 100 by alpha", partial(chain, 100.0), 1.1),
        Case("zeta 100 by beta", partial(chain, 100.0, "beta"), 1.1),
        Case("zeta 100, two auxiliary modes", partial(chain, 100.0, auxiliary_modes=2), 60),
        Case("undamped, 1e5 periods", partial(chain, periods=1e5, steps=20_000, W=1e-4), 1.1),
        Case("1e6 steps, 1e5 periods", partial(chain, periods=1e5, steps=1_000_000, estimators="auxiliary"), 1.2),
        *(
            Case(f"critical, zeta - 1 = {d:.0e}, by {by}", partial(chain, 1.0 + d, by), 1.1)
            for d in (-1e-12, 0.0, 1e-12)
            for by in ("alpha", "beta")
        ),
        *(
            Case(f"clusters within {d:.0e}, {m} auxiliary", partial(scenes.clusters, d, m), limit)
            for d in (1e-14, 1e-8)
            for m, limit in ((2, 20), (3, 20), (6, 1.1))
        ),
        *(
            Case(f"multiple modes, {m} auxiliary", partial(scenes.multiple, m), x)
            for m, x in ((2, 7), (3, 7), (6, 1.1))
        ),
        Case("N = 1, solved", partial(chain, 0.1, N=1, solved=True), 1.1),
        Case("n = N, solved", partial(chain, 0.1, n=5, solved=True), 1.1),
        Case("n = N, exact samples", partial(chain, 0.1, n=5, time="sampled"), np.inf, "Modes: enough, "),
        Refusal("massless coordinate", partial(small, bodies.massless(False)), r"coordinates \[2\]"),
        Refusal("massless motion", partial(small, bodies.massless(True)), "some motion has no inertia"),
        Case("held by 1e-12 of its stiffness", partial(scenes.held, 1e-12), 60),
        Refusal("held by 1e-16 of its stiffness", partial(scenes.held, 1e-16), "1 rigid-body"),
        Case("beam 1e6 times as long as thick", partial(scenes.beam, 1e6, False), 1.3),
        Case("beam 1e5 times as long, turned", partial(scenes.beam, 1e5, True), 1.3),
        Refusal("frame above the first frequency", scenes.too_fast, "turns faster than the body's lowest frequency"),
        Case("resonance of the mode kept", partial(chain, W=1 + 1e-9, periods=40), 1.1),
        Case("resonance of a mode not kept", partial(chain, W=scenes.resonant(), periods=10), 1.1),
        Case("load of 1e-12 N", partial(chain, 0.01, size=1e-12), 1.1),
        Case("load of 1e12 N", partial(chain, 0.01, size=1e12), 1.1),
        Case("no load, at rest", partial(chain, 0.01, size=0.0), 1.0),
        Case("omega h = 100", partial(scenes.big_steps, 100.0), 3),
        Case("steps of 1e-6..1 s", scenes.uneven, 1.1),
        Case("start far off the basis", scenes.off_the_basis, 1.1),
    ]


def rows() -> list[Row]:
    """Run every case."""
    return [measured(case) for case in cases()]


def measured(case: Case | Refusal) -> Row:
    """Return what was found; errors that are no RomErrError are not caught."""
    if isinstance(case, Case):
        return compared(case, scene := case.build(), scene.report())
    try:
        text = case.build()
    except romerr.RomErrError as error:
        text = str(error)
    return Row(case, text=text)


def compared(case: Case, scene: scenes.Scene, report: romerr.BoundReport) -> Row:
    """Compare the bounds of displacement and velocity with the truth at some instants, the start among them."""
    at = np.unique(np.linspace(0, len(report.t) - 1, INSTANTS).astype(int))
    excess = {}
    for name, x in zip(("y", "v"), scene.truth.motion(report.t[at]), strict=False):
        out, true = report.output(name), x @ scene.row
        bounds = {f"{name} {e}": (out.value, bound) for e, bound in out.bound.items()}
        bounds[f"{name} corrected"] = out.corrected, out.corrected_bound
        size = np.max(np.abs(true), initial=np.finfo(float).tiny)
        for what, (value, bound) in bounds.items():
            beyond = np.abs(true - value[at, 0]) - bound[at, 0] - out.round_off[at, 0]
            excess[what] = float(np.max(beyond) / size)
        if name == "y":
            largest, error = float(np.max(out.bound["best"][at])), float(np.max(np.abs(true - out.value[at, 0])))
    ratio = largest / error if error else 1.0 if largest == 0 else np.inf
    return Row(case, scene.method, largest, error, ratio, excess, str(report))


def table(found: list[Row]) -> str:
    """Return the rows as text: case | truth | bound | true error | effectivity, or the refusal's text."""
    lines = [f"{'case':<40} {'truth':<34} {'bound':>9} {'error':>9} {'bound/error':>11}"]
    return "\n".join(lines + [_line(row) for row in found])


def _line(row: Row) -> str:
    if isinstance(row.case, Refusal):
        return textwrap.fill(f"{row.case.name:<40} refused: {row.text}", WIDTH, subsequent_indent=" " * 41)
    ratio = re.search(row.case.says, row.text)[0] if row.case.says else f"{row.effectivity:.3g}"
    return f"{row.case.name:<40} {row.method:<34} {row.bound:>9.2e} {row.error:>9.2e} {ratio:>11}"
