"""A loader crane with hydraulic cylinders lifts a payload on a rope: a plain Exudyn script, built in models/boom.py.

Pressures are coordinates of first order, valves are opened by a PreStep function. How wrong are the boom's tip, the
payload and the pressures?

    romerr run examples/boom.py [STEP]              # steps of 0.01 s
    python examples/boom.py --figure FILE.png       # the crane, and errors told beside true ones (1 min)
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from models.boom import MOUNTS, boom, outline

STEP, FINER = 1e-2, (8, 16)


def main() -> None:
    """Hold the crane by a static solve, let its cylinders move, print where the payload is."""
    scene = boom(h=float(sys.argv[1]) if len(sys.argv) > 1 else STEP)
    scene.solve()
    print("payload:", scene.mbs.GetSensorValues(scene.sensors["payload"]))


def draw(path: str) -> None:
    """Draw the crane, and what is told of two errors beside runs with more modes and short steps, extrapolated."""
    import matplotlib.pyplot as plt

    import exudyn_romerr as romerr

    scene, *finer = boom(h=STEP), *(boom(40, STEP / by, interfaces=tuple(MOUNTS)) for by in FINER)
    monitor = romerr.attach(scene.mbs, [romerr.floating_body(scene.fem, scene.bodies[0])])
    fig, (crane, *others) = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    crane.plot(*outline(scene), color="0.7", label="begin")
    for one in (scene, *finer):
        one.solve()
    crane.plot(*outline(scene), color="tab:blue", label="end")
    crane.set(title="the crane", aspect="equal", xlabel="x / m", ylabel="z / m")
    crane.legend(loc="lower left")
    report = monitor.report()
    for ax, name, k, unit in zip(others, ("tip", "pressures first"), (2, 0), ("m", "Pa"), strict=True):
        stored = [one.mbs.GetSensorStoredData(one.sensors[name])[:, 1 + k] for one in finer]
        coarse, fine = (y[::by] for y, by in zip(stored, FINER, strict=True))
        out = report.output(name)
        told, half = out.estimate[:, k], out.uncertainty[:, k]
        # a controller that samples makes steps of first order
        ax.plot(report.t, 2 * fine - coarse - out.value[:, k], "k", label="true")
        ax.plot(report.t, told, "--", color="tab:purple", label="told")
        ax.fill_between(report.t, told - half, told + half, color="tab:purple", alpha=0.2, label="half width")
        ax.set(title=f"{name}: error of the whole run", xlabel="t / s", ylabel=unit)
        ax.legend()
    fig.savefig(path, dpi=110)


if __name__ == "__main__":
    draw(sys.argv[2]) if sys.argv[1:2] == ["--figure"] else main()
