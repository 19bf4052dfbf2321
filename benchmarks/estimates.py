"""Estimates of the whole error beside runs of reduced models, against truths: all modes, steps that do not matter.

Scenes and truths: models/estimate_scenes.py, models/estimate_truths.py. A component of an output is compared if its
largest error is above 1e-6 of the output, the truth is known to 1 % of that error, and less than 5 % of it is ringing
that the steps do not resolve (scope complete: whatever rings); what is left out is listed.

Ringing: a mode of the reduced mechanism about its initial state has the phase error phi = c (omega h)^2 omega t with
c = 1/12 + 3/8 ((1 - rho)/(1 + rho))^2 at the end, or when its damping forgets it, t = 1/decay rate, if that is
earlier. The part of the error above 3/4 of the frequency that generalised-alpha gives to the slowest mode of phi
above 0.1 is taken for ringing: loads of the scenes are slower.

    python benchmarks/estimates.py [--only SCENES] [--table docs/measured.md]
"""

import argparse
import os
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from scipy import signal

import exudyn_romerr as romerr
from benchmarks import page
from exudyn_romerr.report.scope import COMPLETE
from models import estimate_truths
from models.estimate_scenes import SCENES, EstimateScene, LinearScene

ABOVE = 1e-6  # of an output: smaller errors are Newton's tolerance and rounding
KNOWN = 0.01  # of an error: what a truth may be off by
PHASE = 0.1  # rad: modes beyond it are not resolved
RINGING = 0.05  # of the error
BELOW = 0.75  # of the slowest unresolved frequency: what is faster counts as ringing
RESOLVED = 0.3  # of an estimate: a larger uncertainty makes it "not resolved"
FRAME = {"slider_crank": 0.06}  # bars: shares of errors, of scenes that are not told within 5 %, or far closer
GLOBAL = {"double_pendulum": 2e-3, "sprung_body": 0.03, "slider_crank": 0.035, "wishbone_fine": 0.07}
TINY = np.finfo(float).tiny
TIMES = 2.0  # uncertainties that errors are to lie within
MARK = "estimates"
COMPONENTS = "xyz"
HEAD = (
    f"{'':<48}{'error':>10}{'of it':>8}{'steps: true':>13}{'est.':>10}{'basis: true':>13}{'est.':>10}"
    f"{'off by':>9}{'bar':>6}{'within':>8}{'unc./off':>10}{'resolved':>10}{'ringing':>9}"
)


@dataclass(frozen=True)
class Row:
    """What was found of a component of an output; sizes are largest values over time.

    error : of the run. share : of the output. steps, basis : error by cause, true and estimated. off : of the
    estimate, by error. within : share of instants with an error inside estimate +- 2 uncertainties. wide :
    uncertainty by what the estimate is off. resolved : whether the uncertainty is small beside the estimate.
    ringing : its share of the error. left_out : why it is not compared.
    """

    scene: str
    n: int
    h: float
    name: str
    axes: str
    error: float
    share: float
    steps: tuple[float, float]
    basis: tuple[float, float]
    off: float
    within: float
    wide: float
    resolved: bool
    ringing: float
    left_out: str

    def __str__(self) -> str:
        label = f"{self.scene}, n = {self.n}, {1e3 * self.h:g} ms: {self.name}"
        sizes = "".join(f"{true:>13.2e}{found:>10.1e}" for true, found in (self.steps, self.basis))
        found = f"{100 * self.off:8.2g}%{100 * bar_of(self):5.2g}%{100 * self.within:7.0f}%{self.wide:10.2g}"
        found += f"{'yes' if self.resolved else 'no':>10}{100 * self.ringing:8.2g}%"
        return f"{label:<48}{self.error:10.2e}{self.share:8.0e}{sizes}{found}"


def bar_of(row: Row) -> float:
    """Return what the estimate may be off by; more than in version 0.2 (3 and 5 %): slider crank and wishbone."""
    if row.axes == "joint":
        return 0.1
    bars = FRAME if row.axes == "frame" else GLOBAL
    return bars.get(row.scene, 0.05)


