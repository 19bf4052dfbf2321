"""What benchmarks/estimators.py measured, as a Markdown page and as a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from exudyn_romerr.report.plots.style import COLOURS, STYLES

COVERS = {
    "state-space": "initial error; grows with the run",
    "fast": "initial error; grows with the run",
    "convolution": "initial error; forgets (Rayleigh damping)",
    "energy": "initial error, load jumps; forgets if damping reaches every mode",
    "auxiliary": "as energy; gives a corrected output too",
}
INTRODUCTION = """\
Made by `python benchmarks/estimators.py`

# All estimators side by side

Effectivity is the largest bound over the largest true error of the output, over the whole run; 1 is perfect.
*Reduction*: exact reduced motion, `time="sampled"`. *Total*: trapezoidal rule, `time="reconstructed"`, against the
exact motion of the full body. Online: CPU time per step of the whole online part (one thread, median), sampled /
reconstructed; the reconstructed one is the default and evaluates the sampled residual as well. Offline: CPU time of
everything done once, on a body whose matrices are factorised and whose modes are not known yet. Every estimator
bounds displacements, velocities and outputs of a linear body in the M-norm; with `time="reconstructed"` every one of
them covers the error of the time integration too.
"""
HEADER = """\
| estimator | reduction | total | online / us | offline / ms | assumes | covers |
|---|---|---|---|---|---|---|"""


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
    assumes: str
    curve: tuple[np.ndarray, np.ndarray]

    def __str__(self) -> str:
        online = " / ".join(f"{1e6 * x:.1f}" for x in self.online)
        covers = COVERS.get(self.name.split(",")[0], "")
        ratios = f"{figures(self.reduction)} | {figures(self.total)}"
        return f"| {self.name} | {ratios} | {online} | {1e3 * self.offline:.1f} | {self.assumes} | {covers} |"


@dataclass(frozen=True)
class Refined:
    """Effectivities on one mesh of the solid bar."""

    coordinates: int
    error: float
    effectivity: dict[str, float]


def figures(ratio: float) -> str:
    """Return three figures, and the third decimal where the ratio is near 1."""
    return f"{ratio:.3f}" if ratio < 10 else f"{ratio:.3g}"


def page(tables: Mapping[str, Sequence[Measured]], meshes: Sequence[Refined]) -> str:
    """Return the whole page."""
    parts = [INTRODUCTION, *(table(title, lines) for title, lines in tables.items()), refinement(meshes)]
    return "\n".join(parts)


def table(heading: str, lines: Sequence[Measured]) -> str:
    """Return the table of one scene; heading: title (samples)."""
    title, samples = heading.rstrip(")").split(" (")
    first, worst = lines[0], max(line.violation for line in lines)
    found = "No bound was exceeded" if worst <= 0 else f"Largest excess of a true error: {worst:.0e} of the output"
    return (
        f"## {title}\n\n{samples.capitalize()}. True errors: reduction {first.reduction_error:.2g} m, "
        f"total {first.total_error:.2g} m. {found} (truths are rounded at 1e-10; sampled residuals are blind between "
        "samples).\n\n" + "\n".join([HEADER, *map(str, lines)]) + "\n"
    )


def refinement(meshes: Sequence[Refined]) -> str:
    """Return the table of meshes."""
    names = list(meshes[0].effectivity)
    lines = [
        " | ".join([f"| {mesh.coordinates}", f"{mesh.error:.3g}", *(figures(mesh.effectivity[e]) for e in names)])
        + " |"
        for mesh in meshes
    ]
    return (
        "## Mesh refinement\n\nSolid bar, modal basis n = 12, 10 ms, reconstructed, 40 auxiliary modes. Energy norms "
        "do not see the mesh;\nthe M-norm of a load or output grows with every refinement.\n\n"
        f"| coordinates | true error / m | {' | '.join(names)} |\n|{'---|' * (len(names) + 2)}\n"
        + "\n".join(lines)
        + "\n\n![bounds on the solid bar](figures/estimators.png)\n"
    )


def draw(t: np.ndarray, lines: Sequence[Measured], meshes: Sequence[Refined], path: Path) -> None:
    """Draw bounds over time beside the true error, and effectivities over the size of the mesh."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for line in lines:
        e, many = line.name.split(",")[0], "40" in line.name
        style = {"color": COLOURS[e], "linestyle": ":" if many else STYLES[e], "linewidth": 3 if many else 1.5}
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
