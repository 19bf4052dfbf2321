"""What bounds and estimates cost beside runs of 0.1 s, where nothing has been solved before (Linux).

    python benchmarks/short_runs.py [--exudyn CHECKOUT] [--pairs 7] [--only NAME ...]

The slider crank of models/mechanisms.py and, with a work tree of github.com/jgerstmayr/EXUDYN (needs ngsolve), two of
its examples: the script runs up to its solve, once. From there processes are forked, so that each solve is the first
one of its process: without our lines and with them in turn. They have their memory to themselves before their time is
taken, as processes that were not forked do. CPU time: of the solve and the report over that of the solve without our
lines; what comes before it, the imports, attach and its offline work (monitor.plan), is told apart.
"""

import argparse
import ctypes
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from io import FileIO
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
# no windows; threads on small matrices only wait for one another
os.environ.update({"EXUDYN_SUPPRESS_UI_WINDOW_OPEN": "1", "MPLBACKEND": "Agg", "OPENBLAS_NUM_THREADS": "1"})

import exudyn as exu
import numpy as np

from benchmarks import pairs
from models import mechanisms

END = 0.1  # s
LIMIT = 1.5  # of the run time without our lines
OURS = "estimate"
CRANK = "slider crank, 14 modes, 0.1 s"
SHORTER = {
    "NGsolveCraigBampton": ("tEnd = 4", f"tEnd = {END}"),
    "CMSexampleCourse": ("tEnd = 2", f"tEnd = {END}"),
}
IN_THE_FRAME = {  # our lines: fem, and nodes whose displacement in the frame is asked for
    "NGsolveCraigBampton": ("fem", ("nTip",)),
    "CMSexampleCourse": ("femInterface", ("nMid", "nTip")),
}


class Solve(NamedTuple):
    """An assembled scene. steps : of a solve. solve : solves it. attach : attaches a monitor, imports included."""

    steps: int
    solve: Callable[[], Any]
    attach: Callable[[], Any]


class ReadyError(Exception):
    """A script has come to its solve."""


def crank() -> Solve:
    """Return the slider crank."""
    scene = mechanisms.slider_crank(8, t_end=END)
    scene.settings.solution.sensors.active = False
    scene.mbs.Assemble()

    def attach() -> Any:
        import exudyn_romerr as romerr

        middle = romerr.node_displacement("middle", node=mechanisms.MIDDLE, component="z")
        return romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.bodies[0]), outputs=[middle])

    return Solve(scene.settings.timeIntegration.numberOfSteps, lambda: scene.mbs.SolveDynamic(scene.settings), attach)


def example(name: str, checkout: Path) -> Solve:
    """Run a script of Exudyn's up to its solve."""
    path, (old, new), found = checkout / "main" / "pythonDev" / "Examples" / f"{name}.py", SHORTER[name], {}
    source = path.read_text(encoding="utf-8")
    if source.count(old) != 1:
        raise ValueError(f"{path}: {old!r} is there {source.count(old)} times, not once; has the script changed?")
    solver = exu.MainSystem.SolveDynamic

    def ready(mbs: Any, *arguments: Any, **options: Any) -> None:
        found.update(mbs=mbs, arguments=arguments, options=options)
        raise ReadyError

    names: dict[str, Any] = {"__name__": "__main__"}
    exu.MainSystem.SolveDynamic = ready
    try:
        exec(compile(source.replace(old, new), str(path), "exec"), names)
    except ReadyError:
        pass
    finally:
        exu.MainSystem.SolveDynamic = solver

    def attach() -> Any:
        import exudyn_romerr as romerr

        fem, nodes = IN_THE_FRAME[name]
        outputs = [romerr.node_displacement(node, node=names[node], component="y") for node in nodes]
        return romerr.attach(names["mbs"], romerr.floating_body(names[fem], names["objFFRF"]), outputs=outputs)

    steps = found["options"]["simulationSettings"].timeIntegration.numberOfSteps
    return Solve(steps, lambda: solver(found["mbs"], *found["arguments"], **found["options"]), attach)