def slowest_unresolved(made, h: float, t_end: float) -> float:
    """Return the frequency (rad/s) that the integrator gives to the slowest mode of a phase error above PHASE."""
    rho = made.settings.timeIntegration.generalizedAlpha.spectralRadius
    roots = exu.solver.ComputeODE2Eigenvalues(
        made.mbs, made.settings, computeComplexEigenvalues=True, useAbsoluteValues=False, autoAssemble=False
    )[0]
    omega, decay = np.abs(roots), np.maximum(-np.real(roots), 1 / t_end)
    c = 1 / 12 + 3 / 8 * ((1 - rho) / (1 + rho)) ** 2
    rings = np.abs(np.imag(roots)) > decay / 10  # others do not swing
    phase = c * (omega * h) ** 2 * omega / decay
    return float(np.min(2 / h * np.arctan(omega * h / 2), where=rings & (phase > PHASE), initial=np.inf))


def ringing_of(error: np.ndarray, h: float, slowest: float) -> np.ndarray:
    """Return the part of errors (T, r) that is above BELOW of a frequency."""
    if not np.isfinite(slowest):
        return np.zeros_like(error)
    sections = signal.butter(4, BELOW * slowest, "highpass", fs=2 * np.pi / h, output="sos")
    return signal.sosfiltfilt(sections, error, axis=0)


def bodies_of(scene: EstimateScene, n: int, kind: str) -> tuple[Any, list[Any]]:
    """Return the scene with n modes and interfaces of a kind, its sensors named, and its reduced bodies."""
    made = scene.make(n, kind, scene.h)
    for name, number in made.sensors.items():
        made.mbs.SetSensorParameter(number, "name", name)
    if isinstance(made, LinearScene):
        return made, [made.flex]
    return made, [romerr.floating_body(made.fem, items) for items in made.bodies]


def attached(made: Any, flexes: list[Any]) -> list[Any]:
    """Return the monitor of a scene."""
    if isinstance(made, LinearScene):
        return [romerr.attach(made.mbs, *flexes, outputs=list(made.outputs))]
    return [romerr.attach(made.mbs, flexes)]


def monitored(scene: EstimateScene, n: int) -> tuple:
    """Run the reduced scene; return its outputs, whether their scope is complete, what its sensors show, and the
    frequency of its slowest mode that is not resolved.
    """
    made, flexes = bodies_of(scene, n, "RBE3")
    monitors = attached(made, flexes)
    made.mbs.Assemble()
    slowest = slowest_unresolved(made, scene.h, scene.t_end)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        shown = estimate_truths.motion(made, scene.h)
    reports = [monitor.report() for monitor in monitors]
    complete = all(COMPLETE in report.scope.values() for report in reports)
    return {key: out for report in reports for key, out in report.outputs.items()}, complete, shown, slowest


def rows_of(name: str, n: int) -> tuple[list[Row], list[str]]:
    """Run a scene with n eigenmodes; return what was compared, and outputs without an estimate."""
    scene, made, none = SCENES[name], [], []
    outputs, complete, shown, slowest = monitored(scene, n)
    for key, truth in estimate_truths.stored(name).items():
        out = outputs.get(key)
        if out is None or out.estimate is None:
            none.append(f"{name}, n = {n}: {key}: no estimate")
            continue
        rings = ringing_of(truth.value - shown[key], scene.h, slowest)
        axes, allowed = axes_of(scene, key), np.inf if complete else RINGING
        for row in range(truth.value.shape[1]):
            found = compared(row, out, shown[key], truth, rings, allowed)
            made.append(Row(name, n, scene.h, f"{key} {COMPONENTS[row]}", axes, **found))
    return made, none


