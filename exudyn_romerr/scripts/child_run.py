"""Start a process that runs a script once more, wait for it, and read what came of it; any executor may do this."""

from __future__ import annotations

import os
import pickle
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from dataclasses import dataclass, field, replace
from time import monotonic
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np

    from ..mode_selection.modal_content import Content
    from ..report.verdicts import Verdict

QUIET = {"EXUDYN_SUPPRESS_UI_WINDOW_OPEN": "1", "MPLBACKEND": "Agg", "PYTHONDONTWRITEBYTECODE": "1"}
TAIL = 400  # characters of what a process printed last
ENDED = "it was ended after {:g} s (--timeout)"
KILLED = "it was killed by signal {}{}"
MEMORY = ": most likely there was not enough memory"
CRASHED = "it ended with status {} and no result: {}"
ASKED = "EOFError"
ASKS = "the script asks for input, of which there is none here"


@dataclass(frozen=True)
class Request:
    """A run of a script: what is changed in it.

    home : the user's working folder. function : of the file, to be called in place of running it as a script.
    steps, factor, hold, numbers, further : as Variation has them. vectors : by order of the body. watch : whether
    estimates are made; make_vectors : whether vectors are. threads : of BLAS; "" : as the user has them. tolerance :
    of rows, as typed.
    """

    name: str
    script: str
    home: str
    arguments: tuple[str, ...] = ()
    function: str = ""
    steps: float = 1
    factor: int = 1
    hold: bool = False
    vectors: dict[int, np.ndarray] = field(default_factory=dict)
    watch: bool = False
    make_vectors: bool = False
    timeout: float | None = None
    threads: str = ""
    numbers: tuple[int, ...] = ()
    further: int = 0
    tolerance: tuple[str, ...] = ()


@dataclass
class Result:
    """What came of a run; failure: in words, if nothing did.

    solves : of each kind, fixed, names, shows, h, and data: an array (T, 1 + r) for each sensor, time first.
    contents : of (solve, sensor), what further modes would do. elapsed : s from before its start to after its end.
    """

    name: str
    failure: str = ""
    solves: list[dict[str, Any]] = field(default_factory=list)
    vectors: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    contents: dict[tuple[int, str], Content] = field(default_factory=dict)
    elapsed: float = 0.0

    @property
    def with_bodies(self) -> list[int]:
        """Numbers of the solves that move reduced bodies: watched runs, and `romerr run`, count no others."""
        return [i for i, solve in enumerate(self.solves) if solve["has_bodies"]]

    @property
    def seconds(self) -> float:
        """CPU time."""
        return self.facts.get("seconds", 0.0)


def estimates(results: Mapping[str, Result], *names: str) -> dict[tuple[str, int, int], dict[str, Verdict]]:
    """Return what a watched run says of itself: verdicts by cause, of each (sensor, component, solve).

    names : of runs, the first counts that was had. solve : among all, of which rows count those with bodies only.
    """
    rows = next((results[name].facts.get("rows", []) for name in names if name in results), [])
    solves = results["unchanged"].with_bodies
    return {(row.name, row.component, solves[row.solve]): row.of for row in rows if row.solve < len(solves)}


_RUNNING: dict[subprocess.Popen, str] = {}
_LOCK = threading.Lock()


def run_child(request: Request) -> Result:
    """Run a script once more in a process of its own; never raises for what happens there."""
    folder, begin = tempfile.mkdtemp(prefix="romerr_"), monotonic()
    try:
        return replace(_run_in(folder, request), elapsed=monotonic() - begin)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def stop_all() -> None:
    """End all processes that run_child has started here."""
    with _LOCK:
        for process in _RUNNING:
            _kill(process)


def used_by_running() -> dict[str, float]:
    """Return the CPU time, s, that runs started here have had until now, by name; empty where it is not told."""
    with _LOCK:
        processes = {name: process.pid for process, name in _RUNNING.items()}
    return {name: used for name, pid in processes.items() if (used := _cpu_time(pid)) is not None}


def _cpu_time(pid: int) -> float | None:
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii", errors="replace") as file:
            user, system = file.read().rpartition(")")[2].split()[11:13]
    except (OSError, ValueError):  # it has just ended, or this is no Linux
        return None
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def _kill(process: subprocess.Popen) -> None:
    """End a process, and what it has started."""
    if process.returncode is not None:  # its number may be another's by now
        return
    if os.name != "posix":
        process.kill()
        return
    with suppress(ProcessLookupError, PermissionError):  # it has just ended
        os.killpg(process.pid, signal.SIGKILL)


def _run_in(folder: str, request: Request) -> Result:
    path, log = os.path.join(folder, "request"), os.path.join(folder, "printed.txt")
    with open(path, "wb") as file:
        own = {"vectors": pickle.dumps(request.vectors), "temporary": tempfile.gettempdir()}
        pickle.dump(vars(request) | own, file)
    environment = {**os.environ, **QUIET}
    if request.threads:
        environment.setdefault("OPENBLAS_NUM_THREADS", request.threads)
    places = [os.path.join(request.home, x) for x in os.environ.get("PYTHONPATH", "").split(os.pathsep) if x]
    environment["PYTHONPATH"] = os.pathsep.join([_PACKAGE, *places])
    own = {"creationflags": 0x200} if os.name == "nt" else {"start_new_session": True}  # Ctrl-C is the parent's
    with open(log, "wb") as out:
        process = subprocess.Popen(
            [sys.executable, "-m", "exudyn_romerr.scripts.child", path],
            stdin=subprocess.PIPE,
            stdout=out,
            stderr=subprocess.STDOUT,
            env=environment,
            cwd=folder,  # not where modules of the user would be found before those of Python
            **own,
        )
        with _LOCK:
            _RUNNING[process] = request.name
        try:
            process.wait(request.timeout)
        except subprocess.TimeoutExpired:
            return Result(request.name, ENDED.format(request.timeout))
        finally:  # Ctrl-C comes here, too
            _kill(process)
            process.wait()
            with _LOCK:
                del _RUNNING[process]
            process.stdin.close()
    return _read(request.name, path, log, process.returncode)


_PACKAGE = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def _read(name: str, path: str, log: str, status: int) -> Result:
    """What a process has left."""
    if not os.path.exists(f"{path}.result"):
        return Result(name, _failure(status, log))
    with open(f"{path}.result", "rb") as file:
        found = Result(name, **pickle.load(file))
    error, status = found.facts["error"], found.facts["status"]
    if status and not found.solves:
        found.failure = ASKS if error.startswith(ASKED) else error or _failure(status, log)
    return found


def _failure(status: int, log: str) -> str:
    """Why there is no result, in a line."""
    if status < 0:
        return KILLED.format(-status, MEMORY if -status == getattr(signal, "SIGKILL", 9) else "")
    with open(log, encoding="utf-8", errors="replace") as file:
        lines = [line for line in file.read()[-TAIL:].split("\n") if line.strip()]
    return CRASHED.format(status, lines[-1] if lines else "it printed nothing")
