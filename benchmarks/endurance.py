"""Play random scripts under `romerr run`: nothing of the run may change or be lost, whatever goes wrong on the way.

    python benchmarks/endurance.py [--count 500] [--first 0]

Every script is a mechanism of random_mechanisms.py with something that happens within it: errors thrown by user
functions, sys.exit, PostStep functions that end a solve, PreStep functions, a static solve before, solves in a loop.
Around it: 1 to 4 threads, Ctrl-C, a full disk, little memory. It runs bare and under `romerr run`, each in a process
of its own. Same: what it prints, its exit status, and what all sensors have stored, bit by bit. Lost: no answer where
a solve has ended. Traceback: one line of our package in what is printed. After Ctrl-C, and where memory is short,
only the last two are asked for, for runs that are ended by these end at other instants.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks import page

WITHIN = ("error", "exit", "ended by PostStep", "PreStep", "static before", "loop of solves")
AROUND = ("threads", "Ctrl-C", "disk full", "little memory")
ENDS_OTHERWISE = {"Ctrl-C", "little memory"}
DATA = "ENDURANCE_DATA"
FULL = 4096  # bytes, the largest file that may be written where the disk is full
MEMORY = (320, 480)  # MB of address space: of 300 the bare run has hardly enough, of 400 we have
LIMIT = 300.0  # s
TIMES = re.compile(r"[\d.e+-]+ ?s(econds)?\b|^STEP.*$", re.MULTILINE)  # what Exudyn prints of seconds
ANSWER = "romerr 0."


def drawn(seed: int) -> tuple[set[str], np.random.Generator]:
    """Return what happens in script number `seed`, and where the rest is drawn from."""
    rng = np.random.default_rng([seed, 71])
    within = {name for name in WITHIN if rng.random() < 0.25}
    around = {str(rng.choice(AROUND))} if rng.random() < 0.6 else set()
    return within | around, rng


def play(seed: int) -> None:
    """Be script number `seed`: build, let happen what was drawn, solve, store what sensors show."""
    from benchmarks.mechanism_builder import built
    from benchmarks.random_mechanisms import drawn as mechanism_of

    happens, rng = drawn(seed)
    scene = built(mechanism_of(int(rng.integers(0, 400))))
    mbs, end = scene.mbs, scene.settings.timeIntegration.endTime
    when = float(rng.uniform(0.05, 0.95)) * end
    print(f"script {seed}")
    if "error" in happens:
        _throw_at(mbs, when)
    if "PreStep" in happens:
        mbs.SetPreStepUserFunction(_controller())
    if "ended by PostStep" in happens:
        mbs.SetPostStepUserFunction(lambda mbs, t: t < when)
    mbs.Assemble()
    try:
        if "static before" in happens:
            mbs.SolveStatic(scene.settings)
        for part in range(3 if "loop of solves" in happens else 1):
            _solve(mbs, scene.settings)
            if "exit" in happens and part == 0:
                sys.exit(int(rng.integers(0, 5)))
    finally:
        _store(mbs)
        print("stored")


def _throw_at(mbs: Any, when: float) -> None:
    """Let a load's user function throw at an instant."""
    from exudyn import itemInterface

    def function(mbs: Any, t: float, load: float) -> float:
        if t >= when:
            raise ValueError("what the user's function says")
        return 0.0

    node = mbs.AddNode(itemInterface.NodePointGround())
    marker = mbs.AddMarker(itemInterface.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    mbs.AddLoad(itemInterface.LoadCoordinate(markerNumber=marker, load=0.0, loadUserFunction=function))


def _controller() -> Callable:
    """A PreStep function that counts its calls."""

    def control(mbs: Any, t: float) -> bool:
        mbs.variables["calls"] = mbs.variables.get("calls", 0) + 1
        return True

    return control


def _solve(mbs: Any, settings: Any) -> None:
    """Solve, and set up the next solve to begin where this one ends."""
    import exudyn as exu

    mbs.SolveDynamic(settings)
    system = mbs.systemData
    system.SetSystemState(system.GetSystemState(), configuration=exu.ConfigurationType.Initial)


def _store(mbs: Any) -> None:
    sensors = range(mbs.systemData.NumberOfSensors())
    data = {str(i): np.array(mbs.GetSensorStoredData(i)) for i in sensors}
    state = np.concatenate([np.ravel(x) for x in mbs.systemData.GetSystemState()])
    np.savez(os.environ[DATA], state=state, calls=mbs.variables.get("calls", 0), **data)


@dataclass
class Played:
    """What came of a process. data: the file of sensors. ended_itself: it was not ended by the limit of time."""

    status: int
    printed: str
    errors: str
    data: bytes
    ended_itself: bool
    seconds: float


def played(seed: int, watched: bool, folder: Path, interrupt_after: float | None = None) -> Played:
    """Run script number `seed` bare, or under `romerr run`."""
    happens, rng = drawn(seed)
    folder.mkdir()
    script, data = folder / f"script_{seed}.py", folder / "data.npz"
    script.write_text(f"from benchmarks.endurance import play\n\nplay({seed})\n", encoding="utf-8")
    command = [sys.executable, *(["-m", "exudyn_romerr", "run"] if watched else []), script.name]
    if watched and "disk full" in happens:
        command[4:4] = ["--save", "run.npz", "--html", "run.html"]
    threads = str(rng.integers(1, 5)) if "threads" in happens else "1"
    around = {**os.environ, "PYTHONPATH": str(page.ROOT), "OPENBLAS_NUM_THREADS": threads, DATA: str(data)}
    limits = {"disk full": (resource.RLIMIT_FSIZE, FULL), "little memory": (resource.RLIMIT_AS, _memory(rng))}
    limits = [limits[name] for name in happens & {*limits}]

    def limited() -> None:
        for which, most in limits:
            resource.setrlimit(which, (most, most))

    begin = monotonic()
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=folder, env=around, preexec_fn=limited, **pipes)
    if interrupt_after is not None:
        sleep(interrupt_after)
        process.send_signal(signal.SIGINT)
    try:
        printed, errors = process.communicate(timeout=LIMIT)
        ended = True
    except subprocess.TimeoutExpired:
        process.kill()
        printed, errors = process.communicate()
        ended = False
    found = data.read_bytes() if data.exists() else b""
    return Played(process.returncode, printed, errors, found, ended, monotonic() - begin)