def axes_of(scene: EstimateScene, key: str) -> str:
    """Return what a sensor's values are seen from: the frame of its body, the ground; or that its body is rigid."""
    of = {"frame": scene.local, "rigid": scene.rigid, "joint": scene.forces}
    return next((axes for axes, keys in of.items() if key in keys), "global")


def compared(
    row: int, out: Any, shown: np.ndarray, truth: estimate_truths.Truth, rings: np.ndarray, allowed: float
) -> dict[str, Any]:
    """Return what a Row says of component `row` of an output."""
    value, same_steps, y, rings = (x[:, row] for x in (truth.value, truth.same_steps, shown, rings))
    estimate, uncertainty, of_steps = (
        out.estimate[:, row],
        out.uncertainty[:, row],
        out.estimate_parts["time step"][:, row],
    )
    error, size = value - y, largest(truth.value)
    off, ringing = np.abs(estimate - error), largest(rings) / max(largest(error), TINY)
    return {
        "error": largest(error),
        "share": largest(error) / size,
        "steps": (largest(value - same_steps), largest(of_steps)),
        "basis": (largest(same_steps - y), largest(estimate - of_steps)),
        "off": largest(off) / max(largest(error), TINY),
        "within": float(np.mean(off[1:] <= TIMES * uncertainty[1:])),
        "wide": largest(uncertainty) / max(largest(off), TINY),
        "resolved": largest(uncertainty) <= RESOLVED * largest(estimate),
        "ringing": ringing,
        "left_out": why_not(largest(error), size, truth.off[row], ringing, allowed),
    }


def largest(x: np.ndarray) -> float:
    """Return the largest size."""
    return float(np.max(np.abs(x)))


def why_not(error: float, size: float, off: float, ringing: float, allowed: float) -> str:
    """Return why a component is left out, or an empty string."""
    if error <= ABOVE * size:
        return f"error {error / size:.0e} of the output"
    if off > KNOWN * error:
        return f"truth known to {off / error:.0e} of the error"
    return f"{100 * ringing:.2g} % of the error rings unresolved" if ringing > allowed else ""


def table(rows: list[Row], none: list[str]) -> str:
    """Return the table, and what is left out."""
    lines = [HEAD, *(str(row) for row in rows if not row.left_out), "", "left out:"]
    lines += [f"{row}  {row.left_out}" for row in rows if row.left_out]
    return "\n".join([*lines, *none])


def summary(rows: list[Row]) -> str:
    """Return a line for each scene: how far estimates are off, of the components that are compared."""
    lines = [
        f"{'':<36}{'compared':>9}{'left out':>9}{'off by, median':>16}{'worst':>11}{'within':>8}{'resolved':>10}"
    ]
    groups: dict[str, list[Row]] = {}
    for row in rows:
        groups.setdefault(f"{row.scene}, n = {row.n}{', joints' if row.axes == 'joint' else ''}", []).append(row)
    for name, own in groups.items():
        kept = [row for row in own if not row.left_out]
        said = f"{name:<36}{len(kept):>9}{len(own) - len(kept):>9}"
        if kept:
            off = [row.off for row in kept]
            within, resolved = min(row.within for row in kept), sum(row.resolved for row in kept)
            said += f"{median(off):>16.2%}{max(off):>11.2%}{within:>8.0%}{resolved:>10}"
        lines.append(said)
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> list[Row]:
    """Run scenes, print what was found, or put it into a page; return the rows."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--only", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--table", type=Path, help=f"page whose block {MARK!r} a summary is put into")
    options = parser.parse_args(arguments)
    rows, none = [], []
    for name in options.only:
        for n in SCENES[name].n:
            begin = process_time()
            found = rows_of(name, n)
            rows, none = rows + found[0], none + found[1]
            print(f"{name}, n = {n}: {process_time() - begin:.1f} s", file=sys.stderr, flush=True)
    print(table(rows, none))
    if options.table:
        page.put(MARK, summary(rows), options.table)
    return rows


if __name__ == "__main__":
    main()
