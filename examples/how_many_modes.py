"""How many modes does a connecting rod need? choose_modes finds out in at most four simulations, and proves it.

    python examples/how_many_modes.py [FOLDER]     prints what was tried, writes FOLDER/how_many_modes.png (40 s)

FOLDER is examples/results if left out. The rod of a slider crank, 0.4 m of steel, with 6 static modes and n
eigenmodes. The middle of the rod is to be right within 1 % of its largest displacement, then within 0.2 %. The true
errors are differences to a run with all modes and the same time steps.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from matplotlib.figure import Figure

import exudyn_romerr as romerr
from exudyn_romerr.report.plots.style import COLOURS, WIDE
from models import mechanisms

NAME = "middle of the rod"
TOLERANCES = (1e-2, 2e-3)  # of the largest displacement
MOST = 16  # eigenmodes
SHOWN = (0, 1, 2, 4, 6, 8, 10, 12, 14, 16)  # true errors in the picture
STEP = 2.5e-4  # s
RESULTS = Path(__file__).resolve().parent / "results"


def scene_of(n: int, kind: str, t_end: float) -> mechanisms.MechanismScene:
    return mechanisms.slider_crank(n, kind, h=STEP, t_end=t_end)


def builder(t_end: float):
    """Return what choose_modes asks for: n -> (mbs, monitor, simulationSettings)."""

    def build(n: int) -> tuple:
        scene = scene_of(n, "RBE3", t_end)
        flex = romerr.floating_body(scene.fem, scene.bodies[0])
        output = romerr.node_displacement(NAME, node=mechanisms.MIDDLE, unit="m")
        return scene.mbs, romerr.attach(scene.mbs, flex, outputs=[output]), scene.settings

    return build


def displacement(n: int, kind: str, t_end: float) -> np.ndarray:
    """Simulate without bounds; return the middle's displacement (T, 3) in the rod's frame."""
    scene = scene_of(n, kind, t_end)
    scene.solve()
    return scene.mbs.GetSensorStoredData(scene.sensors["middle 1 local"])[:, 1:]


def true_errors(counts: tuple[int, ...], t_end: float) -> list[float]:
    """Return the largest error with each number of eigenmodes."""
    truth = displacement(0, "complete", t_end)
    return [float(np.max(np.abs(truth - displacement(n, "RBE3", t_end)))) for n in counts]


def draw(choices: list[romerr.ModeChoice], errors: tuple, path: Path) -> None:
    """Draw bounds, forecasts and true errors against the number of eigenmodes."""
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    axes = figure.subplots()
    first = choices[0].tried[0]
    ladder = np.arange(MOST + 1)
    forecast = [first.expected(range(n))[NAME] for n in ladder]
    label = f"forecast from the run with {first.n} modes"
    axes.semilogy(ladder, 1e6 * np.array(forecast), "--", color=COLOURS["convolution"], label=label)
    tried = {run.n: run.bound[NAME] for choice in choices for run in choice.tried}
    style = {"ls": "none", "marker": "o", "ms": 11, "mfc": "none", "mew": WIDE, "color": COLOURS["auxiliary"]}
    axes.semilogy(list(tried), 1e6 * np.array(list(tried.values())), label="bound, runs of choose_modes", **style)
    counts, true = errors
    axes.semilogy(
        counts, 1e6 * np.array(true), "x", color=COLOURS["error"], label="|true error|: all modes less these"
    )
    for choice, share in zip(choices, TOLERANCES, strict=True):
        limit = 1e6 * choice.chosen.tolerance[NAME]
        axes.axhline(limit, color="black", lw=0.8, ls=":")
        words = f"{100 * share:g} %: {choice.n} modes"
        axes.annotate(words, (0, limit), xytext=(0, 3), textcoords="offset points", fontsize="small")
    axes.set(xlabel="eigenmodes beside 6 static modes", ylabel="largest reduction error / µm")
    axes.set_title(f"{NAME}; dotted: tolerances, in % of its largest displacement")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper right")
    figure.savefig(path, dpi=150)


def main(
    folder: str | Path = RESULTS, t_end: float = 0.06, shown: tuple[int, ...] = SHOWN
) -> list[romerr.ModeChoice]:
    """Print what was tried for both tolerances, save the picture; return the choices."""
    build = builder(t_end)
    choices = [romerr.choose_modes(build, share, relative=True, most=MOST) for share in TOLERANCES]
    errors = shown, true_errors(shown, t_end)
    for share, choice in zip(TOLERANCES, choices, strict=True):
        print(f"within {100 * share:g} %: {choice}")
    for n, error in zip(*errors, strict=True):
        print(f"{n} eigenmodes: true error {error:.3g} m")
    Path(folder).mkdir(parents=True, exist_ok=True)
    draw(choices, errors, Path(folder) / "how_many_modes.png")
    return choices


if __name__ == "__main__":
    main(*sys.argv[1:2])
