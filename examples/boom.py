"""A loader crane with hydraulic cylinders lifts a payload on a rope: a plain Exudyn script, built in models/boom.py.

Pressures are coordinates of first order, valves are opened by a PreStep function. How wrong are the boom's tip, the
payload and the pressures?

    romerr run examples/boom.py [MODES] [STEP]      # 8 modes beside static ones, steps of 0.002 s
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from models.boom import boom


def main() -> None:
    """Hold the crane by a static solve, let its cylinders move, print where the payload is."""
    modes, step = [*sys.argv[1:], *("8", "2e-3")[len(sys.argv) - 1 :]]
    scene = boom(int(modes), float(step))
    scene.solve()
    print("payload:", scene.mbs.GetSensorValues(scene.sensors["payload"]))


if __name__ == "__main__":
    main()