def forked(work: Callable[[], Any]) -> Any:
    """Return what a function returns in a process of its own, which ends with it."""
    reading, writing = os.pipe()
    process = os.fork()
    if not process:
        try:
            own_memory()
            os.write(writing, json.dumps(work()).encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as told:
        text = told.read()
    os.waitpid(process, 0)
    if not text:
        raise RuntimeError("a run ended without a result, see above")
    return json.loads(text)


def own_memory() -> None:
    """Write to all pages, which a fork shares until they are written: copying them is no part of a solve.

    Without this CMSexampleCourse took 30 to 40 ms more than in processes that were never forked, 8 % of it.
    """
    size = os.sysconf("SC_PAGE_SIZE")
    with open("/proc/self/maps") as maps, open("/proc/self/pagemap", "rb", buffering=0) as pages:
        for line in maps.read().splitlines():
            places, rights, *_ = line.split()
            if rights != "rw-p":
                continue
            first, end = (int(place, 16) // size for place in places.split("-"))
            there = _present(pages, first, end)
            for page in (first + np.flatnonzero(there)).tolist():
                ctypes.memmove(page * size, page * size, 1)


def _present(pages: FileIO, first: int, end: int) -> np.ndarray:
    """Which pages of a stretch have memory (proc_pid_pagemap(5): the highest bit)."""
    pages.seek(8 * first)
    return np.frombuffer(pages.read(8 * (end - first)), dtype=np.uint64) >> 63 > 0


def measured(scene: Solve, rounds: int) -> tuple[float, list[tuple[float, float]]]:
    """Return CPU seconds before the solve, and of the solve without and with our lines, so many times."""

    def bare() -> float:
        begin = process_time()
        scene.solve()
        return process_time() - begin

    def all_pairs() -> tuple[float, list[tuple[float, float]]]:
        without = Forks(bare)  # attach changes the mbs: it is forked from the process before
        begin = process_time()
        monitor = scene.attach()
        _ = monitor.plan
        before = process_time() - begin

        def ours() -> float:
            begin = process_time()
            scene.solve()
            monitor.report()
            return process_time() - begin

        found = [(without.next(), forked(ours)) for _ in range(rounds)]
        without.end()
        return before, found

    return forked(all_pairs)


class Forks:
    """A process that waits, and forks one that works whenever it is asked to."""

    def __init__(self, work: Callable[[], Any]):
        asked, self._ask = os.pipe()
        self._told, tell = os.pipe()
        self._process = os.fork()
        if not self._process:
            os.close(self._ask)
            while os.read(asked, 1):
                os.write(tell, (json.dumps(forked(work)) + "\n").encode())
            os._exit(0)
        os.close(asked)
        os.close(tell)

    def next(self) -> Any:
        """Return what one more process returns."""
        os.write(self._ask, b"+")
        return json.loads(os.read(self._told, 10_000))

    def end(self) -> None:
        """Let the process end."""
        os.close(self._ask)
        os.waitpid(self._process, 0)


def table(checkout: Path | None, rounds: int, only: list[str] | None = None) -> dict[str, list[pairs.Ratio]]:
    """Return the ratios of all scenes, each measured in a process without anything of the others."""
    found = {}
    for name in only or [CRANK, *(SHORTER if checkout else ())]:
        command = [sys.executable, __file__, "--child", name, "--pairs", str(rounds)]
        command += ["--exudyn", str(checkout)] if checkout else []
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{name}: {done.stderr[-1000:]}")
        steps, (before, times) = json.loads(done.stdout.strip().splitlines()[-1])
        variants = [_row(steps, "without bounds"), _row(steps, f"{OURS} ({before:.2g} s before the solve)", LIMIT)]
        found[name if name == CRANK else f"{name}, {END:g} s"] = pairs.ratios(variants, np.array(times))
    return found


def _row(steps: int, label: str, limit: float | None = None) -> pairs.Variant:
    row = pairs.Variant()
    row.label, row.limit, row.settings = label, limit, exu.SimulationSettings()
    row.settings.timeIntegration.numberOfSteps = steps
    return row


def child(name: str, checkout: Path | None, rounds: int) -> None:
    """Measure one scene in this process; print what `table` reads."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        (Path(folder) / "solution").mkdir()
        scene = crank() if name == CRANK else example(name, checkout)
        print("\n" + json.dumps([scene.steps, measured(scene, rounds)]))


def main(arguments: list[str] | None = None) -> dict[str, list[pairs.Ratio]]:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--exudyn", type=Path, help="work tree of Exudyn's repository, for its two examples")
    parser.add_argument("--pairs", type=int, default=7)
    parser.add_argument("--only", nargs="+", choices=[CRANK, *SHORTER])
    parser.add_argument("--child", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    checkout = options.exudyn and options.exudyn.resolve()
    if options.child:
        child(options.child, checkout, options.pairs)
        return {}
    print(pairs.threads())
    found = table(checkout, options.pairs, options.only)
    for title, (bare, ours) in found.items():
        spread = f"{ours.middle:.3f} ({ours.low:.3f}..{ours.high:.3f})"
        print(f"{title}: {bare.step:.1f} us a step; {ours.variant.label}: {spread} times as long")
    return found


if __name__ == "__main__":
    main()
