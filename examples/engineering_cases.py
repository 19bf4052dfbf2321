"""The cases of docs/gallery.md: plain scenes without a line of exudyn_romerr, to be asked from outside.

    romerr run --tolerance 1% examples/engineering_cases.py crank 2 500

CASE is crank, car, car-bushes, car-rigid, rotor or rotor-ramp; then come the number of eigenmodes, and of time steps.
"""

import sys
from math import pi, sin
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from models import floating, mechanisms, wishbone

RAMP = 0.05  # s, in which the rotor's weight grows
CRANK_END, CAR_END, ROTOR_END = 0.12, 0.2, 0.2  # s


def ramped(mbs, t, gravity):
    """Let gravity grow smoothly from 0."""
    return [g * sin(pi / 2 * min(t / RAMP, 1.0)) ** 2 for g in gravity]


def crank(n, steps):
    """Make a slider crank with a flexible connecting rod."""
    return mechanisms.slider_crank(n, h=CRANK_END / steps, t_end=CRANK_END), ["middle 1 local", "tip 1"]


def car(n, steps, static=wishbone.INTERFACES, kind="RBE3"):
    """Make a quarter car with a flexible lower control arm, that drives over a bump."""
    scene = wishbone.quarter_car(n, kind, static, h=CAR_END / steps, t_end=CAR_END)
    return scene, ["chassis", "ball node local"]


def rotor(n, steps, weight=None):
    """Make a rotor with an unbalanced disc that runs up."""
    scene = floating.rotor(n, h=ROTOR_END / steps, t_end=ROTOR_END)
    if weight:
        scene.mbs.SetLoadParameter(0, "loadVectorUserFunction", weight)  # the load that Exudyn makes of gravity
    return scene, ["rim local"]


CASES = {
    "crank": crank,
    "car": car,
    "car-bushes": lambda n, steps: car(n, steps, ("front", "rear")),
    "car-rigid": lambda n, steps: car(n, steps, kind="RBE2"),
    "rotor": rotor,
    "rotor-ramp": lambda n, steps: rotor(n, steps, ramped),
}


def main(case="crank", n=0, steps=240):
    """Solve a case, print what its sensors show at the end."""
    scene, shown = CASES[case](int(n), int(steps))
    for name, number in scene.sensors.items():
        scene.mbs.SetSensorParameter(number, "name", name)
    scene.solve()
    for name in shown:
        print(f"{name}:", scene.mbs.GetSensorValues(scene.sensors[name]))


if __name__ == "__main__":
    main(*sys.argv[1:])
