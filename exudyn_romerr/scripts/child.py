"""A process that runs a script once more, changed as a request says: python -m exudyn_romerr.scripts.child FILE.

FILE is a pickle, and so is what came of it: FILE.result. Ends with its parent.
"""

from __future__ import annotations

import importlib.util
import os
import pickle
import sys
import tempfile
import threading
from contextlib import ExitStack
from time import monotonic, process_time
from typing import TYPE_CHECKING, Any

from .after_import import after_import
from .execute import Ending, execute
from .overlay import Overlay, write_only_in

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

    from ..report.judgement import Solve
    from ..report.verdicts import Row

ORPHANED = 5  # exit status of a process whose parent has gone


def main(path: str) -> None:
    """Run what a request asks for."""
    with open(path, "rb") as file:
        request = pickle.load(file)
    scratch = os.path.dirname(os.path.abspath(path))
    overlay = Overlay(_made(scratch, "run"), request["home"], (scratch, request["temporary"]))
    _end_with_parent(overlay)
    child = _Child(request, overlay)
    tempfile.tempdir = os.environ["TMPDIR"] = _made(scratch, "temporary")
    request["script"] = overlay.enter(request["script"])
    write_only_in(overlay.free)
    begin = process_time()
    ending = child.run()
    found = child.found(ending, process_time() - begin)
    with open(f"{path}.part", "wb") as file:
        pickle.dump(found, file)
    os.replace(f"{path}.part", f"{path}.result")


def _made(folder: str, name: str) -> str:
    path = os.path.join(folder, name)
    os.mkdir(path)
    return path


def _end_with_parent(overlay: Overlay) -> None:
    """End when the parent does, which holds the other end of stdin, and leave nothing; a script's stdin is empty."""
    line = os.dup(0)
    empty = os.open(os.devnull, os.O_RDONLY)
    os.dup2(empty, 0)
    os.close(empty)

    def wait() -> None:
        while os.read(line, 1):
            pass
        overlay.remove()
        os._exit(ORPHANED)

    threading.Thread(target=wait, daemon=True).start()


class _Child:
    """One run: what stands in front of Exudyn, and what it has seen."""

    def __init__(self, request: dict[str, Any], overlay: Overlay):
        self.request, self.overlay = request, overlay
        self.variation: Any = None
        self.watched: Any = None
        self.bodies: Any = None
        self.vectors: dict[int, Any] = {}
        self.vector_seconds = 0.0
        self.notes: list[str] = []

    def run(self) -> Ending:
        """Run the script, or the function that makes and solves the scene."""
        with ExitStack() as stack:
            stack.enter_context(after_import("exudyn", self._meet))
            stack.enter_context(
                after_import("exudyn.FEM", lambda fem: self.variation and self.variation.install_fem(fem))
            )
            if self.request["function"]:
                return self._built()
            ending = execute(self.request["script"], self.request["arguments"])
        ending.show()
        return ending

    def _built(self) -> Ending:
        """Call a function of a file: build() -> (mbs, ..., simulationSettings), or one that solves by itself."""
        spec = importlib.util.spec_from_file_location("romerr_scene", self.request["script"])
        module = importlib.util.module_from_spec(spec)
        sys.path.insert(0, os.path.dirname(self.request["script"]))
        try:
            spec.loader.exec_module(module)
            made = getattr(module, self.request["function"])()
            if isinstance(made, tuple) and len(made) > 1 and hasattr(made[0], "SolveDynamic"):
                made[0].SolveDynamic(made[-1])
        except Exception as error:  # as of a script: what was solved until then is kept
            return Ending(1, error)
        return Ending()

    def _meet(self, exudyn: ModuleType) -> None:
        from ..mbs.scenes.found_bodies import FoundBodies
        from ..mbs.scenes.variation import Variation
        from ..mbs.scenes.watched_solves import WatchedSolves

        request = self.request
        self.bodies = FoundBodies()
        self.bodies.install(exudyn)
        if request["watch"]:
            self.watched = WatchedSolves(self.bodies)
            self.watched.install(exudyn)
        self.variation = Variation(
            self.bodies,
            request["steps"],
            pickle.loads(request["vectors"]),  # not before: whoever reads arrays imports numpy
            request["factor"],
            request["hold"],
            self.overlay.place,
            self._make_vectors,
            request["numbers"],
            request["further"],
        )
        self.variation.install(exudyn)

    def _make_vectors(self, mbs: Any) -> None:
        """Make vectors of each body when the first solve with it begins."""
        if not self.request["make_vectors"]:
            return
        begin = monotonic()
        from ..mbs.scenes.wider_body import vectors_of

        for body in self.bodies.of(mbs):
            if body.order not in self.vectors:
                try:
                    self.vectors[body.order] = vectors_of(mbs, body)
                except Exception as error:  # of a body that cannot be read: others can
                    self.vectors[body.order] = None
                    self.notes.append(f"body {body.number}: {error}")
        self.vector_seconds += monotonic() - begin

    def found(self, ending: Ending, seconds: float) -> dict[str, Any]:
        """Return what came of it, as Result has it."""
        variation, watched = self.variation, [] if self.watched is None else self.watched.solves
        solves = [] if variation is None else variation.solves
        facts = {
            "calls": [] if variation is None else variation.calls,
            "our_seconds": sum(solve.our_seconds for solve in watched),
            "status": ending.status,
            "error": "" if ending.error is None else _in_a_line(ending.error),
            "seconds": seconds,
            "peak": _peak_memory(),
            "solve_seconds": sum(solve.seconds for solve in solves),
            "vector_seconds": self.vector_seconds,
            "has_controllers": variation is not None and variation.has_controllers,
            "modes": [] if self.bodies is None else self.bodies.modes,
            "bodies": 0 if self.bodies is None else self.bodies.count,
            "may_be_rigid": variation is None or variation.may_be_rigid,
            "without_vectors": [order for order, found in self.vectors.items() if found is None],
            "notes": [*self.notes, *(f"refused to write {path}" for path in dict.fromkeys(self.overlay.refused))],
            "rows": self._rows(watched),
        }
        return {
            "solves": [vars(solve) for solve in solves],
            "vectors": {order: tuple(found) for order, found in self.vectors.items() if found is not None},
            "facts": facts,
            "contents": {(solve.number, name): one for solve in watched for name, one in solve.content.items()},
        }

    def _rows(self, watched: Sequence[Solve]) -> list[Row]:
        """What a watched run says of itself."""
        if not watched:
            return []
        from ..report.answers import Tolerances
        from ..report.judgement import rows_of_solve

        asked = Tolerances(self.request["tolerance"])
        return [row for solve in watched for row in rows_of_solve(solve, asked)]


def _in_a_line(error: BaseException) -> str:
    """What Python prints of an error; without the places that Exudyn adds to those of user functions."""
    return " ".join(f"{type(error).__name__}: {error}".partition("\n\nAt:")[0].split())


def _peak_memory() -> int:
    """Bytes that this process has had at most; 0 where the system does not tell."""
    try:
        with open("/proc/self/status", encoding="utf-8") as status:
            line = next((line for line in status if line.startswith("VmHWM:")), "VmHWM: 0 kB")
    except OSError:
        return 0
    return 1024 * int(line.split()[1])


if __name__ == "__main__":
    main(sys.argv[1])
