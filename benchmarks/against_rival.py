"""What `romerr run` costs beside the bare script, and what brute force costs: twice the modes with half the step.

    python benchmarks/against_rival.py [--exudyn CHECKOUT] [--pairs 5] [--only NAME ...] [--docs]

CHECKOUT is a work tree of github.com/jgerstmayr/EXUDYN (needs ngsolve): six of its scripts are run besides the scenes
of models/. Every run is a process of its own, in turn bare (no hook of ours), all in (`romerr run`, report and table
included; of the linkage, whose body `romerr run` does not look for, two lines and a report) and rival (one run with
2 n modes and h/2). CPU time of the process, less what the imports take, which is told apart: those of Exudyn, ngsolve
and scipy's parts that any run needs, and those of the package. Medians of the pairs. "all in" and "rival" are over
the bare process; "by solve" is 1 + (all in - bare) / bare solves, and the same of the rival: what comes before the
solve, meshing and modes, is in the former only.
"""

from __future__ import annotations

import argparse
import contextlib
import inspect
import io
import json
import runpy
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import wraps
from importlib import import_module
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks import page
from benchmarks.exudyn_examples import environment, put, scripts_in

HOW = ("bare", "all in", "rival")
MARK = "against rival"
IMPORTS = ("exudyn", "exudyn.FEM", "exudyn.utilities", "scipy.sparse.linalg", "ngsolve")
RUN = ("__main__", "mbs.scenes.recorded_solve", "scripts.run")
ATTACHED = ("mbs", "mbs.monitoring.mechanism_run")
EXUDYNS = (
    "NGsolveCraigBampton",
    "NGsolveCMStest",
    "perfObjectFFRFreducedOrder",
    "CMSexampleCourse",
    "objectFFRFreducedOrderTest",
    "abaqusImportTest",
)
FLOATING = "from models import floating\nscene = floating.pendulum({n}, h={h}, t_end={end})\nscene.solve()\n"
MECHANISM = (
    "from models import mechanisms\nscene = mechanisms.double_pendulum({n}, h={h}, t_end={end})\nscene.solve()\n"
)
WISHBONE = """from examples import wishbone_suspension as quarter
scene, _ = quarter.scene_of(quarter.SHOWN[0], {n}, {end}, bounds=False)
settings = scene.settings.timeIntegration
settings.endTime, settings.numberOfSteps = {end}, round({end} / {h})
scene.mbs.SolveDynamic(scene.settings)
"""
LINKAGE = """import exudyn as exu
import exudyn_romerr as romerr
from models import linkage
body, B, out = linkage.build()
mbs = exu.SystemContainer().AddSystem()
basis = romerr.krylov_basis(body, B, {n})
flex = romerr.add_reduced_body(mbs, body, basis, inputs=B, input_function=linkage.force)
watched = {watched}
monitor = romerr.attach(mbs, flex, outputs=[out], estimators={estimators}) if watched else None
mbs.Assemble()
settings = exu.SimulationSettings()
settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = {end}, round({end} / {h})
settings.timeIntegration.verboseMode = 0
mbs.SolveDynamic(settings)
if watched:
    print(monitor.report())
"""


class Scene(NamedTuple):
    """A script with n modes and steps of h (s) until `end` (s), to be filled in.

    own : the estimators of our two lines, which are in the script itself; empty: `romerr run` runs it.
    """

    text: str
    n: int
    h: float
    end: float
    own: str = ""

    def script(self, how: str, scale: float) -> str:
        """Return the script; scale: share of the time until the end."""
        times = 1 + (how == "rival")
        watched = {"watched": how == "all in", "estimators": self.own}
        return self.text.format(n=times * self.n, h=self.h / times, end=scale * self.end, **watched)


