"""How often the package goes from file to file, and from folder to folder: at the begin of a solve, in 20 steps.

    python benchmarks/folder_changes.py

Runs with whatever version of the package PYTHONPATH names. A change is a call or a return after which code of another
file runs; "again" counts those to a file that was left before.
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))

import exudyn_romerr as romerr
from models import floating, mechanisms

PACKAGE = str(Path(romerr.__file__).parent) + os.sep
STEPS = 20


class Route:
    """The files of the package that run, one after another, while `watch` calls something."""

    def __init__(self) -> None:
        self.files: list[str] = []
        self._stack: list[str] = []

    def _see(self, frame: Any, event: str, argument: Any) -> None:
        name = frame.f_code.co_filename
        if not name.startswith(PACKAGE) or event not in ("call", "return"):
            return
        if event == "call":
            self._stack.append(name.removeprefix(PACKAGE))
        elif self._stack:
            self._stack.pop()
        if self._stack and (not self.files or self.files[-1] != self._stack[-1]):
            self.files.append(self._stack[-1])

    def watch(self, work: Callable) -> "Route":
        """Follow a call."""
        sys.setprofile(self._see)
        try:
            work()
        finally:
            sys.setprofile(None)
        return self


def counts(places: list[str]) -> tuple[int, int, int]:
    """Number of different places on a route, of changes from one to the next, and of those to a place left before."""
    route = [place for i, place in enumerate(places) if i == 0 or place != places[i - 1]]
    different = len(set(route))
    return different, max(len(route) - 1, 0), len(route) - different


def line(name: str, route: Route) -> str:
    """One row of the table."""
    files, folders = counts(route.files), counts([os.path.dirname(file) for file in route.files])
    return f"{name:<34}" + "".join(f"{number:>9}" for number in (*files, *folders))


def bar() -> tuple:
    """Clamped bar of the README."""
    scene = floating.clamped_bar(4, h=2e-4, t_end=STEPS * 2e-4)
    return scene, [romerr.attach(scene.mbs, romerr.floating_body(scene.fem, scene.items))]


def pendulum() -> tuple:
    """Two bars, coupled."""
    scene = mechanisms.double_pendulum(4, t_end=STEPS * 2e-3)
    return scene, [romerr.attach(scene.mbs, romerr.floating_body(scene.fem, items)) for items in scene.bodies]


def main() -> None:
    """Print the table."""
    print(f"{'':<34}{'files':>9}{'changes':>9}{'again':>9}{'folders':>9}{'changes':>9}{'again':>9}")
    for name, make in (("README's bar", bar), ("double pendulum", pendulum)):
        scene, monitors = make()
        scene.mbs.Assemble()
        print(line(f"{name}: begin of a solve", Route().watch(lambda: scene.mbs.SolveDynamic(scene.settings))))  # noqa: B023
        print(line(f"{name}: {STEPS} steps", Route().watch(lambda: monitors[0].runs)))  # noqa: B023


if __name__ == "__main__":
    main()
