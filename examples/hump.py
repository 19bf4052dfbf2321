"""The hump: why first-order error estimators fail for mechanics (figures 2 and 3 of the paper).

A one-mass oscillator, k = 10 N/m, d = 0.2 N s/m. The lighter the mass, the higher its frequency, and the higher rises
the norm of its fundamental matrix Phi(t) before it decays. All of that comes from the entry Phi21; Phi12, which the
second-order estimators use, falls instead.

    python examples/hump.py
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from matplotlib.figure import Figure

from exudyn_romerr.linalg import oscillator as closed_form
from models import oscillator

MASSES = (10.0, 1.0, 0.1, 0.01, 0.001, 0.0001)  # kg; the last one is overdamped
STIFFNESS, DAMPING = 10.0, 0.2  # N/m, N s/m
TIMES = np.geomspace(1e-5, 20, 4000)  # s
# One hue from light to dark: the masses are an ordered quantity, told apart in grey print too
COLOURS = ("#9ecae1", "#6baed6", "#4292c6", "#2171b5", "#084594", "#000000")
STYLES = ("-", "--", "-", "--", "-", ":")


def frequency_and_damping(m: float) -> tuple[float, float]:
    """Return omega in rad/s and zeta."""
    omega = np.sqrt(STIFFNESS / m)
    return omega, DAMPING / (2 * m * omega)


def fundamental_matrix(m: float, t: np.ndarray) -> np.ndarray:
    """Return Phi(t) of (18), (T, 2, 2), in SI units."""
    omega, zeta = frequency_and_damping(m)
    s = closed_form.impulse_response(omega, zeta, t)
    p = closed_form.step_release(omega, zeta, t)
    return np.stack([p, s, -(omega**2) * s, p - 2 * zeta * omega * s], axis=-1).reshape(-1, 2, 2)


def suprema(m: float) -> tuple[float, float, float]:
    """Return the suprema over time of |Phi12| in s, |Phi21| in 1/s, and C1 >= |Phi|."""
    constants = oscillator.build(m, STIFFNESS, DAMPING).constants()
    return constants.C12, frequency_and_damping(m)[0] ** 2 * constants.C12, constants.C1


def print_suprema() -> None:
    """Print them for all masses."""
    print(
        f"{'m / kg':>8}{'omega / (rad/s)':>17}{'zeta':>9}{'max|Phi12| / s':>16}{'max|Phi21| / (1/s)':>20}{'C1':>10}"
    )
    for m in MASSES:
        omega, zeta = frequency_and_damping(m)
        s, hump, C1 = suprema(m)
        print(f"{m:8g}{omega:17.4g}{zeta:9.4g}{s:16.4g}{hump:20.4g}{C1:10.4g}")


def draw(path: Path) -> None:
    """Draw |Phi(t)| and Phi21(t) of all masses."""
    figure = Figure(figsize=(7.2, 7.2), layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True)
    for m, colour, style in zip(MASSES, COLOURS, STYLES, strict=True):
        Phi = fundamental_matrix(m, TIMES)
        top.plot(TIMES, np.linalg.norm(Phi, 2, axis=(1, 2)), style, color=colour, label=f"m = {m:g} kg")
        bottom.plot(TIMES, Phi[:, 1, 0], style, color=colour, label=f"m = {m:g} kg")
    top.set(ylabel="|Phi(t)| (2-norm, SI units)", yscale="log", ylim=(1e-2, 2e2), xlim=(TIMES[0], TIMES[-1]))
    bottom.set(xlabel="t / s", ylabel="Phi21(t) / (1/s)", xscale="log")
    for ax in (top, bottom):
        ax.grid(alpha=0.3)
        ax.legend(fontsize=8, loc="lower left")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)
    print(f"saved {path}")


def main(arguments: list[str] | None = None) -> None:
    """Print the suprema and draw the figures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--output", type=Path, default=Path(__file__).resolve().parent / "results")
    options = parser.parse_args(arguments)
    print_suprema()
    draw(options.output / "hump.png")


if __name__ == "__main__":
    main()
