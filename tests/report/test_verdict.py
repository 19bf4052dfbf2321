"""Verdicts in words: the sentence of every kind of bound, and whose bound it is."""

import numpy as np
import pytest

from exudyn_romerr.report import OutputReport
from exudyn_romerr.scope import COMPLETE, COUPLED, FROZEN
from exudyn_romerr.verdict import rounded_up, sentence


def output(value, bounds, scope, round_off=0.0, shares=(0.25, 0.75, 0.0, 0.0)):
    """One row, two instants, and the scope of its estimators."""
    bound = {e: np.array([[0.0], [x]]) for e, x in bounds.items()}
    widest = [bound[e] for e in bounds if scope[e] == (COUPLED if COUPLED in scope.values() else scope[e])]
    best = np.min(widest, axis=0)
    parts = zip(("basis", "time step", "initial", "jumps"), shares, strict=True)
    causes = {name: np.where(np.isfinite(best), best, 0.0) * share for name, share in parts}
    if not np.isfinite(best).all():
        causes["basis"] = best
    value, off = np.array([[0.0], [-value]]), np.full((2, 1), round_off)
    return OutputReport("tip z", "m", "displacement", value, off, {**bound, "best": best}, {}, None, None, causes)


ONE = {"auxiliary": COMPLETE}


@pytest.mark.parametrize(
    ("out", "scope", "time", "said"),
    [
        (
            output(4.27e-2, {"auxiliary": 4e-6}, ONE),
            ONE,
            "reconstructed",
            "tip z is up to 0.0427 m, wrong by at most 4e-06 m (0.0094 %), 75 % of it from the step size, not the "
            "basis: halve it; the rest alone bounds it by 1e-06 m.",
        ),
        (
            output(4.27e-2, {"auxiliary": 4e-6}, ONE, round_off=3e-6),
            ONE,
            "reconstructed",
            "tip z is up to 0.0427 m, wrong by at most 7e-06 m, which is round-off: nothing to improve: more modes "
            "or shorter steps do not show above rounding of the input.",
        ),
        (
            output(4.27e-2, {"auxiliary": np.inf}, ONE),
            ONE,
            "reconstructed",
            "tip z is up to 0.0427 m; how wrong it may be is not known: no finite bound: ask for another estimator.",
        ),
        (
            output(0.0, {"auxiliary": 0.0}, ONE),
            ONE,
            "reconstructed",
            "tip z is up to 0 m, wrong by at most 0 m, nothing to improve.",
        ),
        (
            output(2.0, {"auxiliary": 1.0}, {"auxiliary": FROZEN}, shares=(1.0, 0.0, 0.0, 0.0)),
            {"auxiliary": FROZEN},
            "reconstructed",
            "tip z is up to 2 m, wrong by at most 1 m (50 %) (inputs frozen: as if the error did not change the "
            "frame motion, loads and wrenches of this run), 100 % of it from the basis: add modes.",
        ),
        (
            output(2.0, {"auxiliary": 1.0}, {"auxiliary": COUPLED}, shares=(0.0, 0.0, 0.0, 1.0)),
            {"auxiliary": COUPLED},
            "sampled",
            "tip z is up to 2 m, wrong by at most 1 m (50 %) (to first order of the error; time integration not "
            "covered), 100 % of it from the load jumps: add modes, or let the load grow over a short time.",
        ),
    ],
    ids=["bound", "round-off", "infinite", "zero", "frozen", "coupled"],
)
def test_sentences(out, scope, time, said):
    assert sentence(out, 0, time, scope) == said


@pytest.mark.parametrize(("bound", "share"), [(0.5, " (25 %)"), (2.8, " (140 %)"), (20.0, " (1000 %)"), (20.5, "")])
def test_percentages_are_plain_numbers(bound, share):
    """Above 1000 % there is none."""
    (line,) = output(2.0, {"auxiliary": bound}, ONE).verdict("reconstructed", ONE)
    vain = ", not informative: more than the output itself" if bound > 2 else ""
    assert line == f"tip z: up to 2 m, error at most {bound:.3g} m{share}{vain}, by 'auxiliary'"


@pytest.mark.parametrize("bound", [0.0, 1.0, np.inf])
def test_sentences_without_advice(bound):
    said = sentence(output(2.0, {"auxiliary": bound}, ONE), 0, "reconstructed", ONE, advised=False)
    ends = {0.0: "0 m (0 %).", 1.0: "1 m (50 %).", np.inf: "is not known."}
    assert said.endswith(ends[bound])


def test_a_narrower_scope_never_gives_the_verdict():
    """Its bound may be smaller, and says less: the best bound is that of the widest scope, and so is its name."""
    scope = {"energy": COUPLED, "auxiliary": FROZEN}
    out = output(2.0, {"energy": 1.0, "auxiliary": 0.1}, scope)
    (line,) = out.verdict("sampled", scope)
    assert line == "tip z: up to 2 m, reduction error at most 1 m (50 %), by 'energy'"


@pytest.mark.parametrize(
    ("x", "digits", "text"),
    [
        (1.2341e-3, 3, "0.00124"),
        (2.4e-13, 1, "3e-13"),
        (9.991, 3, "10"),
        (0.125, 3, "0.125"),
        (0.0, 3, "0"),
        (np.inf, 3, "inf"),
    ],
)
def test_printed_bounds_are_never_smaller(x, digits, text):
    assert rounded_up(x, digits) == text
    assert float(text) >= x