SCENES = {
    "pendulum, 14 modes": Scene(FLOATING, 8, 1e-4, 0.2),
    "double pendulum, 2 x 30 modes": Scene(MECHANISM, 24, 2e-4, 0.2),
    "wishbone, 14 modes": Scene(WISHBONE, 8, 5e-4, 0.5),
    "linkage, 12 modes, 'auto'": Scene(LINKAGE, 12, 1e-3, 20.0, "'auto'"),
    "linkage, 12 modes, the paper's": Scene(LINKAGE, 12, 1e-3, 20.0, "('fast', 'convolution')"),
}


class Seconds(NamedTuple):
    """CPU seconds of a process: imports that every run needs, those of the package, all else, solves among these."""

    imports: float
    package: float
    rest: float
    solves: float


@contextlib.contextmanager
def twice() -> Iterator[None]:
    """Let scripts make twice the modes, and twice the steps in every dynamic solve."""
    import exudyn as exu
    from exudyn.FEM import FEMinterface

    from exudyn_romerr.mbs.scenes.variation import CALLS  # here, for imports of the package are told apart

    of_ngsolve = {f"{name}NGsolve": CALLS[name] for name in ("ComputeHurtyCraigBamptonModes", "ComputeEigenmodes")}
    with contextlib.ExitStack() as stack:
        for name, argument in (CALLS | of_ngsolve).items():
            _replace(stack, FEMinterface, name, lambda call, argument=argument: _with_modes(call, argument))
        _replace(stack, exu.MainSolverImplicitSecondOrder, "SolveSystem", _with_steps)
        yield


def _replace(stack: contextlib.ExitStack, owner: Any, name: str, change: Callable) -> None:
    kept = getattr(owner, name)
    stack.callback(setattr, owner, name, kept)
    setattr(owner, name, change(kept))


def _with_modes(call: Callable, argument: str) -> Callable:
    @wraps(call)
    def changed(*arguments: Any, **options: Any) -> Any:
        bound = inspect.signature(call).bind(*arguments, **options)
        bound.arguments[argument] *= 2
        return call(*bound.args, **bound.kwargs)

    return changed


def _with_steps(call: Callable) -> Callable:
    @wraps(call)
    def changed(solver: Any, mbs: Any, settings: Any, *arguments: Any) -> Any:
        integration = settings.timeIntegration
        count, integration.numberOfSteps = integration.numberOfSteps, 2 * integration.numberOfSteps
        try:
            return call(solver, mbs, settings, *arguments)
        finally:
            integration.numberOfSteps = count

    return changed


@contextlib.contextmanager
def timed_solves(seconds: list[float]) -> Iterator[None]:
    """Add the CPU time of each solve to a list."""
    import exudyn as exu

    def timed(call: Callable) -> Callable:
        @wraps(call)
        def solve(*arguments: Any, **options: Any) -> Any:
            begin = process_time()
            try:
                return call(*arguments, **options)
            finally:
                seconds.append(process_time() - begin)

        return solve

    with contextlib.ExitStack() as stack:
        for name in ("MainSolverImplicitSecondOrder", "MainSolverStatic"):
            _replace(stack, getattr(exu, name), "SolveSystem", timed)
        yield


def child(script: str, how: str, own: bool) -> None:
    """Run a script in this process; print its Seconds."""
    for name in IMPORTS:
        with contextlib.suppress(ImportError):  # ngsolve may not be there
            import_module(name)
    imports = process_time()
    for name in ATTACHED if own else RUN if how == "all in" else ():
        import_module(f"exudyn_romerr.{name}")
    if how == "all in":
        import_module("scipy.interpolate")  # which the package imports where tangents vary over time
    package, solves = process_time(), []
    sys.argv = [script]
    with twice() if how == "rival" and not own else contextlib.nullcontext(), timed_solves(solves):
        if how == "all in" and not own:
            with contextlib.redirect_stdout(io.StringIO()):
                import_module("exudyn_romerr.__main__").main(["run", script])
        else:
            with contextlib.suppress(Exception):  # some fail after their solves, where files of their author's lack
                runpy.run_path(script, run_name="__main__")
    if not solves:
        raise RuntimeError(f"{script} has not solved anything")
    found = Seconds(imports, package - imports, process_time() - package, sum(solves))
    print("\n" + json.dumps(found))


