"""Solve the chain of models/chain.py with all modes and write models/data/chain.npz: what tests compare bounds with.

python models/make_chain_truth.py
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from models import chain

TRUTH = Path(__file__).parent / "data" / "chain.npz"


def full_run(name: str, **options: float) -> dict[str, np.ndarray]:
    """Return sensor -> displacement (T, 3) in m in the frame of its bar, of one of chain.SCENES with all modes."""
    scene = chain.chain(kind="complete", **chain.SCENES[name] | options)
    scene.solve()
    return {key: scene.mbs.GetSensorStoredData(number)[:, 1:] for key, number in scene.sensors.items()}


def main() -> None:
    """Write the file and print its size."""
    found = {f"{name}, {key}": values for name in chain.SCENES for key, values in full_run(name).items()}
    np.savez_compressed(TRUTH, **found)
    print(f"{TRUTH.name}: {TRUTH.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
