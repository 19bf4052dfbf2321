"""All ways to answer "how wrong is this run?" in one picture: what they tell over what is true, and their cost.

    python benchmarks/rivals.py [--quick] [--docs]      two minutes; --docs writes docs/figures/rivals.png

A point is what one way tells of one output of one run: its largest value over that of the true error, and the CPU
time to the answer, the run itself included, over the run alone (medians of 3 where it is short). Below 1 more is
wrong than was told.

- measured: a second run with twice the modes and half the step; tells the difference of the two, in which three
  quarters of the step's error can be at most
- rules: effective mass along z that the basis lacks, and the largest relative error of a frequency below four times
  that of the load, with true frequencies, which no hierarchical estimator can surpass; taken as shares of the largest
  value. Steps are none of their business: compared with the error that the modes make
- bounds of the paper: (11), (26), (25), of the steps, too
- ours: estimate (its middle) and bound

Linear bodies (the paper's linkage with Krylov bases; those of mode_rules.py with Craig-Bampton ones) under a load
sin(W t): all of these, against closed forms. Mechanisms of models/estimate_scenes.py: measured and ours, which alone
are made for them; against all modes and converged steps. A bound of a mechanism is compared with what it covers, the
error by the modes. Left out: true errors below ten times what is uncertain of them.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import exudyn as exu
import numpy as np
import scipy.linalg as la
from exudyn import itemInterface

import exudyn_romerr as romerr
from benchmarks import page
from benchmarks.by_run import told_by_run
from benchmarks.estimates import bodies_of
from benchmarks.mode_rule_cases import Held, bodies
from benchmarks.rivals_figure import draw
from benchmarks.told_and_true import ITERATED
from exudyn_romerr.linalg.oscillator import damping_ratios
from models import estimate_truths, exact, floating, linkage
from models.estimate_scenes import SCENES

PICTURE = page.FIGURES / "rivals.png"
PAPERS = {"paper (11)": "state-space", "paper (26)": "fast", "paper (25)": "convolution"}
MECHANISMS = ("slider_crank", "sprung_body", "double_pendulum", "hinged_bar", "clamped_bar", "driven_bar", "wishbone")
LOADED = 0.4  # frequency of the load over the lowest one of the body
SEEN = 4.0  # times the load's frequency: what lies below is to be right
PERIODS, A_PERIOD = 20, 100  # of the lowest mode, steps in each
REPEATS, LONG = 3, 3.0  # runs; s: longer ones are not repeated
KNOWN = 10.0  # times what is uncertain of a truth: smaller errors are left out
ROUNDED = 1e-10  # of the largest value: what closed forms leave


class Claim(NamedTuple):
    """What a way tells of the error of an output, what that is; cost: CPU time over that of the bare run."""

    way: str
    scene: str
    cost: float
    told: float
    true: float


def timed(make: Callable[[], Any], repeats: int = REPEATS) -> tuple[float, Any]:
    """Return the CPU time in s, a median, and what was made last."""
    seconds = []
    for _ in range(repeats):
        begin = process_time()
        found = make()
        seconds.append(process_time() - begin)
        if seconds[-1] > LONG:
            break
    return median(seconds), found


def largest(x: np.ndarray) -> float:
    """Return the largest length of (T,) or (T, r) over time."""
    return float(np.linalg.norm(x.reshape(len(x), -1), axis=1).max())


@dataclass
class Linear:
    """A linear body and its load sin(W t) from rest.

    make : -> body, nothing computed yet. vectors : n -> V (N, n). load, moved (N,) : that of the load, that of the
    mass along z. outputs : rows (N,) by name.
    """

    name: str
    make: Callable[[], romerr.ElasticBody]
    vectors: Callable[[int], np.ndarray]
    load: np.ndarray
    moved: np.ndarray
    outputs: dict[str, np.ndarray]

    def __post_init__(self) -> None:
        self.body = self.make()
        found = self.body.all_modes()
        self.omega, self.modes = found.omega, self.body.expand(found.shapes)
        self.W, self.h = LOADED * self.omega[0], 2 * np.pi / (A_PERIOD * self.omega[0])
        self.rows = np.array([*self.outputs.values()])

    def motion(self, omega: np.ndarray, shapes: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Return what the outputs show at t, (T, r), of a body with these modes (N, m), in closed form."""
        zero, zeta = np.zeros(len(omega)), damping_ratios(omega, *self.body.rayleigh)
        return exact.ForcedModes(omega, zeta, shapes.T @ self.load, shapes, self.W, zero, zero).output(self.rows, t)

    @cached_property
    def times(self) -> np.ndarray:
        """Instants of the steps."""
        return self.h * np.arange(PERIODS * A_PERIOD + 1)

    @cached_property
    def truth(self) -> np.ndarray:
        """Of the full body, (T, r)."""
        return self.motion(self.omega, self.modes, self.times)

    def run(self, n: int, finer: int = 1, estimators: Any = None) -> Any:
        """Return what a run of Exudyn shows, (T, r), at the instants of its steps; estimators: the report."""
        body, V = self.make(), self.vectors(n)
        mbs = exu.SystemContainer().AddSystem()
        flex = romerr.add_reduced_body(
            mbs, body, romerr.Basis(V), inputs=self.load[:, None], input_function=lambda t: np.sin(self.W * t)
        )
        if estimators:
            shown = [romerr.Output(name, row) for name, row in self.outputs.items()]
            monitor = romerr.attach(mbs, flex, outputs=shown, estimators=estimators)
        else:
            state = itemInterface.SensorNode(
                nodeNumber=flex.items["nGenericODE2"],
                outputVariableType=exu.OutputVariableType.Coordinates,
                storeInternal=True,
            )
            sensor = mbs.AddSensor(state)
        mbs.Assemble()
        mbs.SolveDynamic(floating.solver_settings(self.h / finer, self.times[-1]))
        if estimators:
            return monitor.report()
        return mbs.GetSensorStoredData(sensor)[::finer, 1:] @ (self.rows @ V).T

    def reduced_modes(self, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Return frequencies and shapes (N, n) of the reduced body."""
        in_modes = la.orth(self.modes.T @ (self.body.mass @ self.vectors(n)))
        squares, turn = la.eigh(in_modes.T @ (self.omega[:, None] ** 2 * in_modes))
        return np.sqrt(squares), self.modes @ (in_modes @ turn)

    def claims(self, n: int) -> Iterator[Claim]:
        """Yield all of a run with n modes."""
        scene, times = f"{self.name}, n = {n}", {}
        times["run"], shown = timed(lambda: self.run(n))
        bare, size = times["run"], np.abs(shown).max(axis=0)
        whole = np.abs(self.truth - shown).max(axis=0)
        (omega, shapes), floor = self.reduced_modes(n), ROUNDED * size
        of_modes = np.abs(self.truth - self.motion(omega, shapes, self.times)).max(axis=0)

        def claim(way: str, seconds: float, told: np.ndarray, true: np.ndarray) -> Iterator[Claim]:
            for x, y, left in zip(told, true, floor, strict=True):
                if y > KNOWN * left:
                    yield Claim(way, scene, seconds / bare, float(x), float(y))

        seconds, finer = timed(lambda: self.run(2 * n, finer=2))
        yield from claim("2 n modes, h/2", bare + seconds, np.abs(finer - shown).max(axis=0), whole)
        seconds, lacking = timed(lambda: self.lacking_mass(n))
        yield from claim("effective mass", bare + seconds, lacking * size, of_modes)
        seconds, off = timed(lambda: self.frequencies_off(n))
        yield from claim("frequencies", bare + seconds, off * size, of_modes)
        for way, estimator in PAPERS.items():
            seconds, report = timed(lambda estimator=estimator: self.run(n, estimators=(estimator,)))
            yield from claim(way, seconds, self.most(report), whole)
        seconds, report = timed(lambda: self.run(n, estimators="auto"))
        about = np.array([np.abs(report.output(name).estimate).max() for name in self.outputs])
        yield from claim("our estimate", seconds, about, whole)
        yield from claim("our bound", seconds, self.most(report), whole)

    def most(self, report: Any) -> np.ndarray:
        """Return the largest bounds (r,)."""
        return np.array([report.output(name).bound["best"].max() for name in self.outputs])

    def lacking_mass(self, n: int) -> float:
        """Return the share of the effective mass along z that the reduced body lacks."""
        V = self.vectors(n)
        seen = V.T @ self.moved
        return 1 - float(seen @ np.linalg.solve(V.T @ (self.body.mass @ V), seen)) / self.whole_mass

    @cached_property
    def whole_mass(self) -> float:
        """Effective mass of all modes."""
        return float(np.sum((self.modes.T @ self.moved) ** 2))

    def frequencies_off(self, n: int) -> float:
        """Return the largest relative error of a frequency below SEEN times the load's, of the lowest at least."""
        body, V = self.make(), self.vectors(n)
        count = min(max(1, int(np.sum(self.omega < SEEN * self.W))), V.shape[1])
        M, K = (V.T @ (matrix @ V) for matrix in (body.mass, body.stiffness))
        found = np.sqrt(la.eigh(K, M, eigvals_only=True)[:count])
        return float(np.max(np.abs(found / body.modes(count).omega - 1)))


def of_held(held: Held, load: str) -> Linear:
    """Return a body of mode_rules.py with Exudyn's Craig-Bampton modes, RBE3 interfaces."""
    V = held.craig_bampton
    options = (lambda n: V[:, : 6 + n], held.loads[load], held.loads["shaken"], held.outputs)
    return Linear(f"{held.name}, {load}", held.new_body, *options)


def of_linkage() -> Linear:
    """Return the paper's example."""
    body, inputs, output = linkage.build()
    along = np.zeros(body.N)
    along[2::6] = 1.0
    row = {"tip": output.resolve(body)[0]}
    vectors = {n: romerr.krylov_basis(body, inputs, n).V for n in (4, 6, 8, 12)}
    return Linear("linkage", lambda: linkage.build()[0], vectors.get, inputs[:, 0], body.mass @ along, row)


def of_mechanism(name: str, n: int) -> Iterator[Claim]:
    """Yield the claims of a scene of models/ with n eigenmodes and RBE3 interfaces."""
    scene = SCENES[name]

    def motion(n: int, finer: int) -> dict[str, np.ndarray]:
        return estimate_truths.motion(scene.make(n, "RBE3", scene.h), scene.h, finer)

    def told() -> Any:
        made, flexes = bodies_of(scene, n, "RBE3")
        return told_by_run(made.mbs, flexes, lambda: estimate_truths.motion(made, scene.h))[1]

    (bare, shown), (rival, finer), (ours, report) = (
        timed(lambda: motion(n, 1)),
        timed(lambda: motion(2 * n, 2)),
        timed(told),
    )
    for key, truth in estimate_truths.stored(name).items():
        floor = KNOWN * np.linalg.norm(truth.off + ITERATED * np.abs(truth.value).max())
        whole, of_modes = (largest(x - shown[key]) for x in (truth.value, truth.same_steps))
        out, label = report.outputs.get(key), f"{name}, n = {n}"
        if whole > floor:
            yield Claim("2 n modes, h/2", label, (bare + rival) / bare, largest(finer[key] - shown[key]), whole)
            if out is not None and out.estimate is not None:
                yield Claim("our estimate", label, ours / bare, largest(out.estimate), whole)
        if out is not None and of_modes > floor and np.isfinite(out.bound["best"]).all():
            yield Claim("our bound", label, ours / bare, largest(out.bound["best"]), of_modes)


def all_claims(quick: bool = False) -> list[Claim]:
    """Return the claims of all scenes; quick: of few."""
    paper = of_linkage()
    found = [claim for n in ((4,) if quick else (4, 6)) for claim in paper.claims(n)]
    for held in islice(bodies(), 1 if quick else 6):
        for load, sizes in (("force", (2,)),) if quick else (("force", (2, 8)), ("shaken", (4,))):
            scene = of_held(held, load)
            found += [claim for n in sizes for claim in scene.claims(n)]
            print(scene.name, file=sys.stderr, flush=True)
    for name in MECHANISMS[3:4] if quick else MECHANISMS:
        for n in SCENES[name].n[:1]:
            found += of_mechanism(name, n)
            print(name, file=sys.stderr, flush=True)
    return found


def table(claims: list[Claim]) -> str:
    """Return a line for each way."""
    head = f"{'told / true':<18}{'numbers':>8}{'below 0.9':>11}{'least':>10}{'median':>10}{'most':>10}{'cost':>8}"
    lines = [head]
    for way in dict.fromkeys(claim.way for claim in claims):
        of = [claim for claim in claims if claim.way == way]
        ratios = np.array([claim.told / claim.true for claim in of])
        sizes = "".join(f"{x:10.4g}" for x in (ratios.min(), np.median(ratios), ratios.max()))
        lines.append(
            f"{way:<18}{len(of):8d}{np.mean(ratios < 0.9):11.0%}{sizes}{np.median([claim.cost for claim in of]):8.2f}"
        )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> list[Claim]:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="three scenes")
    parser.add_argument("--picture", type=Path, default=page.ROOT / "examples" / "results" / "rivals.png")
    parser.add_argument("--docs", action="store_true", help=f"write picture and {page.PAGE.name}")
    given = parser.parse_args(arguments)
    claims = all_claims(given.quick)
    text = table(claims)
    page.show("rivals", text, given.docs)
    draw(claims, PICTURE if given.docs else given.picture)
    return claims


if __name__ == "__main__":
    main()
