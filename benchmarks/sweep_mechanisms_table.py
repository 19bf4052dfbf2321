"""What sweep_mechanisms.py found, as a table: violations, and how far bounds are above errors, by class."""

from collections import Counter, defaultdict

import numpy as np

from benchmarks import page
from benchmarks.sweep import MEANINGFUL

WORST = 8  # cases named
MARK = "mechanisms"


def report(results, file=None):
    """Print the table, what is wrong and the worst cases; put them into the code block `MARK` of a page."""
    text = "\n".join([*table(results), "", *violations(results), "", *worst(results), "", *left_out(results)])
    print(text)
    if file is not None:
        page.put(MARK, text, file)


def ratios(result):
    """(largest bound over largest error, output) of displacements whose error is meaningful."""
    found = []
    for name, out in result.get("outputs", {}).items():
        best = out["bounds"]["best"]
        if out["of"] == "displacement" and best["error"] > MEANINGFUL * best["floor"]:
            found.append((best["bound"] / best["error"], name))
    return found


def violated(result):
    """(output, name of the bound, what was found) of every bound that is below an error."""
    return [
        (name, e, bound)
        for name, out in result.get("outputs", {}).items()
        for e, bound in out["bounds"].items()
        if bound["violations"]
    ]


def table(results):
    """One line a class."""
    yield "largest bound / largest error of displacements in the frame, over time and components, by 'best'"
    yield f"{'':<34}{'bad':>4}{'outputs':>9}{'median':>9}{'90 %':>9}{'worst':>10}  seed"
    compared = [result for result in results if "outputs" in result]
    yield _line("all", compared)
    for sort in compared[0]["classes"] if compared else ():
        groups = defaultdict(list)
        for result in compared:
            for name in result["classes"][sort]:
                groups[name].append(result)
        yield ""
        for name, group in sorted(groups.items()):
            yield _line(f"{sort}: {name}", group)


def _line(name, group):
    bad = sum(bool(violated(result)) for result in group)
    found = sorted((ratio, result["seed"]) for result in group for ratio, _ in ratios(result))
    head = f"{name:<29}{len(group):>5}{bad:>4}{len(found):>9}"
    if not found:
        return head
    median, most = np.percentile([ratio for ratio, _ in found], [50, 90])
    return head + f"{median:>9.3g}{most:>9.3g}{found[-1][0]:>10.3g}  {found[-1][1]}"


def violations(results):
    """Every mechanism with a violation; how many values there are, and how many are violated without the floor."""
    for result in results:
        found = defaultdict(list)
        for name, e, bound in violated(result):
            found[e].append((bound["worst"], name, bound["first"], bound["violations"]))
        for e, cases in found.items():
            times, name, step, _ = max(cases)
            yield (
                f"VIOLATION seed {result['seed']}, {e}: {sum(case[-1] for case in cases)} values of "
                f"{len(cases)} outputs, up to {times:.3g} times bound and floor ({name}, from step {step})"
            )
    bounds = [bound for r in results for out in r.get("outputs", {}).values() for bound in out["bounds"].values()]
    counts = {key: sum(bound[key] for bound in bounds) for key in ("values", "violations", "raw violations")}
    yield (
        f"{len(results)} mechanisms, {sum('outputs' in r for r in results)} compared, {counts['values']} values: "
        f"{counts['violations']} above bound and floor, {counts['raw violations']} above the bound alone"
    )


def worst(results):
    """Cases whose bounds are farthest above the error, one a mechanism."""
    cases = [(*max(found), result) for result in results if (found := ratios(result))]
    yield "worst cases, bound / error"
    for ratio, name, result in sorted(cases, key=lambda case: -case[0])[:WORST]:
        parts = "; ".join(f"{sort} {', '.join(names)}" for sort, names in result["classes"].items())
        yield f"{ratio:.3g} seed {result['seed']}, {name}: {parts}"


def left_out(results):
    """Why some mechanisms were not compared, and the time that all took."""
    for key in ("not solved", "refused"):
        for reason, count in Counter(result[key] for result in results if key in result).most_common():
            yield f"{key}, {count} mechanisms: {reason}"
    seconds = [result["seconds"] for result in results]
    tangents = [result["tangents"] for result in results if "tangents" in result]
    yield f"{sum(seconds):.0f} s of CPU time, {max(seconds):.1f} s at most; {np.sum(tangents):.0f} tangents were read"
