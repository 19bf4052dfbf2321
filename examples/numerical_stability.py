"""The paper's sensitivity study (its Figs. 6 and 7): unit systems and precision, its way and the package's.

Reduced models are solved in closed form, so that only the bounds are on trial; one table adds time integration.

    python examples/numerical_stability.py [--processes 2] [--mpi]
"""

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small products: more threads only wait for one another

import numpy as np

from examples.numerical_stability_plots import (
    RESIDUAL_UNIT,
    TRUTH_FLOOR,
    WAYS,
    draw_bounds,
    draw_residuals,
    draw_units,
)
from exudyn_romerr.mbs.studies.parameter_sweep import Failure, Sweep, sweep
from models import sensitivity
from models.sensitivity import BINARY, DECIMAL, LEVELS, MOVED, TOLERANCES, UNITS, Level

RESULTS = Path(__file__).resolve().parent / "results"
STEP = 2e-4  # s between samples
PANEL_BOUNDS = ("fast", "energy", "auxiliary")


@dataclass(frozen=True)
class Study:
    """Levels by (bits, units, n), and the integrated runs by (tolerances, units); a Failure where there is none."""

    paper: dict[tuple, Level | Failure]
    ours: dict[tuple, Level]
    integrated: dict[tuple, tuple[Level, Level]]


def run(step: float, levels: tuple[int, ...] = LEVELS, whole: bool = True, **options) -> Study:
    """Do all sweeps, the integrated runs only if whole; options are those of sweep."""
    data = {"parameterFunctionData": {"step": step}, **options}
    grid = {"bits": [64, 32], "units": DECIMAL, "n": list(levels)}
    ours = by_parameters(sweep(sensitivity.our_level, grid, **data), all_needed=True)
    exactly = {"bits": [64], "units": BINARY[1:] + MOVED[1:], "n": list(levels)}
    ours |= by_parameters(sweep(sensitivity.our_level, exactly, **data), all_needed=True)
    grids = {"tolerances": list(range(len(TOLERANCES))), "units": DECIMAL}
    runs = by_parameters(sweep(sensitivity.integrated_level, grids, **options), True) if whole else {}
    return Study(by_parameters(sweep(sensitivity.paper_level, grid, **data)), ours, runs)


def by_parameters(result: Sweep, all_needed: bool = False) -> dict[tuple, object]:
    """Return (parameters) -> value."""
    keys = zip(*(x.tolist() for x in result.parameters.values()), strict=True)
    return dict(zip(keys, result.complete() if all_needed else result.values, strict=True))


def table(study: Study, step: float) -> str:
    """Return all tables."""
    t = sensitivity.sample_times(step)
    scale = np.max(np.abs(sensitivity.exact_tip(t)))
    levels = list(dict.fromkeys(n for _, _, n in study.paper))
    parts = [
        f"tip: up to {scale:.3g} m; {len(t)} samples in 0..2 s; maxima over time, in m, kg, s",
        residual_table(study, levels, len(t)),
        bound_table(study, levels),
        spread_table(study, levels),
        data_table(study),
    ]
    return "\n\n".join(parts + ([integrated_table(study)] if study.integrated else []))


def residual_table(study: Study, levels: list[int], count: int) -> str:
    """Return |R| by the three methods and how often the square of Method 2 was negative."""
    head = f"{'n':>4}" + "".join(f"{name:>20}" for name in WAYS.values()) + f"{'negative squares':>18}"
    lines = [f"|R| / ({RESIDUAL_UNIT}), the paper's way"]
    for bits, units in ((bits, i) for bits in (64, 32) for i in DECIMAL):
        lines += [f"{'double' if bits == 64 else 'single'}, [{UNITS[units].name}]", head]
        lines += [residual_line(n, study.paper[bits, units, n], count) for n in levels]
    return "\n".join(lines)


def residual_line(n: int, level: Level | Failure, count: int) -> str:
    """Return one line."""
    if isinstance(level, Failure):
        return f"{n:>4}  {level[:100]}"
    values = "".join(f"{np.max(level.residual[way]):20.2e}" for way in WAYS)
    return f"{n:>4}{values}{100 * level.negative / count:16.0f} %"


def bound_table(study: Study, levels: list[int]) -> str:
    """Return true errors and bounds of the tip in all unit systems."""
    names = "".join(f"{'ours: ' + e if e == 'fast' else e:>13}" for e in PANEL_BOUNDS)
    head = f"{'n':>4}  {'units':<12}{'true error':>12}{'paper: fast':>13}{'convolution':>13}"
    lines = ["bounds of the tip's reduction error / m (true error: of the package's reduced model)"]
    for bits in (64, 32):
        lines += ["double" if bits == 64 else "single precision (ours: matrices and basis; computed in double)"]
        lines += [head + names]
        lines += [bound_line(study, (bits, i, n)) for n in levels for i in DECIMAL]
    return "\n".join(lines)


def bound_line(study: Study, key: tuple) -> str:
    """Return one line."""
    _, units, n = key
    theirs, ours = study.paper[key], study.ours[key]
    error = f"{ours.largest_error:.2e}" if ours.largest_error > TRUTH_FLOOR else f"<{TRUTH_FLOOR:g}"
    failed = isinstance(theirs, Failure)
    paper = [f"{'failed' if failed else format(theirs.largest(e), '.2e'):>13}" for e in ("fast", "convolution")]
    values = "".join(f"{ours.largest(e):13.2e}" for e in PANEL_BOUNDS)
    return f"{n:>4}  {UNITS[units].name:<12}{error:>12}{''.join(paper)}{values}"


