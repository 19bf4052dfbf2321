"""A scene of models/ as a script: python benchmarks/tune_scene.py slider_crank; benchmarks/tune.py runs it."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from models import floating, mechanisms

SCENES = {
    "slider_crank": lambda: mechanisms.slider_crank(4, h=2.5e-4, t_end=0.06),
    "pendulum": lambda: floating.pendulum(4, "RBE3", h=5e-4, t_end=0.1),
    "double_pendulum": lambda: mechanisms.double_pendulum(3, h=1e-3, t_end=0.2),
}


def main(name: str) -> None:
    """Build it, solve it."""
    scene = SCENES[name]()
    scene.mbs.Assemble()
    scene.mbs.SolveDynamic(scene.settings)


if __name__ == "__main__":
    main(sys.argv[1])