def _memory(rng: np.random.Generator) -> int:
    """Address space in bytes."""
    return int(rng.uniform(*MEMORY)) << 20


def verdicts_of(seed: int) -> tuple[set[str], set[str]]:
    """Return what happened in script number `seed`, and what is wrong of its run under `romerr run`."""
    happens, rng = drawn(seed)
    with tempfile.TemporaryDirectory() as place:
        bare = played(seed, False, Path(place) / "bare")
        after = float(rng.uniform(0.2, 1.2)) * bare.seconds if "Ctrl-C" in happens else None
        ours = played(seed, True, Path(place) / "watched", after)
    wrong = set()
    if not ours.ended_itself:
        wrong.add("hangs")
    own = [line for line in ours.errors.splitlines() if 'File "' in line and "/exudyn_romerr/" in line]
    if own and not _is_interrupted_in_import(ours.errors):
        wrong.add("traceback")
    if happens & ENDS_OTHERWISE:
        return happens, wrong
    if ours.status != bare.status:
        wrong.add("other status")
    if not _plain(ours.printed).startswith(_plain(bare.printed)):
        wrong.add("other lines")
    if ours.data != bare.data:
        wrong.add("other numbers")
    if ANSWER not in ours.printed:
        wrong.add("no answer")
    return happens, wrong


def _is_interrupted_in_import(errors: str) -> bool:
    """Whether Ctrl-C came while Python was loading modules: what it prints then is its own."""
    return "KeyboardInterrupt" in errors and "importlib" in errors


def _plain(printed: str) -> str:
    return TIMES.sub("", printed).strip()


def table(results: list[tuple[int, set[str], set[str]]]) -> str:
    """Return a line for each thing that happened, with what went wrong then, and the seeds of all that did."""
    lines = [f"{'':<20}{'scripts':>9}{'wrong':>7}"]
    for name in ("nothing", *WITHIN, *AROUND, "all"):
        of = [wrong for _, happens, wrong in results if name == "all" or name in (happens or {"nothing"})]
        lines.append(f"{name:<20}{len(of):>9}{sum(map(bool, of)):>7}")
    kinds = Counter(kind for *_, wrong in results for kind in wrong)
    lines += [f"{kind}: {count}" for kind, count in kinds.items()]
    lines += [f"seed {seed}: {', '.join(sorted(wrong))}" for seed, _, wrong in results if wrong]
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> str:
    """Play, print and return the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--first", type=int, default=0, help="seed of the first script")
    options = parser.parse_args(arguments)
    results = []
    for seed in range(options.first, options.first + options.count):
        results.append((seed, *verdicts_of(seed)))
        if results[-1][2]:
            print(seed, *map(sorted, results[-1][1:]), file=sys.stderr, flush=True)
    text = table(results)
    print(text)
    return text


if __name__ == "__main__":
    main()
