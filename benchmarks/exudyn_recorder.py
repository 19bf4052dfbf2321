"""Run one script, patched already, and keep what it did: for exudyn_examples.py, which starts this in a process.

    python benchmarks/exudyn_recorder.py SCRIPT

Around the script stand functions that copy states and sensors after each solve, and a start vector for scipy's eigsh:
without it Exudyn's modes have other last digits each time, and nothing could be compared bit by bit.
"""

import json
import os
import sys
from functools import wraps
from pathlib import Path
from time import thread_time
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import numpy as np

STATES = ("ODE2Coordinates", "ODE2Coordinates_t", "ODE1Coordinates", "AECoordinates", "DataCoordinates")
SOLVERS = ("SolveDynamic", "SolveStatic")
RESULTS = ("states.npz", "series.npz", "told.json")


class Recorder:
    """What a script did: states and sensors after each solve, monitors, refusals, CPU times."""

    def __init__(self):
        self.data: dict[str, np.ndarray] = {}
        self.monitors: list[Any] = []
        self.refusals: list[str] = []
        self.seconds = dict.fromkeys(("solve", "attach", "begin", "report"), 0.0)
        self.solves = 0

    def install(self) -> None:
        """Stand in front of Exudyn's solvers and our functions; nothing that they compute changes."""
        import exudyn as exu
        import scipy.sparse.linalg as sla

        import exudyn_romerr as romerr
        from exudyn_romerr.mbs.monitoring.step_hook import StepHook

        for name in SOLVERS:
            setattr(exu.MainSystem, name, self.kept(getattr(exu.MainSystem, name)))
        romerr.floating_body, romerr.attach = self.heard(romerr.floating_body), self.heard(romerr.attach)
        StepHook.begin = self.timed("begin", StepHook.begin)
        sla.eigsh = started(sla.eigsh)

    def timed(self, key: str, function: Any) -> Any:
        """Return the function with its CPU time added up."""

        @wraps(function)
        def call(*arguments, **options):
            begin = thread_time()
            try:
                return function(*arguments, **options)
            finally:
                self.seconds[key] += thread_time() - begin

        return call

    def kept(self, solver: Any) -> Any:
        """Return a solver of Exudyn that leaves its states and sensors here."""
        timed = self.timed("solve", solver)

        @wraps(solver)
        def call(mbs, *arguments, **options):
            try:
                return timed(mbs, *arguments, **options)
            finally:
                self.keep(mbs)

        return call

    def keep(self, mbs: Any) -> None:
        """Copy states and sensors."""
        self.solves += 1
        for name in STATES:
            self.data[f"solve {self.solves}, {name}"] = np.array(getattr(mbs.systemData, f"Get{name}")())
        for i in range(mbs.systemData.NumberOfSensors()):
            stored = mbs.GetSensor(i).get("storeInternal")
            values = mbs.GetSensorStoredData(i) if stored else mbs.GetSensorValues(i)
            self.data[f"solve {self.solves}, sensor {i}"] = np.atleast_1d(values)

    def keep_files(self, folder: Path) -> None:
        """Copy what the script wrote to its solution folder, but for comments, which have the date."""
        for path in sorted(folder.rglob("*.txt")):
            rows = [row for row in path.read_bytes().split(b"\n") if not row.startswith(b"#")]
            self.data[f"file {path.relative_to(folder)}"] = np.frombuffer(b"\n".join(rows), np.uint8)

    def heard(self, function: Any) -> Any:
        """Return floating_body or attach; what it refuses is kept, and the script goes on without it."""
        from exudyn_romerr import RomErrError

        timed = self.timed("attach", function)

        @wraps(function)
        def call(*arguments, **options):
            if any(argument is None for argument in arguments):
                return None
            try:
                made = timed(*arguments, **options)
            except RomErrError as error:
                self.refusals.append(f"{function.__name__}: {error}")
                return None
            self.monitors += [made] if function.__name__ == "attach" else []
            return made

        return call


def started(eigsh: Any) -> Any:
    """Return scipy's eigsh with a start vector that is the same each time."""

    @wraps(eigsh)
    def call(A, *arguments, **options):
        options.setdefault("v0", np.random.default_rng(0).standard_normal(A.shape[0]))
        return eigsh(A, *arguments, **options)

    return call


def described(monitor: Any) -> tuple[dict, dict[str, np.ndarray]]:
    """Return what the table needs of a report, and its time series."""
    try:
        report = monitor.report()
    except Exception as error:  # whatever stopped it is what the table shows
        return {"refused": f"the solve: {error}"}, {}
    found = {
        "scope": ", ".join(sorted(set(report.scope.values()))),
        "outputs": [{"name": out.name, "unit": out.unit} for out in report.outputs.values()],
        "text": str(report),
    }
    series = {"t": report.t}
    for name, out in report.outputs.items():
        series |= {f"value {name}": out.value, f"bound {name}": out.bound["best"]}
        if out.estimate is not None:  # a run with more modes has the same time steps
            series[f"modes' part {name}"] = out.estimate - out.estimate_parts["time step"]
            series |= {f"estimate {name}": out.estimate, f"half width {name}": out.uncertainty}
    return found, series


def work(script: Path) -> None:
    """Run a script in this process, in its own folder; leave results beside it."""
    recorder = Recorder()
    recorder.install()
    os.chdir(script.parent)
    sys.argv, failed = [str(script)], ""
    try:
        exec(compile(script.read_text(encoding="utf-8"), str(script), "exec"), {"__name__": "__main__"})
    except SystemExit:
        pass
    except Exception as error:  # also what Exudyn's plots miss once the solve is done: kept, compared, told
        failed = f"{type(error).__name__}: {error}"
    recorder.keep_files(script.parent / "solution")
    timed = recorder.timed("report", described)
    found = [timed(monitor) for monitor in recorder.monitors]
    series = {f"{i} {name}": x for i, (_, series) in enumerate(found) for name, x in series.items()}
    told = {"failed": failed, "solves": recorder.solves, "refusals": recorder.refusals, "seconds": recorder.seconds}
    np.savez(RESULTS[0], **recorder.data)
    np.savez(RESULTS[1], **series)
    Path(RESULTS[2]).write_text(json.dumps({**told, "bodies": [body for body, _ in found]}))


if __name__ == "__main__":
    work(Path(sys.argv[1]))
