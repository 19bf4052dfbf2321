"""Whether two versions of the package give the same bounds, bit for bit.

    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 python benchmarks/bit_equal.py run MODES RESULT.npz
    python benchmarks/bit_equal.py same RESULT.npz OTHER.npz

`run` computes bounds of five scenes with the package that PYTHONPATH names; `same` compares what two runs wrote, and
ends with 1 if one bit differs. Exudyn's eigensolver starts from random numbers: modes are computed once, and kept in
the folder MODES. One thread, since the order of sums depends on their number.
"""

import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from exudyn.FEM import FEMinterface

import exudyn_romerr as romerr
from models import floating, linkage, mechanisms, wishbone

ALL = ("state-space", "fast", "convolution", "energy", "auxiliary")


def keep_eigenmodes(folder: Path) -> None:
    """Let FEMinterface read its Craig-Bampton modes from a folder, and compute those that are not there."""
    compute = FEMinterface.ComputeHurtyCraigBamptonModes

    def stored(fem: FEMinterface, nodes: Any, n: int, computationMode: Any, **options: Any) -> None:
        size, parts = fem.massMatrix.shape[0], len(nodes)
        path = folder / f"{size}_{parts}_{n}_{computationMode.name}.npz"
        if not path.exists():
            compute(fem, nodes, n, computationMode=computationMode, **options)
            np.savez(path, matrix=fem.modeBasis["matrix"], eigenValues=fem.eigenValues)
        with np.load(path) as file:
            fem.modeBasis = {"matrix": file["matrix"], "type": "HCBmodes"}
            fem.eigenValues = file["eigenValues"]

    FEMinterface.ComputeHurtyCraigBamptonModes = stored


def readme() -> list[romerr.BoundReport]:
    """Clamped bar, as in the README."""
    scene = floating.clamped_bar(4, h=2e-4, t_end=0.04)
    monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items))
    scene.solve()
    return [monitor.report()]


def frozen() -> list[romerr.BoundReport]:
    """Falling pendulum, all that there is for a turning frame: inputs frozen."""
    scene = floating.pendulum(4, t_end=0.06)
    flex = romerr.floating_body(scene.fem, scene.items)
    kinds = ("fast", "convolution", "energy", "auxiliary")
    monitor = romerr.attach(scene.mbs, flex, estimators=kinds, scope="inputs frozen")
    scene.solve()
    return [monitor.report()]


def double_pendulum() -> list[romerr.BoundReport]:
    """Two bars, coupled."""
    scene = mechanisms.double_pendulum(4, t_end=0.1)
    flexible = [romerr.floating_body(scene.fem, items) for items in scene.bodies]
    monitors = [romerr.attach(scene.mbs, flex) for flex in flexible]
    scene.solve()
    return [monitor.report() for monitor in monitors]


def quarter_car() -> list[romerr.BoundReport]:
    """Wishbone from its static equilibrium over the begin of the bump."""
    scene = wishbone.quarter_car(8, h=5e-4, t_end=0.01)
    nodes, weights = floating.interface(scene.fem, "ball")
    joint = romerr.mean_displacement("ball joint", nodes=nodes, weights=weights)
    monitor = romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.bodies[0]), outputs=[joint])
    scene.settle()
    settled = monitor.report()
    scene.mbs.SolveDynamic(scene.settings)
    return [settled, monitor.report()]


def suspension_linkage() -> list[romerr.BoundReport]:
    """A body without a frame, by every estimator."""
    body, inputs, tip = linkage.build()
    mbs = exu.SystemContainer().AddSystem()
    basis = romerr.krylov_basis(body, inputs, 12)
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=inputs, input_function=linkage.force)
    monitor = romerr.attach(mbs, flex, outputs=[tip], initial="equilibrium", estimators=ALL)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = 1, 200
    settings.solution.file.write = False
    mbs.SolveDynamic(settings)
    return [monitor.report()]


def numbers(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Every array and text in a report, with a name that tells where it stands."""
    if isinstance(value, romerr.BoundReport | romerr.OutputReport):
        value = {field.name: getattr(value, field.name) for field in fields(value) if field.name != "made"}
    if isinstance(value, dict):
        for key, part in value.items():
            yield from numbers(f"{name}/{key}", part)
    elif callable(value):  # bounds at nodes, computed when asked for
        yield from numbers(name, value())
    elif value is not None:
        yield name, value if isinstance(value, np.ndarray) else np.array(str(value))


def run(modes: str, result: str) -> None:
    """Save all numbers of all scenes."""
    Path(modes).mkdir(parents=True, exist_ok=True)
    keep_eigenmodes(Path(modes))
    found: dict[str, np.ndarray] = {}
    for scene in (readme, frozen, double_pendulum, quarter_car, suspension_linkage):
        for i, report in enumerate(scene()):
            found.update(numbers(f"{scene.__name__}/{i}", report))
    np.savez(result, **found)
    print(f"{len(found)} arrays and texts by {Path(romerr.__file__).parent}")


def differences(first: str, second: str) -> list[str]:
    """Names of what is not the same in two files."""
    with np.load(first) as a, np.load(second) as b:
        names = sorted({*a.files, *b.files})
        both = {*a.files} & {*b.files}
        return [name for name in names if name not in both or not _same(a[name], b[name])]


def _same(x: np.ndarray, y: np.ndarray) -> bool:
    return x.shape == y.shape and x.dtype == y.dtype and x.tobytes() == y.tobytes()


def main() -> None:
    """See the head of this file."""
    task, *files = sys.argv[1:]
    if task == "run":
        run(*files)
    else:
        found = differences(*files)
        print("\n".join(found) or "the same, bit for bit")
        sys.exit(bool(found))


if __name__ == "__main__":
    main()
