"""Norms of the fundamental matrix of the stabiliser linkage, and what they cost (figure 8 of the paper).

The matrix exponential of the full model is the paper's reference; the kernels of this package need no exponential.

    python examples/fundamental_matrix_norms.py [--full]      --full: the exponential at all 201 instants
"""

import argparse
import os
import sys
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # comparable times; on a shared machine shorter ones too

import numpy as np
from matplotlib.figure import Figure

import exudyn_romerr as romerr
from exudyn_romerr.linalg import oscillator
from exudyn_romerr.linear.residual.kernels import CertifiedKernel, EnvelopeKernel, Kernel, SpectrumKernel
from exudyn_romerr.report.plots.style import COLOURS
from models import linkage
from models.matrix_exponential import fundamental_matrix_norms

TIMES = np.linspace(0, 2, 201)  # s, where the paper takes the exponential
DRAWN = np.linspace(0, 0.5, 2001)  # s
FEW = 5  # exponentials in the quick run


def fresh_body() -> romerr.ElasticBody:
    """Return the linkage with nothing computed yet but the factors of M and K, which every estimator needs."""
    return linkage.build()[0]


def certified_without_omega_1() -> tuple[float, Kernel]:
    """Return the time to build the certified kernel of a body whose lowest frequency is known, and the kernel."""
    body = fresh_body()
    body.modes(1)
    return timed(lambda: CertifiedKernel(body))


def timed(function) -> tuple[float, object]:
    """Return wall time in s and the result."""
    begin = perf_counter()
    result = function()
    return perf_counter() - begin, result


def exponential_seconds(count: int) -> tuple[float, object]:
    """Return the time of the exponential at all of TIMES, extrapolated from count of them, and its norms."""
    times = TIMES[np.linspace(0, len(TIMES) - 1, count).astype(int)]
    body = fresh_body()
    seconds, norms = timed(lambda: fundamental_matrix_norms(body, times))
    return seconds * len(TIMES) / count, norms


def build_times(repeats: int = 9) -> dict[str, tuple[float, float]]:
    """Return the offline time of every kernel: (constants C11 and C12, curves at TIMES as well), in s, medians."""

    def measure(make) -> tuple[float, float]:
        samples = []
        for _ in range(repeats):
            seconds, kernel = make()
            samples.append((seconds, seconds + timed(lambda k=kernel: (k.phi11(TIMES), k.phi12(TIMES)))[0]))
        return tuple(np.median(samples, axis=0))

    def from_scratch(kind):
        body = fresh_body()
        return timed(lambda: kind(body))

    return {
        "spectrum, all 114 modes": measure(lambda: from_scratch(SpectrumKernel)),
        "envelope of mode 1": measure(lambda: from_scratch(EnvelopeKernel)),
        "certified": measure(lambda: from_scratch(CertifiedKernel)),
        "certified, omega_1 known": measure(certified_without_omega_1),
    }


def print_times(exponential: float, count: int, kernels: dict[str, tuple[float, float]]) -> None:
    """Print offline times side by side, with the ratio to the matrix exponential."""
    how = "all computed" if count == len(TIMES) else f"extrapolated from {count}"
    print(f"{'offline time':<30}{'C11, C12 / s':>14}{'ratio':>10}{'with curves / s':>18}{'ratio':>10}")
    print(f"{'matrix exponential':<30}{exponential:14.4g}{1:10d}{exponential:18.4g}{1:10d}")
    for name, (constants, curves) in kernels.items():
        ratios = (exponential / constants, exponential / curves)
        print(f"{name:<30}{constants:14.4g}{ratios[0]:10.0f}{curves:18.4g}{ratios[1]:10.0f}")
    print(f"matrix exponential: {len(TIMES)} instants, {how}, {1e3 * exponential / len(TIMES):.3g} ms each")


def largest_difference(norms) -> float:
    """Return how far the exponential's |Phi11|, |Phi12| are from those of the spectrum, relative to their maxima."""
    kernel = SpectrumKernel(fresh_body())
    pairs = ((kernel.phi11(norms.t), norms.Phi11), (kernel.phi12(norms.t), norms.Phi12))
    return max(np.max(np.abs(a - b)) / np.max(a) for a, b in pairs)


def draw(path: Path) -> None:
    """Draw |Phi11|_M and |Phi12|_M: spectrum, mode 1, its envelope, certified bound."""
    body = fresh_body()
    omega = body.modes(1).omega[0]
    zeta = body.damping_ratios(omega)
    modes = {
        "Phi11": oscillator.step_release(omega, zeta, DRAWN),
        "Phi12": oscillator.impulse_response(omega, zeta, DRAWN),
    }
    kinds = {"spectrum": SpectrumKernel, "envelope": EnvelopeKernel, "certified": CertifiedKernel}
    kernels = {name: kind(body) for name, kind in kinds.items()}
    figure = Figure(figsize=(7.2, 6.4), layout="constrained")
    for ax, block in zip(figure.subplots(2, 1, sharex=True), modes, strict=True):
        curves = {name: getattr(kernel, block.lower())(DRAWN) for name, kernel in kernels.items()}
        ax.plot(DRAWN, curves["spectrum"], color="#000000", lw=1, label="full model (spectrum)")
        ax.plot(DRAWN, np.abs(modes[block]), ":", color=COLOURS["error"], label="mode 1 alone")
        ax.plot(DRAWN, curves["certified"], "-", color=COLOURS["fast"], lw=4, zorder=0, label="certified bound")
        ax.plot(DRAWN, curves["envelope"], "--", color=COLOURS["convolution"], label="envelope of mode 1")
        ax.set(ylabel=f"|{block}|_M" + (" / s" if block == "Phi12" else ""), ylim=(0, None))
        ax.grid(alpha=0.3)
    ax.set(xlabel="t / s", xlim=(0, DRAWN[-1]))
    ax.legend(fontsize=8, loc="lower right", ncols=2, framealpha=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    print(f"saved {path}")


def main(arguments: list[str] | None = None, few: int = FEW) -> None:
    """Time the kernels and the exponential, draw figure 8."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--full", action="store_true", help="matrix exponential at all 201 instants")
    parser.add_argument("--output", type=Path, default=Path(__file__).resolve().parent / "results")
    options = parser.parse_args(arguments)
    count = len(TIMES) if options.full else few
    seconds, norms = exponential_seconds(count)
    print_times(seconds, count, build_times())
    print(f"|Phi11|, |Phi12|: exponential and spectrum agree to {largest_difference(norms):.1e} of their maxima")
    draw(options.output / "fundamental_matrix_norms.png")


if __name__ == "__main__":
    main()