def spread_table(study: Study, levels: list[int]) -> str:
    """Return how far the bounds of one model in several unit systems are apart."""
    lines = ["largest over smallest bound in three unit systems, less 1; double precision"]
    lines.append("binary: units 1024 times apart, nothing is rounded; moved: [m, kg, s], entries' last digits moved")
    lines.append(f"{'':>4}{'paper':>11}{'package':>33}{'binary':>11}{'moved':>33}")
    names = "".join(f"{e:>11}" for e in PANEL_BOUNDS)
    lines.append(f"{'n':>4}{'fast':>11}{names}{'all':>11}{names}")
    for n in levels:
        theirs = spread([study.paper[64, i, n] for i in DECIMAL], "fast")
        ours, moved = (
            [spread([study.ours[64, i, n] for i in units], e) for e in PANEL_BOUNDS] for units in (DECIMAL, MOVED)
        )
        binary = max(spread([study.ours[64, i, n] for i in BINARY], e) for e in sensitivity.ESTIMATORS)
        lines.append(f"{n:>4}" + "".join(f"{x:11.1e}" for x in (theirs, *ours, binary, *moved)))
    return "\n".join(lines)


def spread(levels: list[Level], estimator: str) -> float:
    """Return the largest over the smallest of the largest bounds, less 1."""
    values = [level.largest(estimator) for level in levels]
    return max(values) / min(values) - 1


def data_table(study: Study) -> str:
    """Return what rounding the matrices does to the tip, and what the report says of it."""
    n = min(key[2] for key in study.ours)
    lines = ["the matrices' rounding alone / m (no bound of the reduction sees it; n does not matter)"]
    lines.append(f"{'':<8}{'units':<12}{'moves the tip by':>18}{'report.round_off':>18}")
    for bits, units in ((bits, i) for bits in (64, 32) for i in DECIMAL):
        level = study.ours[bits, units, n]
        name = "double" if bits == 64 else "single"
        lines.append(f"{name:<8}{UNITS[units].name:<12}{level.from_data:18.2e}{level.round_off:18.2e}")
    return "\n".join(lines)


def integrated_table(study: Study) -> str:
    """Return the runs by Runge-Kutta 4(5), whose absolute tolerance has another meaning in every unit system."""
    lines = [
        f"integrated by Runge-Kutta 4(5), n = {sensitivity.INTEGRATED}; total error and bounds of the tip / m",
        f"{'rtol':>6}{'atol':>7}  {'units':<12}{'true error':>12}{'paper: fast':>13}{'ours: fast':>13}"
        f"{'energy':>13}{'auxiliary':>13}",
    ]
    for (tolerances, units), (theirs, ours) in study.integrated.items():
        relative, absolute = TOLERANCES[tolerances]
        values = "".join(f"{x:13.2e}" for x in (theirs.largest("fast"), *map(ours.largest, PANEL_BOUNDS)))
        lines.append(f"{relative:6.0e}{absolute:7.0e}  {UNITS[units].name:<12}{ours.largest_error:12.2e}{values}")
    return "\n".join(lines)


def extreme_cases() -> str:
    """Return the table of the extreme cases."""
    from models import extreme  # here: it needs mpmath, the rest does not

    return extreme.table(extreme.rows())


def main(
    output: Path = RESULTS,
    step: float = STEP,
    levels: tuple[int, ...] = LEVELS,
    whole: bool = True,
    **options,
) -> Study:
    """Run the study, print and save its tables and pictures; options are those of sweep.

    whole: also the integrated runs and the extreme cases, which no sweep needs.
    """
    output.mkdir(parents=True, exist_ok=True)
    study = run(step, levels, whole, **options)
    text = table(study, step)
    print(text, flush=True)
    if whole:
        extreme = extreme_cases()
        print(f"\n{extreme}")
        text += f"\n\n{extreme}"
    (output / "numerical_stability.txt").write_text(text + "\n", encoding="utf-8")
    t = sensitivity.sample_times(step)
    draw_residuals(study.paper, t, output / "numerical_stability_residuals.png")
    draw_bounds(study.paper, study.ours, t, output / "numerical_stability_bounds.png")
    draw_units(study.paper, study.ours, output / "numerical_stability_units.png")
    print(f"saved {output / 'numerical_stability*.png'} and .txt")
    return study


def options_of(arguments: list[str] | None) -> dict:
    """Return the options of sweep asked for on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--processes", type=int, default=1, help="at once on this machine")
    parser.add_argument(
        "--mpi", action="store_true", help="MPI ranks: mpiexec -n 3 python -m mpi4py.futures ... --mpi"
    )
    chosen = parser.parse_args(arguments)
    if chosen.mpi:
        return {"useMultiProcessing": True, "useMPI": True}
    return {"useMultiProcessing": True, "numberOfThreads": chosen.processes} if chosen.processes > 1 else {}


if __name__ == "__main__":
    main(**options_of(None))
