"""A loader crane with hydraulic cylinders lifts a payload on a rope: a plain Exudyn script, built in models/boom.py.

Pressures are coordinates of first order, valves are opened by a PreStep function. How wrong are the boom's tip, the
payload and the pressures?

    romerr run examples/boom.py [STEP]      # steps of 0.01 s
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from models.boom import boom


def main() -> None:
    """Hold the crane by a static solve, let its cylinders move, print where the payload is."""
    scene = boom(h=float(sys.argv[1]) if len(sys.argv) > 1 else 1e-2)
    scene.solve()
    print("payload:", scene.mbs.GetSensorValues(scene.sensors["payload"]))


if __name__ == "__main__":
    main()
