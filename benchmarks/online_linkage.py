"""What bounds cost beside a simulation: the linkage reduced to 12 coordinates, generalised-alpha, steps of 1 ms.

Paired runs, CPU time: see pairs.py.

    python benchmarks/online_linkage.py [--end 10] [--pairs 25]
"""

import argparse
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorNode

import exudyn_romerr as romerr
from benchmarks import pairs
from models import linkage

N = 12
STEP = 1e-3  # s


class Bare(pairs.Variant):
    """The linkage alone, to end in s."""

    def __init__(self, end: float):
        self.mbs = exu.SystemContainer().AddSystem()
        body, inputs, self.output = linkage.build()
        basis = romerr.krylov_basis(body, inputs, N)
        self.flex = romerr.add_reduced_body(self.mbs, body, basis, inputs=inputs, input_function=linkage.force)
        self.settings = pairs.quiet(exu.SimulationSettings(), round(end / STEP), STEP)
        self.timed_prepare()
        self.mbs.Assemble()


class Storing(Bare):
    """Three state reads and storing, the least that a hook in Python must do."""

    label = "three state reads and storing only"

    def prepare(self) -> None:
        """Set a PostStep function that stores the state."""
        rows = np.empty((3, self.steps + 1, N))
        system = self.mbs.systemData

        def store(mbs, t):
            i = round(t / STEP)
            rows[0, i] = system.GetODE2Coordinates()
            rows[1, i] = system.GetODE2Coordinates_t()
            rows[2, i] = system.GetODE2Coordinates_tt()
            return True

        self.mbs.SetPostStepUserFunction(store)


class Recording(Bare):
    """Three node sensors that Exudyn stores itself: what could be saved, were their period not the user's."""

    label = "three sensors, stored by Exudyn, only"

    def prepare(self) -> None:
        """Add the sensors."""
        self.settings.solution.sensors.active, self.settings.solution.sensors.writePeriod = True, STEP / 2
        kinds = (getattr(exu.OutputVariableType, f"Coordinates{end}") for end in ("", "_t", "_tt"))
        node = self.flex.items["nGenericODE2"]
        self.sensors = [
            self.mbs.AddSensor(SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True))
            for kind in kinds
        ]

    def finish(self) -> None:
        """Read what they stored: all of it at once, for Exudyn lets go of nothing before the next solve."""
        self.rows = [self.mbs.GetSensorStoredData(sensor) for sensor in self.sensors]


class Bounds(Bare):
    """Fast and convolution bounds and one output; the report is asked for at the end."""

    label = "fast + convolution, sampled"
    options = {"time": "sampled", "estimators": ("fast", "convolution")}  # noqa: RUF012
    limit = 1.8

    def prepare(self) -> None:
        """Attach the monitor."""
        self.monitor = romerr.attach(self.mbs, self.flex, outputs=[self.output], **self.options)

    def finish(self) -> None:
        """Ask for the report: it evaluates the last block."""
        self.report = self.monitor.report()


class SharpBounds(Bounds):
    """Energy and 40 auxiliary modes, time integration covered."""

    label = "energy + auxiliary 40, reconstructed"
    options = {"estimators": ("energy", "auxiliary"), "auxiliary_modes": 40}  # noqa: RUF012
    limit = 3.0


class Default(Bounds):
    """What attach does unless told otherwise."""

    label = "default: energy + auxiliary 'auto'"
    limit = None
    options = {}  # noqa: RUF012


VARIANTS = (Bare, Storing, Recording, Bounds, SharpBounds, Default)


def main(arguments: list[str] | None = None) -> tuple[list[Bare], np.ndarray]:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--end", type=float, default=10.0, help="simulated time in s")
    parser.add_argument("--pairs", type=int, default=25)
    options = parser.parse_args(arguments)
    variants = [kind(options.end) for kind in VARIANTS]
    times = pairs.measure(variants, options.pairs)
    pairs.print_ratios(variants, times, f"n = {N}")
    return variants, times


if __name__ == "__main__":
    main()
