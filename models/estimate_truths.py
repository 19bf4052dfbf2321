"""Motion of scenes with no mode left out and steps that do not matter, in models/data/estimate_truths.npz.

The truth of estimates of the whole error: steps h/8 and h/32 with h that of the reduced runs, and Richardson's
extrapolation, the solvers being of second order: (16 y_{h/32} - y_{h/8})/15. How far it is itself from the limit is
about the difference to the same of h/16 and h/32. Stored beside it is the full motion at the steps h: truth less that
is what time steps do, that less a reduced run what the basis does.

Of the wishbone the truth has 64 eigenmodes beside all static ones, not all modes: they are out of reach.

    python -m models.estimate_truths [NAMES]      solves the scenes again and writes them to the file
"""

from __future__ import annotations

import sys
from time import process_time
from typing import NamedTuple

import numpy as np

from models import floating
from models.estimate_scenes import SCENES

FILE = floating.DATA / "estimate_truths.npz"


class Truth(NamedTuple):
    """Of a sensor: the truth (T, 3) at t (T,), how far it may be off (3,), the full motion at the steps h (T, 3)."""

    t: np.ndarray
    value: np.ndarray
    off: np.ndarray
    same_steps: np.ndarray


def shown(name: str, finer: int = 1, steps: int | None = None) -> dict[str, np.ndarray]:
    """Solve the full model with steps h/finer; return what sensors show, (T, 3), at every h; steps: how many h."""
    scene = SCENES[name]
    found = motion(scene.make(*scene.full, scene.h), scene.h, finer, steps)
    return {key: found[key] for key in scene.sensors}


def motion(made, h: float, finer: int = 1, steps: int | None = None) -> dict[str, np.ndarray]:
    """Solve a scene that was made for steps h with steps h/finer."""
    time = made.settings.timeIntegration
    steps = round(time.endTime / h) if steps is None else steps
    time.endTime, time.numberOfSteps = steps * h, finer * steps
    made.settings.solution.sensors.writePeriod = h
    made.solve()
    stored = {key: made.mbs.GetSensorStoredData(k) for key, k in made.sensors.items()}
    for key, values in stored.items():
        np.testing.assert_allclose(values[:, 0], h * np.arange(steps + 1), rtol=0, atol=1e-6 * h, err_msg=key)
    return {key: values[:, 1:] for key, values in stored.items()}


def extrapolated(name: str, steps: int | None = None) -> dict[str, Truth]:
    """Solve the full model with all steps; return the truths of all sensors."""
    same, coarse, middle, fine = (shown(name, finer, steps) for finer in (1, *SCENES[name].finer))
    found = {}
    for key, y in fine.items():
        value, other = (16 * y - coarse[key]) / 15, (4 * y - middle[key]) / 3
        t = SCENES[name].h * np.arange(len(y))
        found[key] = Truth(t, value, np.abs(value - other).max(axis=0), same[key])
    return found


def stored(name: str) -> dict[str, Truth]:
    """Return what `extrapolated` found when the file was written."""
    with np.load(FILE, allow_pickle=False) as file:
        keys = [key.split("/")[1] for key in file.files if key.startswith(f"{name}/") and key.endswith("/value")]
        return {key: Truth(*(file[f"{name}/{key}/{part}"] for part in Truth._fields)) for key in keys}


def main(names: list[str]) -> None:
    """Solve scenes and put them into the file."""
    for name in names or SCENES:
        begin = process_time()
        found = extrapolated(name)
        kept = dict(np.load(FILE, allow_pickle=False)) if FILE.exists() else {}
        kept = {key: values for key, values in kept.items() if not key.startswith(f"{name}/")}
        for key, truth in found.items():
            kept |= {f"{name}/{key}/{part}": values for part, values in truth._asdict().items()}
        np.savez_compressed(FILE, **kept)
        worst = max(
            np.max(truth.off / np.ptp(truth.value - truth.same_steps, axis=0).max()) for truth in found.values()
        )
        print(
            f"{name}: {process_time() - begin:.0f} s; truths are off by {worst:.1g} of the steps' error", flush=True
        )


if __name__ == "__main__":
    main(sys.argv[1:])
