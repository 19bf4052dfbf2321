"""Exudyn's own scripts with reduced flexible bodies, untouched: bare, under `romerr run`, under `romerr verify`.

    python benchmarks/exudyn_examples.py CHECKOUT [--only NAME ...] [--verify 10] [--limit 600]
    python benchmarks/exudyn_examples.py CHECKOUT --verify 10 --docs    writes the first table into docs/measured.md

CHECKOUT is a work tree of github.com/jgerstmayr/EXUDYN; needs ngsolve. Every script runs in a process and a folder of
its own, headless; exudyn_site/sitecustomize.py gives it names that the installed Exudyn no longer has, and keeps its
states and sensors. CPU time: of the whole process, over that of the bare one; one pair of runs.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks import page
from exudyn_romerr.report.wording import listed

ROOT = Path("main/pythonDev")
FOLDERS = ("Examples", "TestModels")
MAKES_A_BODY = re.compile(r"\.AddObjectFFRFreducedOrder|CreateFFRFReducedOrderObject\(|[^I]ObjectFFRFreducedOrder\(")
SITE = Path(__file__).resolve().parent / "exudyn_site"
QUIET = {"EXUDYN_SUPPRESS_UI_WINDOW_OPEN": "1", "MPLBACKEND": "Agg", "OPENBLAS_NUM_THREADS": "1"}
CAUSES = ("modes", "interfaces", "step", "sum")
SCRIPTS_HEAD = "script|ends|solves|sensors with a number|bare|run / bare|verify / bare|states and sensors"
SENSORS_HEAD = "script|sensor|up to|modes|rigid interfaces|step|whole error|at most|measured: modes|interfaces|step"
NO_NUMBER = "not covered"


class Ran(NamedTuple):
    """A script's run: status, CPU seconds, its last line of error, states, what --json told."""

    status: int | None
    seconds: float
    said: str
    states: dict[str, np.ndarray]
    told: dict[str, Any]


def scripts_in(checkout: Path) -> list[Path]:
    """Return the scripts that make a reduced flexible body."""
    found = [path for folder in FOLDERS for path in sorted((checkout / ROOT / folder).rglob("*.py"))]
    return [path for path in found if MAKES_A_BODY.search(path.read_text(encoding="utf-8", errors="replace"))]


def put(script: Path, folder: Path) -> None:
    """Copy a script into a new folder, with its test data."""
    folder.mkdir(parents=True)
    if (script.parent / "testData").is_dir():
        shutil.copytree(script.parent / "testData", folder / "testData")
    (folder / "solution").mkdir()
    shutil.copy(script, folder)


def environment(script: Path, states: Path) -> dict[str, str]:
    """Return what a script is run with: no windows, names of older versions, a file for its states."""
    helpers = [place.parent / "TestModels" for place in script.parents if place.name in FOLDERS][:1]
    path = os.pathsep.join(map(str, (SITE, page.ROOT, *helpers)))
    return {**os.environ, **QUIET, "PYTHONPATH": path, "ROMERR_STATES": str(states)}


