"""How far bounds are above errors, how many runs are certified, and why others are not.

    python benchmarks/bounds.py FOLDER [--count 200] [--processes 2] [--limit S] [--docs]

The same runs as in half_widths.py, whose FOLDER has the results. A value is one component of one sensor of one run:
its largest bound over its largest error, of the modes, to first order, where a mechanism reacts, of the whole error
where the scope is complete. Left out are errors below ten times what is uncertain of them. Counted is every component
of which an error is above bound and floor at an instant.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks import page
from benchmarks.half_widths import KNOWN
from benchmarks.told_and_true import collected_with, options_of

MARK = "bounds"
HEAD = f"{'bound / error':<36}{'values':>8}{'left out':>10}{'least':>8}{'median':>9}{'90 %':>9}{'worst':>10}"


def line_of(label: str, values: list[dict[str, Any]]) -> str:
    """Return a line of the table."""
    compared = [one for one in values if one["true"] > KNOWN * one["floor"]]
    left_out = 100 * (len(values) - len(compared)) / max(len(values), 1)
    line = f"{label:<36}{len(compared):8d}{left_out:9.0f}%"
    if not compared:
        return line
    ratios = np.array([one["bound"] / one["true"] for one in compared])
    return f"{line}{ratios.min():8.2f}{np.median(ratios):9.2f}{np.quantile(ratios, 0.9):9.2f}{ratios.max():10.3g}"


def is_in_frame(run: dict[str, Any], value: dict[str, Any]) -> bool:
    """Whether a sensor is one in its body's frame, by its name; models/ and seeds name it otherwise."""
    return "global" not in value["name"] if run["scene"].startswith("seed") else "local" in value["name"]


def below(results: list[dict[str, Any]]) -> Iterator[str]:
    """Yield every bound that an error is above."""
    for one in results:
        for value in one.get("bounds", ()):
            if value["below"] > 0:
                sizes = f"error {value['true']:.3e}, bound {value['bound']:.3e}, above by {value['below']:.1e}"
                of = "" if value["certified"] else ", not certified"
                yield f"{one['scene']}: {value['name']} {value['component']}: {sizes}{of}"


def table(results: list[dict[str, Any]]) -> str:
    """Return the table, and what is below."""
    runs = [one for one in results if "bounds" in one]
    values = [value | {"in frame": is_in_frame(one, value)} for one in runs for value in one["bounds"]]
    of = {
        "displacements in frames": [x for x in values if x["of"] == "displacement" and x["in frame"]],
        "displacements in global axes": [x for x in values if x["of"] == "displacement" and not x["in frame"]],
        "velocities": [x for x in values if x["of"] == "velocity"],
        "certified": [x for x in values if x["certified"]],
    }
    lines = [HEAD, *(line_of(label, group) for label, group in of.items())]
    kinds = sorted({one["kind"] for one in runs})
    lines += [
        line_of(f"  {kind}", [x for one in runs if one["kind"] == kind for x in one["bounds"]]) for kind in kinds
    ]
    found = list(below(results))
    certified = sum(not one["uncertified"] for one in runs)
    lines += ["", f"errors above their bounds: {len(found)} of {len(values)} components", *found, ""]
    lines.append(f"certified: {certified} of {len(runs)} runs; reasons of the others:")
    reasons = Counter(cause for one in runs for cause in one["uncertified"])
    return "\n".join([*lines, *(f"{count:5d}  {cause}" for cause, count in reasons.most_common())])


def main(arguments: list[str] | None = None) -> str:
    """Collect the results, print and return the table."""
    options = options_of(__doc__).parse_args(arguments)
    return page.show(MARK, table(collected_with(options)), options.docs)


if __name__ == "__main__":
    main()