def run(script: Path, how: str, own: bool) -> Seconds:
    """Run a script in a process and a folder of its own, with its test data."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / how
        put(script, folder)
        command = [sys.executable, __file__, "--child", script.name, how, *(["--own"] if own else [])]
        around = environment(script, Path(place) / "states.npz")
        done = subprocess.run(command, cwd=folder, env=around, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{script.name}, {how}: {done.stderr[-2000:]}")
        return Seconds(*json.loads(done.stdout.strip().splitlines()[-1]))


def measured(name: str, checkout: Path | None, rounds: int, scale: float = 1.0) -> dict[str, list[Seconds]]:
    """Return what each kind of run took, so many times in turn; scale: of the time until the end, of our scenes."""
    if name in EXUDYNS:
        script = next(path for path in scripts_in(checkout) if path.stem == name)
        rows = [{how: run(script, how, False) for how in HOW} for _ in range(rounds)]
    else:
        scene, rows = SCENES[name], []
        with tempfile.TemporaryDirectory() as place:
            paths = {how: Path(place) / f"{how.replace(' ', '_')}.py" for how in HOW}
            for how, path in paths.items():
                path.write_text(scene.script(how, scale), encoding="utf-8")
            own = bool(scene.own)
            # the rival of a scene is in its text: modes and steps are doubled there
            rows = [
                {how: run(paths[how], "bare" if how == "rival" else how, own) for how in HOW} for _ in range(rounds)
            ]
    return {how: [row[how] for row in rows] for how in HOW}


def row_of(name: str, found: dict[str, list[Seconds]]) -> str:
    """Return the line of a scene."""
    rest = {how: np.array([one.rest for one in runs]) for how, runs in found.items()}
    bare, ours = found["bare"], found["all in"]
    solves = np.array([one.solves for one in bare])
    by_solve = [1 + np.median((rest[how] - rest["bare"]) / solves) for how in HOW[1:]]
    whole = [np.median(rest[how] / rest["bare"]) for how in HOW[1:]]
    imports, package = np.median([one.imports for one in ours]), np.median([one.package for one in ours])
    ratios = "".join(f"{x:10.2f}" for x in (*whole, *by_solve))
    times = f"{np.median(rest['bare']):9.3g}{np.median(solves):9.3g}"
    return f"{name:<32}{times}{ratios}{imports:11.2f}{package:9.2f}"


def table(names: list[str], checkout: Path | None, rounds: int, scale: float = 1.0) -> str:
    """Measure scenes; return the table."""
    head = f"{f'CPU time, medians of {rounds}':<32}{'bare s':>9}{'solves s':>9}{'all in':>10}{'rival':>10}"
    lines = [f"{head}{'by solve':>10}{'rival':>10}{'imports s':>11}{'package':>9}"]
    for name in names:
        lines.append(row_of(name, measured(name, checkout, rounds, scale)))
        print(lines[-1], file=sys.stderr, flush=True)
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> str:
    """Measure, print and return the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--exudyn", type=Path, metavar="CHECKOUT", help="work tree of Exudyn's repository")
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--only", nargs="+", choices=[*EXUDYNS, *SCENES], metavar="NAME")
    parser.add_argument(
        "--scale", type=float, default=1.0, help="of the time until the end, of the scenes of models/"
    )
    parser.add_argument("--docs", action="store_true", help=f"write the table into {page.PAGE.name}")
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--own", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.child:
        child(*options.child, options.own)
        return ""
    names = options.only or [*(EXUDYNS if options.exudyn else ()), *SCENES]
    if not options.exudyn and set(names) & set(EXUDYNS):
        parser.error("scripts of Exudyn need --exudyn CHECKOUT")
    return page.show(
        MARK, table(names, options.exudyn and options.exudyn.resolve(), options.pairs, options.scale), options.docs
    )


if __name__ == "__main__":
    main()
