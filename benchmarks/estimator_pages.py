"""What benchmarks/estimators.py measured, as tables and as a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from exudyn_romerr.report.plots.style import COLOURS, LOOKS

HEADER = f"{'estimator':<26}{'reduction':>10}{'total':>10}{'online us':>14}{'offline ms':>12}"


@dataclass(frozen=True)
class Measured:
    """One estimator on one scene; errors in m, times in s, violation as a share of the output (below 0: none)."""

    name: str
    reduction: float
    total: float
    reduction_error: float
    total_error: float
    violation: float
    offline: float
    online: tuple[float, float]
    curve: tuple[np.ndarray, np.ndarray]

    def __str__(self) -> str:
        online = " / ".join(f"{1e6 * x:.1f}" for x in self.online)
        ratios = f"{figures(self.reduction):>10}{figures(self.total):>10}"
        return f"{self.name:<26}{ratios}{online:>14}{1e3 * self.offline:>12.1f}"


@dataclass(frozen=True)
class Refined:
    """Effectivities on one mesh of the solid bar."""

    coordinates: int
    error: float
    effectivity: dict[str, float]


def figures(ratio: float) -> str:
    """Return three figures, and the third decimal where the ratio is near 1."""
    return f"{ratio:.3f}" if ratio < 10 else f"{ratio:.3g}"


def all_tables(tables: Mapping[str, Sequence[Measured]], meshes: Sequence[Refined]) -> str:
    """Return all tables as text."""
    return "\n\n".join([*(table(title, lines) for title, lines in tables.items()), refinement(meshes)])


def table(heading: str, lines: Sequence[Measured]) -> str:
    """Return the table of one scene; heading: title (samples)."""
    first, worst = lines[0], max(line.violation for line in lines)
    found = "no bound was exceeded" if worst <= 0 else f"largest excess of a true error: {worst:.0e} of the output"
    errors = f"true errors: reduction {first.reduction_error:.2g} m, total {first.total_error:.2g} m; {found}"
    return "\n".join([heading, errors, HEADER, *map(str, lines)])


def refinement(meshes: Sequence[Refined]) -> str:
    """Return the table of meshes."""
    names = list(meshes[0].effectivity)
    lines = [f"{'coordinates':<14}{'true error / m':>16}" + "".join(f"{name:>14}" for name in names)]
    for mesh in meshes:
        ratios = "".join(f"{figures(mesh.effectivity[e]):>14}" for e in names)
        lines.append(f"{mesh.coordinates:<14}{mesh.error:>16.3g}{ratios}")
    return "\n".join(["Solid bar, modal basis n = 12, 10 ms, reconstructed, 40 auxiliary modes", *lines])


def draw(t: np.ndarray, lines: Sequence[Measured], meshes: Sequence[Refined], path: Path) -> None:
    """Draw bounds over time beside the true error, and effectivities over the size of the mesh."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for line in lines:
        e, many = line.name.split(",")[0], "40" in line.name
        style = {"color": COLOURS[e], "linestyle": ":" if many else LOOKS[e][1], "linewidth": 3 if many else 1.5}
        left.semilogy(1e3 * t[1:], line.curve[1][1:], label=line.name, **style)
    error = np.abs(lines[0].curve[0][1:])
    left.semilogy(1e3 * t[1:], error, color=COLOURS["error"], linewidth=0.8, label="true error")
    left.set(xlabel="time / ms", ylabel="tip z, total error / m", ylim=(1e-14, None))
    left.legend(fontsize="x-small", ncols=2, loc="lower left", bbox_to_anchor=(0, 1))
    for i, e in enumerate(meshes[0].effectivity):
        right.loglog(
            [mesh.coordinates for mesh in meshes],
            [mesh.effectivity[e] for mesh in meshes],
            "os^x"[i] + "-",
            color=COLOURS[e],
            label=e,
        )
    right.set(xlabel="coordinates of the mesh", ylabel="largest bound / largest true error")
    right.legend(fontsize="x-small", ncols=2, loc="lower left", bbox_to_anchor=(0, 1))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
