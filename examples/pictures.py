"""One of each picture that the package draws, of runs that take seconds.

    python examples/pictures.py [FOLDER]     writes FOLDER/picture_*.png (20 s)

FOLDER is examples/results if left out. The suspension linkage over time, with a load that jumps, and with three kinds
of basis of several sizes; a solid bar welded to the ground; both bodies coloured by the bounds at their nodes.
"""

import sys
from pathlib import Path
from statistics import median
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from exudyn import itemInterface

import exudyn_romerr as romerr
from examples import suspension_linkage
from exudyn_romerr.report.plots.over_time import draw_bounds, draw_signal
from exudyn_romerr.report.plots.style import picture
from models import exact, floating, linkage

RESULTS = Path(__file__).resolve().parent / "results"
BODY, INPUTS, TIP = linkage.build()
BASES = {  # kind -> n -> basis
    "modal": lambda n: romerr.modal_basis(BODY, n),
    "Krylov": lambda n: romerr.krylov_basis(BODY, INPUTS, n),
    "Gramian": lambda n: romerr.gramian_basis(BODY, INPUTS, n, band=(0.0, 2000.0)),
}
LADDER = ((2, 4e-3), (4, 2e-3), (6, 1e-3), (8, 5e-4), (10, 2.5e-4), (12, 1.25e-4))  # modes, step in s
SIZES = (1, 2, 3, 4, 6, 8, 10, 12)  # modes of the Krylov bases, all with the shortest step
END = 0.5  # s
TIMES = 3  # every run, for the median of its run times
PRELOAD, JUMP, BEGIN = 20.0, 30.0, 0.2  # N, until t = 0; N, and s from when on


def jumping_force(t: float) -> float:
    return linkage.force(t) + (JUMP if t >= BEGIN else 0.0)


def run(basis: romerr.Basis, step: float, force=linkage.force, state=None, jumps: tuple = ()) -> tuple:
    """Simulate the reduced linkage; return its report, reduced coordinates (T, n) and CPU seconds."""
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    flex = romerr.add_reduced_body(mbs, BODY, basis, inputs=INPUTS, input_function=force, initial=state)
    monitor = romerr.attach(mbs, flex, outputs=[TIP], initial=state, jumps=jumps)
    sensor = add_coordinates(mbs, flex.items["nGenericODE2"])
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime = END
    settings.timeIntegration.numberOfSteps = round(END / step)
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = step
    begin = process_time()
    mbs.SolveDynamic(settings)
    seconds = process_time() - begin
    return monitor.report(), mbs.GetSensorStoredData(sensor)[:, 1:], seconds


def add_coordinates(mbs, node: int) -> int:
    """Add a sensor of a node's coordinates."""
    coordinates = exu.OutputVariableType.Coordinates
    return mbs.AddSensor(
        itemInterface.SensorNode(nodeNumber=node, storeInternal=True, outputVariableType=coordinates)
    )


def released(step: float) -> tuple:
    """Return report and displacements (T, nodes, 3) of a linkage that springs back and meets a jump of its load."""
    basis = romerr.modal_basis(BODY, 6)
    q0 = BODY.expand(BODY.stiffness_factor.solve(INPUTS[BODY.free]))[:, 0] * PRELOAD
    report, q, _ = run(basis, step, jumping_force, (q0, np.zeros(BODY.N)), (BEGIN,))
    return report, (q @ basis.V.T).reshape(len(q), -1, 6)[:, :, :3]


def compared(report: romerr.BoundReport) -> romerr.OutputReport:
    """Compare the tip with the closed-form solution of the full model."""
    truth = exact.full_solution(BODY, INPUTS, linkage.AMPLITUDE, 2 * np.pi * linkage.FREQUENCY)
    return report.compare(TIP.name, report.t, truth.output(TIP.resolve(BODY), report.t))


def timed(kind: str, n: int, step: float) -> tuple:
    """Return a row of the pictures of many runs: kind, CPU seconds, bound, true error, modes."""
    runs = [run(BASES[kind](n), step) for _ in range(TIMES)]
    out, seconds = compared(runs[0][0]), median(seconds for *_, seconds in runs)
    return kind, seconds, np.max(out.bound["best"]), np.max(np.abs(out.error)), f"{n}"


def counted(n: int, step: float) -> tuple:
    """Return modes, bound and true error of a Krylov basis."""
    _, _, bound, error, _ = timed("Krylov", n, step)
    return n, bound, error


def bar() -> tuple:
    """Return report, fem and displacements (T, nodes, 3) of the welded bar."""
    scene = floating.clamped_bar(4, body="bar_fine", h=2e-4, t_end=0.04)
    flex = romerr.floating_body(scene.fem, scene.items)
    tip = romerr.node_displacement("tip", node=floating.interface(scene.fem, "tip")[0][0])
    monitor = romerr.attach(scene.mbs, flex, outputs=[tip])
    sensor = add_coordinates(scene.mbs, scene.items["nGenericODE2"])
    scene.solve()
    q = scene.mbs.GetSensorStoredData(sensor)[:, 1:]
    return monitor.report(), scene.fem, (q @ scene.fem.modeBasis["matrix"].T).reshape(len(q), -1, 3)


def main(folder: str | Path = RESULTS, ladder: tuple = LADDER, sizes: tuple[int, ...] = SIZES) -> dict:
    """Write the pictures; return the figures by name."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    finest = ladder[-1][1]
    plain, (sprung, u), (welded, fem, v) = suspension_linkage.simulate(), released(2 * finest), bar()
    compared(plain)
    rows = [timed(kind, *pair) for kind in BASES for pair in ladder]
    counts = [counted(n, finest) for n in sizes]

    def path(name: str) -> Path:
        return folder / f"picture_{name}.png"

    return {
        "signal": picture(draw_signal, path("signal"), plain, TIP.name),
        "bounds": picture(draw_bounds, path("bounds"), plain, TIP.name),
        "causes": sprung.plot_causes(path("causes")),
        "run_time": romerr.plot_run_time(rows, TIP.name, TIP.unit, path("run_time")),
        "modes": romerr.plot_convergence(counts, TIP.name, TIP.unit, path("modes")),
        "bar": welded.plot_body(fem, path("bar"), displacement=lambda i: v[i]),
        "linkage": sprung.plot_body(linkage.mesh(), path("linkage"), displacement=lambda i: u[i]),
    }


if __name__ == "__main__":
    main(*sys.argv[1:2])
    print(f"saved {(sys.argv[1:2] or [RESULTS])[0]}/picture_*.png")