def ran(script: Path, how: str, folder: Path, limit: float) -> Ran:
    """Run a script "bare", by "run" or by "verify", in a new folder with its test data."""
    put(script, folder)
    kept, told = folder.parent / f"{how}.npz", folder.parent / f"{how}.json"
    ours = [] if how == "bare" else ["-m", "exudyn_romerr", how, "--json", str(told)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with open(folder.parent / f"{how}.txt", "w", encoding="utf-8") as out:
        try:
            done = subprocess.run(
                [sys.executable, *ours, script.name],
                cwd=folder,
                env=environment(script, kept),
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                timeout=limit,
            )
            status = done.returncode
        except subprocess.TimeoutExpired:
            status = None
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    lines = (folder.parent / f"{how}.txt").read_text(encoding="utf-8", errors="replace").strip().split("\n")
    errors = [line for line in lines if re.match(r"\w*(Error|Exception)\b", line)]
    states = dict(np.load(kept)) if kept.exists() else {}
    return Ran(
        status, seconds, errors[-1] if errors else "", states, json.loads(told.read_text()) if told.exists() else {}
    )


def equality(bare: Ran, ours: Ran) -> str:
    """Return whether states and sensors are the same, in words."""
    if not bare.states:
        return "none kept"
    if None in (bare.status, ours.status):
        return "not compared"
    names = {*bare.states} | {*ours.states}
    changed = [name for name in names if not _same(bare.states.get(name), ours.states.get(name))]
    return f"{len(changed)} of {len(names)} arrays differ" if changed else f"all {len(names)} arrays equal"


def _same(one: Any, other: Any) -> bool:
    return one is not None and other is not None and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")


def ending(one: Ran) -> str:
    """Return how a script ended, in words."""
    if one.status is None:
        return "time limit"
    return "well" if one.status == 0 else f"status {one.status}: {one.said}"[:120]


def by_sensor(told: dict[str, Any]) -> dict[tuple[int, str], dict[str, Any]]:
    """Return for each sensor of each solve the largest of every cause among its components."""
    found: dict[tuple[int, str], dict[str, Any]] = {}
    for row in told.get("sensors", ()):
        own = found.setdefault((row["solve"], row["name"]), {"unit": row["unit"], "largest": 0.0, "bound": 0.0})
        own["largest"] = max(own["largest"], row["largest"] or 0.0)
        own["bound"] = None if None in (own["bound"], row["bound"]) else max(own["bound"], row["bound"])
        for cause in CAUSES:
            if row.get(cause) is not None:
                own[cause] = max(own.get(cause, row[cause]), row[cause], key=lambda x: x["size"] or 0.0)
    return found


def cell(verdict: dict[str, Any] | None) -> str:
    """Return a verdict as size and half width, or why there is no number."""
    if verdict is None:
        return ""
    if verdict["size"] is None:
        return verdict["how"] if verdict["how"] == NO_NUMBER else verdict["answer"]
    if verdict["half_width"] is None:  # a sum of which a part is not known
        return f"{verdict['size']:.1e} or more"
    return f"{verdict['size']:.1e} +- {verdict['half_width']:.0e}"


def sensor_rows(name: str, run: Ran, verify: Ran | None) -> list[list[str]]:
    """Return a row for each sensor; of many solves those of the last."""
    told, measured = by_sensor(run.told), by_sensor(verify.told) if verify else {}
    last = max((solve for solve, _ in {**told, **measured}), default=0)
    rows = []
    for key in dict.fromkeys([*told, *measured]):
        if key[0] != last:
            continue
        own, other = told.get(key, {}), measured.get(key, {})
        size = own.get("largest") or other.get("largest") or 0.0
        bound = own.get("bound")
        rows.append(
            [
                name,
                key[1],
                f"{size:.3g} {own.get('unit') or other.get('unit') or ''}".strip(),
                *(cell(own.get(cause)) for cause in CAUSES),
                f"{bound:.1e}" if bound else "",
                *(cell(other.get(cause)) for cause in CAUSES[:3]),
            ]
        )
    return rows


def script_row(name: str, bare: Ran, run: Ran, verify: Ran | None) -> list[str]:
    """Return the row of a script."""
    told, measured = by_sensor(run.told), by_sensor(verify.told) if verify else {}
    estimated = sum(any(_is_number(own.get(x)) for x in CAUSES) for own in told.values())
    had = sum(any(_is_number(own.get(x)) for x in CAUSES[:3]) for own in measured.values())
    said = f"{estimated} of {len(told)} estimated" + (f", {had} of {len(measured)} measured" if verify else "")
    ratio = [
        f"{x.seconds / bare.seconds:.1f}" if x and x.status is not None and bare.seconds else ""
        for x in (run, verify)
    ]
    solves = len(run.told.get("solves", ()))
    return [name, ending(bare), str(solves), said, f"{bare.seconds:.1f} s", *ratio, equality(bare, run)]


def _is_number(verdict: dict[str, Any] | None) -> bool:
    return verdict is not None and None not in (verdict["size"], verdict["half_width"])


def reasons(name: str, run: Ran) -> list[str]:
    """Return a line for each reason why sensors have no estimate."""
    found: dict[str, list[str]] = {}
    for row in run.told.get("sensors", ()):
        if row["sum"]["how"] == NO_NUMBER:
            found.setdefault(row["sum"]["reason"], []).append(row["name"])
    lines = [f"- {name}, {', '.join(dict.fromkeys(names))}: {why}" for why, names in found.items()]
    return lines + [f"- {name}: {note}" for note in run.told.get("notes", ())]


def table(head: str, rows: list[list[str]]) -> str:
    """Return a table as markdown."""
    cells = [head.split("|"), ["---"] * len(head.split("|")), *rows]
    return "\n".join("| " + " | ".join(text.replace("|", "\\|") for text in row) + " |" for row in cells)


def short_table(rows: list[list[str]]) -> str:
    """Return the rows of scripts as text: each by its name, with the status alone that ended it."""
    lines = [f"{'script':<40}{'ends':<12}{'estimated':>10}{'bare':>8}{'run':>6}{'verify':>8}  states"]
    for name, end, _, said, bare, run, verify, states in rows:
        name, end, known = name.rpartition("/")[2], end.partition(":")[0], said.partition(" estimated")[0]
        same = "equal" if states.endswith(" arrays equal") else states
        lines.append(f"{name:<40}{end:<12}{known:>10}{bare:>8}{run:>6}{verify:>8}  {same}")
    return "\n".join(line.rstrip() for line in lines)


def without_a_number(name: str, run: Ran, verify: Ran | None) -> list[str]:
    """Return a line for each reason why sensors of a script have neither an estimate nor a measured number."""
    measured, found = by_sensor(verify.told) if verify else {}, {}
    for row in run.told.get("sensors", ()):
        whole = row["sum"], measured.get((row["solve"], row["name"]), {}).get("sum")
        if not any(map(_is_number, whole)):
            found.setdefault(row["sum"]["reason"].partition(";")[0], []).append(row["name"])
    return [f"{name}, {listed([*dict.fromkeys(names)])}: {why}" for why, names in found.items()]


def main(arguments: list[str] | None = None) -> str:
    """Run the scripts, print and return the tables."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("checkout", type=Path, help="work tree of Exudyn's repository")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="scripts by name, without .py")
    parser.add_argument(
        "--verify", type=float, metavar="S", default=0.0, help="measure, too, where the bare run takes less CPU time"
    )
    parser.add_argument(
        "--limit", type=float, default=600.0, help="s for one run of a script; verify gets ten times that"
    )
    parser.add_argument("--docs", action="store_true", help=f"write the first table into {page.PAGE.name}")
    options = parser.parse_args(arguments)
    scripts = [path for path in scripts_in(options.checkout) if not options.only or path.stem in options.only]
    if not scripts:
        parser.error(f"no script with a reduced flexible body below {options.checkout / ROOT}")
    of_scripts, of_sensors, why, without = [], [], [], []
    with tempfile.TemporaryDirectory() as place:
        for script in scripts:
            name = script.relative_to(options.checkout / ROOT).with_suffix("").as_posix()
            folder = Path(place) / name
            bare, run = (ran(script.resolve(), how, folder / how, options.limit) for how in ("bare", "run"))
            verify = None
            if bare.status is not None and bare.seconds < options.verify:
                verify = ran(script.resolve(), "verify", folder / "verify", 10 * options.limit)
            of_scripts.append(script_row(name, bare, run, verify))
            of_sensors += sensor_rows(name, run, verify)
            why += reasons(name, run)
            without += without_a_number(script.stem, run, verify) if bare.status == 0 else []
            print(" | ".join(of_scripts[-1]), flush=True)
    text = "\n\n".join(
        filter(None, [table(SCRIPTS_HEAD, of_scripts), table(SENSORS_HEAD, of_sensors), "\n".join(why)])
    )
    print(f"\n{text}")
    if options.docs:
        page.put("examples", "\n".join([short_table(of_scripts), *without]))
    return text


if __name__ == "__main__":
    main()
