"""What all sensors show in the runs of one script, at common instants, and why some runs have nothing of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from ..report.verdicts import NONE, Verdict, verdicts_in

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .child_run import Result

FINER = ("half", "quarter", "all")  # runs that take shorter steps
SAME_TIME = 1e-9  # of the end time: solvers add up their steps
OTHER_SENSORS = "the script has other sensors or solves in it"
SAME_STEPS = "it took no shorter steps: the script sets its steps by itself, at each call of the solver"
OF_CALL = "rigid interfaces are in no run: modes are more by the script's own call, which cannot see them"
OF_STRESS = "stress is measured by modes of the script's own call, which cannot see rigid interfaces"
STRESS = ("Stress", "Strain")  # begin what sensors show of stress modes, which our vectors have none of
SHORTER = 1e-6  # of the end time: a run that ends so much earlier has not gone all the way
ENDED = "it ended at t = {:.6g} s, the unchanged run at {:.6g} s"


class Signal(NamedTuple):
    """One sensor of one solve in all runs: times (T,), values (T, r) at the instants of the unchanged run, by run.

    missing : why other runs have none. has_bodies : whether the script has reduced bodies. left : for each component
    what the run with most vectors says of itself that these leave out, too; 0 where it says nothing. by_call :
    whether modes are to be measured by those of the script's own call; unseen : why rigid interfaces are in no run,
    empty: they are, or there are none. steps : of the unchanged run, None: not of one size. until, on_purpose : where
    it ended early, see Recorded. is_sampled : whether PreStep functions act at steps, which is of first order.
    """

    name: str
    shows: str
    solve: int
    is_static: bool
    t: np.ndarray
    of: dict[str, np.ndarray]
    missing: dict[str, str]
    has_bodies: bool = True
    left: tuple[float, ...] = ()
    by_call: bool = False
    unseen: str = ""
    steps: int | None = None
    until: str = ""
    on_purpose: bool = False
    is_sampled: bool = False


def signals(results: Mapping[str, Result]) -> list[Signal]:
    """Return what all sensors show in all runs; results : by name, "unchanged" among them."""
    found, base = [], results["unchanged"].solves
    for i, solve in enumerate(base):
        names = _unique(solve)
        for j, name in enumerate(names):
            found.append(_signal(results, i, j, name, solve))
    return found


def _signal(results: Mapping[str, Result], i: int, j: int, name: str, solve: dict[str, Any]) -> Signal:
    data, base = _shown(solve, j), results["unchanged"]
    t, of, missing = data[:, 0], {"unchanged": data[:, 1:]}, {}
    for run, result in results.items():
        if run != "unchanged":
            why = _why_missing(run, result, i, j, solve)
            if why:
                missing[run] = why
            else:
                of[run] = _at(t, _shown(result.solves[i], j))
    is_stress = solve["shows"][j].startswith(STRESS)
    return Signal(
        name,
        solve["shows"][j],
        i,
        solve["kind"] == "static",
        t,
        of,
        missing,
        bool(base.facts["bodies"]),
        _left(results, name, i, data.shape[1] - 1),
        is_stress or bool(base.facts.get("without_vectors")),
        _unseen(base, is_stress),
        _steps(solve, t),
        solve.get("until", ""),
        solve.get("on_purpose", False),
        base.facts.get("has_controllers", False),
    )


def _shown(solve: dict[str, Any], j: int) -> np.ndarray:
    """What a sensor showed; where a solve failed, without the last row, which may be of the step that did."""
    data = solve["data"][j]
    return data[: max(len(data) - 1, 1)] if solve.get("until") and not solve["on_purpose"] else data


def _steps(solve: dict[str, Any], t: np.ndarray) -> int | None:
    """How many steps a solve was to take; None: not of one size, or not known."""
    if not solve.get("fixed", True) or len(t) < 2:
        return None
    return int(solve["count"]) if solve.get("until") else len(np.unique(t)) - 1


def _why_missing(run: str, result: Result, i: int, j: int, solve: dict[str, Any]) -> str:
    """Why a run says nothing of a sensor; empty: it does."""
    if result.failure:
        return result.failure
    if len(result.solves) <= i or result.solves[i]["names"] != solve["names"]:
        return OTHER_SENSORS
    data, t = result.solves[i]["data"][j], _shown(solve, j)[:, 0]
    if data[-1, 0] < t[-1] - SHORTER * abs(t[-1]):
        return ENDED.format(data[-1, 0], t[-1])
    if run in FINER and solve["kind"] != "static" and len(data) <= len(t):
        return SAME_STEPS
    return ""


def _unseen(base: Result, is_stress: bool) -> str:
    """Why rigid interfaces, if there may be some, are in no run."""
    if base.vectors and not base.facts.get("without_vectors"):
        is_rigid = any(not keeps.all() for _, keeps in base.vectors.values())
        return OF_STRESS if is_stress and is_rigid else ""
    return OF_CALL if base.facts["bodies"] and base.facts.get("may_be_rigid", True) else ""


def estimates(result: Result | None) -> dict[tuple[str, int, int], dict[str, Verdict]]:
    """Return what a watched run says of itself: verdicts by cause, of each (sensor, component, solve)."""
    rows = [] if result is None else result.facts.get("rows", [])
    return {(row["name"], row["component"], row["solve"]): verdicts_in(row) for row in rows}


def _left(results: Mapping[str, Result], name: str, solve: int, count: int) -> tuple[float, ...]:
    """What vectors leave out of each component; 0 where nothing is said of it."""
    if results["unchanged"].solves[solve].get("until"):  # an estimate of a failed step is one of nothing
        return (0.0,) * count
    of = estimates(results.get("free") or results.get("modes"))
    found = [of.get((name, c, solve), {}).get("modes") for c in range(count)]
    return tuple(0.0 if one is None or one.how == NONE else one.most for one in found)


def _at(t: np.ndarray, data: np.ndarray) -> np.ndarray:
    """Values at times t: those stored where these are stored, else on a cubic spline."""
    own = data[:, 0]
    index = np.clip(np.searchsorted(own, t - SAME_TIME * max(abs(t[-1]), 1e-300)), 0, len(own) - 1)
    if np.all(np.abs(own[index] - t) <= 10 * SAME_TIME * max(abs(t[-1]), 1e-300)) or len(own) < 4:
        return data[index, 1:]
    keep = np.append(True, np.diff(own) > 0)
    return CubicSpline(own[keep], data[keep, 1:])(t)


def _unique(solve: dict[str, Any]) -> list[str]:
    names, numbers = solve["names"], solve["numbers"]
    return [f"{name} (sensor {i})" if names.count(name) > 1 else name for name, i in zip(names, numbers, strict=True)]
