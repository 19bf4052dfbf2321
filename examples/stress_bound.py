"""Stress of the clamped bar where it is largest: how wrong it is, and how many modes it needs.

    python examples/stress_bound.py [FOLDER]     prints bounds and true errors, writes FOLDER/stress_bound.png (20 s)

FOLDER is examples/results if left out. Quadratic tetrahedra, 6 static modes and 0 to 16 eigenmodes. The truth has all
927 modes, each solved exactly.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from exudyn.FEM import KirchhoffMaterial
from matplotlib.figure import Figure

import exudyn_romerr as romerr
from exudyn_romerr.linalg.oscillator import impulse_response, step_release
from exudyn_romerr.report.plots.style import COLOURS, WIDE
from models import floating
from models.beam3d import STEEL

STEP = 2e-5  # s
FINE = 20  # pieces of a step on which the truth takes the load as linear
EIGENMODES = (0, 4, 8, 16)
SHOWN = 4  # of these, in the picture of the stress over time
MORE_MODES = 200  # auxiliary ones: stress needs more than the 60 at which "auto" stops
MATERIAL = KirchhoffMaterial(STEEL.youngs_modulus, STEEL.poisson_ratio, STEEL.density)
RESULTS = Path(__file__).resolve().parent / "results"


def full_model(fem) -> tuple[romerr.ElasticBody, np.ndarray]:
    """Return the bar with all modes, and its loads: forces in x, y, z on the right face, weight."""
    held = romerr.mean_motion(*floating.interface(fem, "left"))
    body = romerr.ElasticBody.from_fem(fem, rayleigh=floating.RAYLEIGH, reference=held)
    nodes, weights = floating.interface(fem, "right")
    pull = np.zeros((len(body.positions), 3, 4))
    pull[nodes, :, :3] = weights[:, None, None] * np.eye(3)
    loads = pull.reshape(-1, 4)
    loads[:, 3] = body.mass @ np.tile(floating.GRAVITY, len(body.positions))
    return body, loads


def exact_motion(body: romerr.ElasticBody, loads: np.ndarray, steps: int) -> np.ndarray:
    """Return the displacements (steps + 1, N) of the full model from rest, by closed forms of its modes."""
    modes = body.modes(body.free.size)
    omega, zeta, h = modes.omega, body.damping_ratios(modes.omega), STEP / FINE
    s, p = impulse_response(omega, zeta, h), step_release(omega, zeta, h)
    force = [[*floating.ramped_force(h * i), 1.0] for i in range(steps * FINE + 1)]
    force = np.array(force) @ (modes.shapes.T @ body.space.loads(loads)).T / omega**2
    x, v = np.zeros((2, omega.size))
    kept = [x]
    for i, now in enumerate(force[:-1], start=1):
        slope = (force[i] - now) / h
        offset = now - 2 * zeta / omega * slope
        x, v = x - offset, v - slope
        x, v = p * x + s * v + offset + h * slope, (p - 2 * zeta * omega * s) * v - omega**2 * s * x + slope
        kept += [x] if i % FINE == 0 else []
    return np.array(kept) @ body.expand(modes.shapes).T


def most_loaded(fem, q: np.ndarray) -> int:
    """Return the node with the largest stress xx of displacements q (N,)."""
    stress = [romerr.node_stress("s", node=i, fem=fem, material=MATERIAL, component="xx") for i in range(len(q) // 3)]
    return int(np.argmax([abs(out.rows @ q) for out in stress]))


def simulate(n: int, node: int, t_end: float) -> romerr.BoundReport:
    """Run the bar with 6 static modes and n eigenmodes; bounds of a displacement and of the stress at a node."""
    scene = floating.clamped_bar(n, body="bar_fine", h=STEP, t_end=t_end)
    tip = int(floating.interface(scene.fem, "tip")[0][0])
    outputs = [
        romerr.node_displacement("tip z", node=tip, component="z"),
        romerr.node_stress("stress", node=node, fem=scene.fem, material=MATERIAL),  # xx, yy, zz, yz, xz, xy
    ]
    flex = romerr.floating_body(scene.fem, scene.items)
    monitor = romerr.attach(scene.mbs, flex, outputs=outputs, auxiliary_modes=MORE_MODES)
    scene.solve()
    return monitor.report()


def share(out: romerr.OutputReport, bound: np.ndarray) -> float:
    """Return the largest bound of the first row as a share of the largest value."""
    return np.max(bound[:, 0]) / np.max(np.abs(out.value[:, 0]))


def draw(reports: dict[int, romerr.BoundReport], truth: np.ndarray, path: Path) -> None:
    """Draw the von Mises stress, its error and bound over time; shares of error over the number of modes."""
    figure = Figure(figsize=(11, 6.2), layout="constrained")
    parts = figure.subplot_mosaic([["signal", "modes"], ["error", "modes"]], height_ratios=(0.8, 1))
    report = reports[SHOWN]
    t, mises = 1e3 * report.t, romerr.von_mises(report, "stress")
    parts["signal"].plot(t, 1e-6 * mises.value, color=COLOURS["value"])
    parts["signal"].set(title=f"von Mises stress, 6 + {SHOWN} modes", ylabel="MPa")
    error = np.abs(truth - mises.value)
    parts["error"].semilogy(t[1:], 1e-6 * mises.bound[1:], color=COLOURS["auxiliary"], lw=WIDE, label="bound")
    parts["error"].semilogy(t[1:], 1e-6 * error[1:], color=COLOURS["error"], lw=1, label="|true error|")
    parts["error"].set(xlabel="t / ms", ylabel="MPa", ylim=(1e-4, None), title="its error")
    for name, colour, style in (("stress", "auxiliary", "o-"), ("tip z", "convolution", "s--")):
        outs = [report.output(name) for report in reports.values()]
        shares = [100 * share(out, out.reduction_bound["best"]) for out in outs]
        label = {"stress": "stress xx", "tip z": "displacement of the tip"}[name]
        parts["modes"].semilogy(list(reports), shares, style, color=COLOURS[colour], label=label)
    parts["modes"].set(xlabel="eigenmodes, beside 6 static modes", ylabel="% of the largest value")
    parts["modes"].set(title="bound of the reduction error", xticks=list(reports))
    for axes in parts.values():
        axes.grid(alpha=0.3)
    parts["error"].legend(loc="lower right")
    parts["modes"].legend()
    figure.savefig(path, dpi=150)


def von_mises_of(stress: np.ndarray) -> np.ndarray:
    """Return the von Mises stress (T,) of components (T, 6)."""
    xx, yy, zz, yz, xz, xy = stress.T
    normal = ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2
    return np.sqrt(normal + 3 * (yz**2 + xz**2 + xy**2))


def print_table(reports: dict[int, romerr.BoundReport], truth: dict[str, np.ndarray]) -> None:
    """Print true errors and bounds of the first rows."""
    print("eigenmodes            true error    bound   without time steps   (% of the largest value)")
    for n, report in reports.items():
        for name, y in truth.items():
            out = report.compare(name, report.t, y)
            found = np.abs(out.error), out.bound["best"], out.reduction_bound["best"]
            print(f"{n:10d}  {name:>8}", *(f"{100 * share(out, x):10.3g}" for x in found))


def main(folder: str | Path = RESULTS, t_end: float = 0.01, eigenmodes: tuple = EIGENMODES) -> tuple:
    """Print bounds and true errors, save the picture; return the reports by eigenmodes, and the true von Mises."""
    fem = floating.load_fem("bar_fine")
    body, loads = full_model(fem)
    q = exact_motion(body, loads, round(t_end / STEP))
    node = most_loaded(fem, q[np.argmax(np.abs(q).max(axis=1))])
    print(f"most loaded: node {node} at {body.positions[node]} m; its stress xx, and the displacement of the tip")
    reports = {n: simulate(n, node, t_end) for n in eigenmodes}
    stress = q @ romerr.node_stress("s", node=node, fem=fem, material=MATERIAL).rows.T
    tip = int(floating.interface(fem, "tip")[0][0])
    print_table(reports, {"stress": stress, "tip z": q[:, 3 * tip + 2]})
    mises, truth = romerr.von_mises(reports[SHOWN], "stress"), von_mises_of(stress)
    sizes = (mises.value, np.abs(truth - mises.value), mises.bound)
    print(
        "von Mises, {} eigenmodes: up to {:.4g} MPa, error {:.2g}, bound {:.2g} MPa".format(
            SHOWN, *(1e-6 * size.max() for size in sizes)
        )
    )
    Path(folder).mkdir(parents=True, exist_ok=True)
    draw(reports, truth, Path(folder) / "stress_bound.png")
    return reports, truth


if __name__ == "__main__":
    main(*sys.argv[1:2])
