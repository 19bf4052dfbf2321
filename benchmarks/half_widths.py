"""How good the estimates are, and their half widths: what runs say of their errors beside what they are.

    python benchmarks/half_widths.py FOLDER [--count 200] [--processes 2] [--limit S] [--all] [--docs]
    ... --exudyn CHECKOUT       Exudyn's own scripts, too: a work tree of github.com/jgerstmayr/EXUDYN; needs ngsolve

FOLDER keeps the results of told_and_true.py, a file a scene; those that are there are not computed again. A number is
one component of one sensor of one run and one cause: modes (with what rigid interfaces stiffen), step, whole. It is
good if the largest estimate with its half width is at most twice the largest true error, and the true error lies
within two half widths of the estimate at every instant. What is not known, not covered or refused is not good. Where
the true error is below ten times what is uncertain of it itself the number is left out, and counted. Seeds 0 to 199:
a quarter smooth, half sudden and undamped, a quarter sudden with dampers.

Of Exudyn's scripts the truth is what `romerr verify` measures: of largest values, not of instants, and of modes by
our vectors.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks import page
from benchmarks.exudyn_examples import ran, scripts_in
from benchmarks.told_and_true import CAUSES, TIMES, collected_with, options_of, stored

MARK = "half widths"
EXUDYNS = (
    "NGsolveCraigBampton",
    "NGsolveCMStest",
    "CMSexampleCourse",
    "objectFFRFreducedOrderTest",
    "abaqusImportTest",
)
LIMIT = 900.0  # s of one run of a script
KNOWN = 10.0  # times what is uncertain of a true error
SHARPER = 2.0  # times the true error: what is told at most
HEAD = f"{'':<28}{'numbers':>8}{'left out':>10}{'good':>8}{'within 2 half widths':>22}"
HEAD += f"{'not known':>11}{'told / true':>13}"


def is_left_out(record: dict[str, Any]) -> bool:
    """Whether the true error is not known well enough to judge by."""
    return record["true"] < KNOWN * record["unsure"] or record["true"] == 0


def is_good(record: dict[str, Any]) -> bool:
    """Whether the number is close to the true error, and its half width holds."""
    if not record["is known"]:
        return False
    return record["told"] <= SHARPER * record["true"] and record["inside"] == 1


def line_of(label: str, records: Iterable[dict[str, Any]]) -> str:
    """Return a line of the table: shares of the numbers that are compared, but for those left out."""
    records = list(records)
    compared = [one for one in records if not is_left_out(one)]
    left_out = len(records) - len(compared)
    line = f"{label:<28}{len(compared):8d}{100 * left_out / max(len(records), 1):9.0f}%"
    if not compared:
        return line
    known = [one for one in compared if one["is known"]]
    good = sum(map(is_good, compared))
    line += f"{100 * good / len(compared):7.0f}%"
    if not known:
        return f"{line}{'':>22}{100:10.0f}%"
    inside = np.mean([one["inside"] == 1 for one in known])
    instants = np.mean([one["inside"] for one in known])
    line += f"{f'{100 * inside:.0f} % ({100 * instants:.1f} %)':>22}"
    line += f"{100 * (1 - len(known) / len(compared)):10.0f}%"
    return line + f"{np.median([one['told'] / one['true'] for one in known]):13.2f}"


def groups(results: list[dict[str, Any]]) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Yield the groups of results: models, random mechanisms, each whole and by kind."""
    for name, begins in (("models/", "models"), ("random mechanisms", ("smooth", "sudden"))):
        of = [one for one in results if one["kind"].startswith(begins)]
        if of:
            yield name, of
            for kind in sorted({one["kind"] for one in of}):
                yield f"  {kind.removeprefix('models, ')}", [one for one in of if one["kind"] == kind]
    if of := [one for one in results if one["kind"] == "examples"]:
        yield "Exudyn's examples", of


def table(results: list[dict[str, Any]]) -> str:
    """Return the table."""
    lines = [HEAD]
    for name, of in groups(results):
        records = [record for one in of for record in one.get("records", ())]
        lines.append(line_of(name, records))
        if not name.startswith(" "):
            causes = [cause for cause in CAUSES if any(x["cause"] == cause for x in records)]
            lines += [line_of(f"  {cause}", (x for x in records if x["cause"] == cause)) for cause in causes]
    without = [one for one in results if "records" not in one]
    refused: dict[str, list[str]] = {}
    for one in without:
        refused.setdefault(one.get("refused") or one.get("no truth"), []).append(one["scene"])
    lines += [f"{why}: {', '.join(scenes)}" for why, scenes in refused.items()]
    return "\n".join([*lines, "", "within: numbers (instants) whose error lies within 2 half widths of the estimate"])


def not_good(results: list[dict[str, Any]]) -> Iterator[str]:
    """Yield a line for every number that is not good."""
    for one in results:
        for record in one.get("records", ()):
            if not is_left_out(record) and not is_good(record):
                said = f"told {record['told']:.2e}, off {record['off']:.1e}" if record["is known"] else "not known"
                what = f"{record['name']} {record['component']}, {record['cause']}"
                half = f", half width {record['half']:.1e}" if record["is known"] else ""
                yield f"{one['scene']}: {what}: true {record['true']:.2e}, {said}{half}"


def of_example(rows: list[dict[str, Any]], others: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the records of a script: rows of `romerr run`, of largest values, beside those of `romerr verify`."""
    truths = {(row["solve"], row["name"], row["component"]): row for row in others}
    records = []
    for row in rows:
        other = truths.get((row["solve"], row["name"], row["component"]), {})
        for cause, name in (("modes", "modes"), ("interfaces", "interfaces"), ("step", "step"), ("whole", "sum")):
            one, true = row[name], other.get(name)
            if not true or true["how"] != "measured" or true["size"] is None:
                continue
            record = {"name": row["name"], "component": row["component"], "cause": cause, "true": true["size"]}
            is_known = bool(one) and one["size"] is not None
            record |= {"unsure": true["half_width"] or 0.0, "is known": is_known}
            if is_known:
                off, half = abs(one["size"] - true["size"]), one["half_width"] or 0.0
                record |= {"told": one["size"] + half, "half": half, "off": off}
                record["inside"] = float(off <= TIMES * half + record["unsure"])
            records.append(record)
    return records


def example(script: Path) -> dict[str, Any]:
    """Run a script of Exudyn's under `romerr run` and `romerr verify`; return its records."""
    with tempfile.TemporaryDirectory() as place:
        run, measured = (ran(script, how, Path(place) / how, LIMIT).told for how in ("run", "verify"))
    found = {"scene": script.stem, "kind": "examples"}
    if not run.get("sensors") or not measured.get("sensors"):
        return found | {"refused": "run or verify did not end in time, or have no sensor"}
    return found | {"records": of_example(run["sensors"], measured["sensors"])}


def main(arguments: list[str] | None = None) -> str:
    """Collect the results, print and return the table."""
    parser = options_of(__doc__)
    parser.add_argument("--exudyn", type=Path, metavar="CHECKOUT", help="work tree of Exudyn's repository")
    parser.add_argument("--all", action="store_true", help="print every number that is not good")
    options = parser.parse_args(arguments)
    results = collected_with(options)
    scripts = scripts_in(options.exudyn.resolve()) if options.exudyn else ()
    for script in (script for script in scripts if script.stem in EXUDYNS):
        results.append(stored(options.folder / f"{script.stem}.json", example, script))
    for line in not_good(results) if options.all else ():
        print(line)
    return page.show(MARK, table(results), options.docs)


if __name__ == "__main__":
    main()
