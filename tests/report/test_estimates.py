"""Estimates in words: beside every kind of bound, resolved or not, and what is advised from their parts."""

import re

import numpy as np
import pytest

from exudyn_romerr.estimates.estimate import CAUSES
from exudyn_romerr.report.advice import ABOUT_ENOUGH, NOT_RESOLVED, judged, next_step
from exudyn_romerr.report.estimate_wording import known, off_by
from exudyn_romerr.report.scope import COMPLETE, COUPLED, FROZEN, SMOOTHLY
from exudyn_romerr.report.verdict import sentence
from exudyn_romerr.report.wording import CURES_OF_CAUSES, CURES_OF_CHECKS, MUCH_SHORTER, RINGS
from tests.report.test_verdict import output

CONDITION = "under the frame motion, loads and joint forces of this run"
NOT_COVERED = "(what joints and controllers do with other steps or modes is not covered and may be many times larger)"
VECTORS = "more vectors (auxiliary_modes=...)"
VERIFY = "romerr verify your_script.py measures the whole error"


def estimated(value, bound, parts, half=None, covers=COMPLETE, estimate_scope="", **options):
    """One row, two instants: an output with its bound, an estimate that is zero at the first, and its scope."""
    out = output(value, {"auxiliary": bound}, {"auxiliary": covers}, **options)
    out.estimate_parts = {cause: np.array([[0.0], [parts.get(cause, 0.0)]]) for cause in CAUSES}
    out.uncertainty_parts = {check: np.array([[0.0], [x]]) for check, x in (half or {"proved": 0.0}).items()}
    out.estimate, out.uncertainty = (sum(found.values()) for found in (out.estimate_parts, out.uncertainty_parts))
    out.estimate_scope = estimate_scope
    return out, {"auxiliary": covers}


BAR = {"basis": 9e-9, "time step": 1.2e-6}
BEAM = (2.5e-5, 1.22e-6, BAR)


@pytest.mark.parametrize(
    ("made", "time", "said"),
    [
        (
            estimated(*BEAM, {"steps": 1e-8}),
            "reconstructed",
            ", error about 1.21e-06 +- 1e-08 m (4.8 %; basis 9e-09, time step 1.2e-06), at most 1.22e-06 m",
        ),
        (
            estimated(*BEAM, {"steps": 1e-9}),  # which does not show in three digits
            "reconstructed",
            ", error about 1.21e-06 m (4.8 %; basis 9e-09, time step 1.2e-06), at most 1.22e-06 m",
        ),
        (
            estimated(*BEAM, {"steps": 2e-7}),  # nor do three digits
            "reconstructed",
            ", error about 1.2e-06 +- 2e-07 m (4.8 %; basis 9e-09, time step 1.2e-06), at most 1.22e-06 m",
        ),
        (
            estimated(2.5e-5, 2e-6, {"basis": -1.2e-6, "time step": 1e-9}),  # no signs, and not what is below 0.5 %
            "static",
            ", error about 1.2e-06 m (4.8 %; basis), at most 2e-06 m",
        ),
        (
            estimated(2.0, 1.0, {"basis": 0.9}, covers=COUPLED),
            "sampled",
            ", reduction error about 0.9 m (45 %; basis), to first order at most 1 m",
        ),
        (
            estimated(2.0, 1.0, {"basis": 0.9, "time step": 0.3}, covers=COUPLED),  # of more than the bound
            "sampled",
            ", error about 1.2 m (60 %; basis 0.9, time step 0.3); reduction error, to first order, at most 1 m",
        ),
        (
            estimated(2.0, 1.0, {"basis": 0.9}),  # complete, but for the time steps
            "sampled",
            ", reduction error about 0.9 m (45 %; basis), at most 1 m",
        ),
        (
            estimated(2.0, 1.0, {"basis": 0.9}, covers=FROZEN),
            "reconstructed",
            f"; {CONDITION} the error is about 0.9 m (45 %; basis), at most 1 m {NOT_COVERED}",
        ),
        (
            estimated(2.0, 1.0, {"basis": 0.9}, covers=FROZEN, estimate_scope=COUPLED),
            "reconstructed",
            f", error about 0.9 m (45 %; basis); {CONDITION} the error is at most 1 m {NOT_COVERED}",
        ),
        (
            estimated(2.0, 1.0, {"basis": 0.9}, covers=COUPLED, estimate_scope=FROZEN),
            "reconstructed",
            f"; {CONDITION} the error is about 0.9 m (45 %; basis) {NOT_COVERED}; error, to first order, at most 1 m",
        ),
        (
            estimated(2.0, np.inf, {"basis": 0.9}, covers=COUPLED),
            "sampled",
            ", reduction error about 0.9 m (45 %; basis), not bounded",
        ),
        (
            estimated(2.0, np.inf, {"basis": 0.9}, covers=FROZEN),
            "reconstructed",
            f"; {CONDITION} the error is about 0.9 m (45 %; basis) {NOT_COVERED}, not bounded",
        ),
        (
            estimated(2.0, 20.0, {"basis": 0.9}),
            "reconstructed",
            ", error about 0.9 m (45 %; basis), at most 20 m, not informative: more than the output itself",
        ),
        (
            estimated(2.0, 20.0, {"basis": 21.0}),
            "reconstructed",
            ", error about 21 m (basis), at most 20 m, not informative: more than the output itself",
        ),
        (
            estimated(0.0, 1e-9, {"basis": 8e-10}),
            "reconstructed",
            ", error about 8e-10 m (basis), at most 1e-09 m",
        ),
        (estimated(0.0, 0.0, {}), "reconstructed", ", error about 0 m, at most 0 m"),
        (
            estimated(2.0, 3e-12, {"basis": 1e-12}, round_off=1.9e-12),  # both are: as without an estimate
            "reconstructed",
            ", error at round-off: at most 5e-12 m, rounding of the input included",
        ),
        (
            estimated(2.0, 1e-3, {"basis": 1e-12}, round_off=1.9e-12),
            "reconstructed",
            ", error about 3e-12 m or less, at round-off, at most 0.001 m",
        ),
        (
            estimated(2.0, 3e-12, {"basis": 1e-12, "time step": 0.1}, round_off=1.9e-12, covers=COUPLED),
            "sampled",
            ", error about 0.1 m (5 %; time step); reduction error, to first order, at round-off: at most 5e-12 m, "
            "rounding of the input included",
        ),
        (
            estimated(2.0, 1.0, {"basis": 1e-4}, {"proved": 9e-4}),  # not resolved, but below what matters
            "reconstructed",
            ", error about 0.001 m or less (0.05 %), at most 1 m",
        ),
        (
            estimated(2.0, 1.0, {"basis": 0.1}, {"steps": np.inf}),
            "reconstructed",
            ", error not known (not resolved: halve the step), at most 1 m",
        ),
        (
            estimated(2.0, 1.0, {"basis": 0.1}, {"steps": 0.02, "vectors": 0.04}, covers=FROZEN),
            "reconstructed",
            f"; {CONDITION} the error is about 0.16 m or less (8 %; not resolved: {VECTORS}), at most 1 m "
            f"{NOT_COVERED}",
        ),
    ],
)
def test_estimate_and_bound_are_said_apart(made, time, said):
    """In the page's sentence, and in the printed line, which names the estimator too."""
    out, scope = made
    text = sentence(out, 0, time, scope, advised=False)
    assert text == f"tip z is up to {np.abs(out.value).max():.4g} m{said}."
    (line,) = out.verdict(time, scope)
    line = line.replace(", by 'auxiliary' and by rounding of the input", ", rounding of the input included")
    assert line.replace(", by 'auxiliary'", "") == text.replace(" is up to", ": up to")[:-1]


@pytest.mark.parametrize("check", CURES_OF_CHECKS)
def test_what_is_not_resolved_is_no_number_to_rely_on(check):
    """Each check has its cure, in the line, beside how large the error may be, and in the advice: not add modes."""
    parts, of_basis = {"basis": 0.08, "time step": 0.02}, (1.0, 0.0, 0.0, 0.0)
    out, scope = estimated(2.0, 1.0, parts, {"loads": 1e-3, check: 0.031}, shares=of_basis)
    (line,) = out.verdict("reconstructed", scope)
    cure = CURES_OF_CHECKS[check]
    assert re.search(
        rf", error about 0.13 m or less \(6.[56] %; not resolved: {re.escape(cure)}\), at most 1 m", line
    )
    assert judged(out, "reconstructed", scope) == NOT_RESOLVED
    assert next_step(out, "reconstructed", scope) == cure
    assert re.fullmatch(
        rf"not resolved, the estimate may be off by 3[12] %: {re.escape(cure)}", out.advice("static", scope)
    )


@pytest.mark.parametrize(
    ("parts", "cure"),
    [
        (
            {"basis": 0.01, "interfaces": 0.2, "time step": 0.01},
            "more modes, for the error is too large to be linear",
        ),
        ({"basis": 0.01, "time step": 0.2}, "shorter steps, for the error is too large to be linear"),
        ({"basis": 0.2, "time step": 0.1}, "more modes, then shorter steps, for the error is too large to be linear"),
        ({"basis": 0.1, "time step": 0.2}, "shorter steps, then more modes, for the error is too large to be linear"),
    ],
)
def test_what_is_too_large_to_be_linear_is_what_is_large(parts, cure):
    out, scope = estimated(2.0, 1.0, parts, {"linearisation": 0.4})
    assert next_step(out, "reconstructed", scope) == cure


@pytest.mark.parametrize(
    ("half", "beside", "few", "said"),
    [
        (0.05, (), "halve the step", "halve the step"),
        (0.05, (SMOOTHLY,), SMOOTHLY, f"{SMOOTHLY}{RINGS}"),
        (239.0, (), "halve the step", "halve the step"),  # 400 times 0.3 of an output of 2 m are 240 m
        (241.0, (), MUCH_SHORTER, MUCH_SHORTER),
        (241.0, (SMOOTHLY,), SMOOTHLY, f"{SMOOTHLY}{RINGS}"),
    ],
)
def test_steps_that_do_not_resolve_what_rings(half, beside, few, said):
    """In the row only what helps most: of what starts at once a smooth start, 8 times shorter steps did not help.

    Where the error may exceed the output the estimate is no size there.
    """
    out, scope = estimated(2.0, 1.0, {"basis": 0.1}, {"steps": half})
    out.beside_steps = beside
    (line,) = out.verdict("reconstructed", scope)
    unknown = f"error not known (not resolved: {few}), at most"
    resolved_less = f"error about 0.15 m or less (7.5 %; not resolved: {few}), at most"
    assert (unknown if half > 2.0 else resolved_less) in line
    assert next_step(out, "reconstructed", scope) == said
    assert out.advice("reconstructed", scope).endswith(f": {said}")


@pytest.mark.parametrize("check", CURES_OF_CHECKS)
def test_what_starts_at_once_has_one_cure_whatever_the_check(check):
    """Of a soft bar 60 vectors in place of 26 brought 6.5 where vectors were the check, a smooth start 260."""
    out, scope = estimated(2.0, 1.0, {"basis": 0.1}, {check: 241.0})
    out.beside_steps = (SMOOTHLY,)
    assert next_step(out, "reconstructed", scope) == f"{SMOOTHLY}{RINGS}"
    assert " or " not in out.advice("reconstructed", scope)


@pytest.mark.parametrize(
    ("shares", "cure"),
    [
        ((1.0, 0.0, 0.0, 0.0), "add modes"),
        ((0.3, 0.7, 0.0, 0.0), "halve the step"),
        ((0.3, 0.0, 0.0, 0.7), "smoother"),
    ],
)
def test_what_is_left_of_a_proved_estimate_is_lowered_by_what_makes_it(shares, cure):
    """Not by more vectors: "auto" follows all that matter; of a bar 60 more brought nothing."""
    out, scope = estimated(2.0, 1.0, {"basis": 0.1}, {"proved": 0.9}, shares=shares)
    assert next_step(out, "reconstructed", scope).startswith(cure)
    assert "vectors" not in sentence(out, 0, "reconstructed", scope)


@pytest.mark.parametrize(
    ("parts", "check", "why"),
    [
        ({"basis": 1.9}, {"steps": 0.1}, "the error itself is about 95 % of it: add modes"),
        ({"basis": 3.0}, {"vectors": 2.0}, "the error itself may be 150 % of it: add modes"),
        ({"basis": 90.0}, {"vectors": 50.0}, "the error itself may be larger: add modes"),
        (
            {"interfaces": 0.8},
            {"steps": 0.01},
            "the error itself is about 40 % of it: take RBE3 modes, or interfaces='rigid'",
        ),
        ({"basis": 0.1}, {"linearisation": 1.0}, "the error is too large to be linear: add modes"),
        ({"basis": 0.1}, {"steps": 0.01}, "auxiliary vectors leave much: more vectors (auxiliary_modes=...)"),
        ({"basis": 0.1, "time step": 5.0}, {"steps": 0.01}, "auxiliary vectors leave much: more vectors"),
    ],
)
def test_bound_above_the_output_says_why(parts, check, why):
    """Time steps are in no coupled bound, and are no reason."""
    out, scope = estimated(2.0, 20.0, parts, check, covers=COUPLED)
    assert f", not informative: more than the output itself, for {why}" in sentence(out, 0, "sampled", scope)


def test_a_bound_of_what_rings_has_no_other_cure_than_the_estimate():
    """Not more modes or vectors: with a smooth start both are small."""
    out, scope = estimated(2.0, 20.0, {"basis": 3.0}, {"steps": 5.0}, covers=COUPLED)
    out.beside_steps = (SMOOTHLY,)
    text = sentence(out, 0, "sampled", scope, advised=False)
    assert text.endswith("at most 20 m, not informative: more than the output itself.")
    assert text.count(SMOOTHLY) == 1


def test_checks_of_estimates_have_a_cure():
    """Those that half widths are made of, see docs/theory.md."""
    assert set(CURES_OF_CHECKS) == {"steps", "vectors", "loads", "proved"}  # "linearisation": what is large
    assert set(CURES_OF_CAUSES) == set(CAUSES)


def test_load_jumps_are_in_no_estimate():
    """They make the bound of what is left: no vectors help."""
    out, scope = estimated(2.0, 1.0, {"basis": 0.1}, {"proved": 0.9}, shares=(0.1, 0.0, 0.0, 0.9))
    assert next_step(out, "reconstructed", scope) == "smoother loads"


@pytest.mark.parametrize("half", [0.0, 0.029, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_largest_error_is_where_the_line_says(seed, half):
    """Any error within the half width: its largest value is within what is printed as +-, and below "or less"."""
    rng = np.random.default_rng(seed)
    out, _ = estimated(2.0, 1.0, {"basis": 0.1})
    out.estimate = rng.normal(size=(200, 1))
    out.uncertainty = half * np.maximum.accumulate(rng.random((200, 1)), axis=0)
    out.value, out.round_off = np.ones((200, 1)), np.zeros((200, 1))
    out.estimate_parts, out.uncertainty_parts = {"basis": out.estimate}, {"steps": out.uncertainty}
    found = known(out, 0)
    for _ in range(50):
        error = out.estimate + out.uncertainty * rng.uniform(-1, 1, (200, 1))
        assert abs(np.abs(error).max() - found.size) <= found.off * (1 + 1e-12)  # rounding of two sums
        assert np.abs(error).max() <= found.most * (1 + 1e-12)
    assert found.off <= found.half * (1 + 1e-12)


@pytest.mark.parametrize(
    ("made", "time", "step", "said"),
    [
        (  # the bound says: basis
            estimated(2.0, 0.2, {"basis": 0.01, "time step": 0.09}, shares=(1.0, 0.0, 0.0, 0.0)),
            "reconstructed",
            "halve the step",
            "90 % of it from the step size, not the basis: halve it; the rest is about 0.01 m",
        ),
        (
            estimated(2.0, 0.2, {"basis": 0.01, "interfaces": 0.09}, {"vectors": 0.005}),
            "sampled",
            "take RBE3 modes, or interfaces='rigid'",
            "90 % of it from the rigid (RBE2) interfaces, not from the number of modes: take RBE3 modes, or "
            "floating_body(..., interfaces='rigid') if they are rigid in reality; the rest is about 0.015 m or less",
        ),
        (  # two parts that cancel
            estimated(2.0, 0.2, {"basis": 0.09, "time step": -0.085}),
            "reconstructed",
            "add modes",
            "51 % of it from the basis: add modes; the rest is about 0.085 m; the bound is 40 times the estimate: "
            f"{VECTORS} sharpen it",
        ),
        (
            estimated(2.0, 0.2, {"basis": 0.05}),
            "reconstructed",
            "add modes",
            f"100 % of it from the basis: add modes; the bound is 4 times the estimate: {VECTORS} sharpen it",
        ),
        (
            estimated(2.0, 0.1, {"basis": 0.05}, covers=COUPLED),
            "sampled",
            "add modes",
            "100 % of it from the basis: add modes",
        ),
        (
            estimated(2.0, 0.034, {"basis": 1.9e-3}, {"steps": 1e-4}),
            "reconstructed",
            "about enough; more vectors for the bound",
            "about enough: the estimate of the error is within 0.1 % of the largest value, the bound is not; the "
            f"bound is 17 times the estimate: {VECTORS} sharpen it",
        ),
        (
            estimated(2.0, 0.004, {"basis": 1.9e-3}, covers=FROZEN),
            "reconstructed",
            VERIFY,
            f"under this run's forces the estimate of the error is within 0.1 % of the largest value: {VERIFY}",
        ),
        (  # no half width under this run's forces is that of the whole error: nothing is said to lower it
            estimated(2.0, 1.0, {"basis": 0.1}, {"steps": 0.9}, covers=FROZEN),
            "reconstructed",
            VERIFY,
            f"under this run's forces the estimate of the error is not resolved: {VERIFY}",
        ),
        (
            estimated(2.0, 0.002, {"basis": 1.9e-3}),
            "reconstructed",
            "enough",
            "enough: the bound of the error is within 0.1 % of the largest value",
        ),
        (  # the bound leaves the time steps out: it alone is not enough
            estimated(2.0, 0.002, {"basis": 1.9e-3, "time step": 0.1}, covers=COUPLED),
            "sampled",
            "halve the step",
            "98 % of it from the step size, not the basis: halve it; the rest is about 0.0019 m",
        ),
        (
            estimated(2.0, 0.002, {"basis": 1e-4, "time step": 1e-3}, covers=COUPLED),
            "sampled",
            "about enough",
            "about enough: the estimate of the error is within 0.1 % of the largest value, the bound of the "
            "reduction error, to first order, is too",
        ),
        (
            estimated(2.0, 0.002, {"basis": 1e-4}, covers=FROZEN, estimate_scope=COUPLED),
            "reconstructed",
            "about enough",
            "about enough: the estimate of the error is within 0.1 % of the largest value, the bound, inputs "
            "frozen, is too",
        ),
        (
            estimated(2.0, np.inf, {"basis": 0.1}, covers=COUPLED),
            "sampled",
            "add modes",
            "100 % of it from the basis: add modes; no finite bound: the messages or reasons say why",
        ),
        (
            estimated(2.0, np.inf, {"basis": 1e-3}),
            "reconstructed",
            "about enough",
            "about enough: the estimate of the error is within 0.1 % of the largest value; no finite bound: the "
            "messages or reasons say why",
        ),
        (
            estimated(2.0, 1e-3, {"basis": 1e-12}, round_off=1.9e-12, tolerance=1e-12),
            "reconstructed",
            "about enough; more vectors for the bound",
            "about enough: the estimate of the error is at round-off; the bound is 3.4e+08 times the estimate: "
            f"{VECTORS} sharpen it",
        ),
        (
            estimated(2.0, 3e-12, {"basis": 1e-12}, round_off=1.9e-12),
            "reconstructed",
            "nothing to improve",
            "nothing to improve: more modes or shorter steps do not show above rounding of the input",
        ),
        (estimated(0.0, 0.0, {}), "reconstructed", "nothing to improve", "nothing to improve"),
        (
            estimated(0.0, 1e-9, {"basis": 8e-10}),  # of an output that stays zero nobody knows what is enough
            "static",
            "add modes",
            "100 % of it from the basis: add modes",
        ),
        (
            estimated(0.0, 1e-9, {"basis": 8e-10}, tolerance=9e-10),
            "static",
            "about enough",
            "about enough: the estimate of the error is within the tolerance of 9e-10 m, the bound is not",
        ),
    ],
)
def test_advice_is_from_the_estimates_parts(made, time, step, said):
    out, scope = made
    assert next_step(out, time, scope) == step
    assert out.advice(time, scope) == said
    assert sentence(out, 0, time, scope).endswith(f"; {said}.")


def test_an_estimate_that_is_not_known_throughout_is_none():
    """Then all is as without one."""
    out, scope = estimated(2.0, 1.0, {"basis": 0.9})
    out.estimate[0] = np.inf
    text = sentence(out, 0, "reconstructed", scope)
    out.estimate = None
    assert text == sentence(out, 0, "reconstructed", scope)
    assert "about" not in text


@pytest.mark.parametrize(("check", "resolved"), [("proved", True), ("vectors", False)])
def test_a_proof_needs_no_margin_at_other_instants(check, resolved):
    """The largest error is where the half width is small: known if that is proved; checks may miss something."""
    out, scope = estimated(2.0, 1.0, {"basis": 0.0})
    out.estimate, half = np.array([[0.1], [0.0]]), np.array([[1e-4], [0.05]])
    out.estimate_parts, out.uncertainty, out.uncertainty_parts = {"basis": out.estimate}, half, {check: half}
    text = sentence(out, 0, "reconstructed", scope)
    assert (", error about 0.1 m (5 %; basis)" in text) == resolved
    assert ("not resolved: more vectors" in text) != resolved


def test_rows_have_estimates_of_their_own():
    out, scope = estimated(2.0, 1.0, {"basis": 0.9}, {"vectors": 0.01})
    for name in ("value", "round_off", "estimate", "uncertainty"):
        setattr(out, name, np.column_stack([getattr(out, name), 1e-3 * getattr(out, name)]))
    for fields in (out.bound, out.causes, out.estimate_parts, out.uncertainty_parts):
        fields.update({key: np.column_stack([x, 1e-3 * x]) for key, x in fields.items()})
    one, other = out.verdict("reconstructed", scope)
    assert "error about 0.9 +- 0.01 m (45 %; basis), at most 1 m" in one
    assert "error about 0.0009 +- 1e-05 m (45 %; basis), at most 0.001 m" in other
    assert known(out).size == known(out, 0).size > known(out, 1).size


def test_how_far_the_estimate_was_off():
    out, _ = estimated(2.0, 1.0, {"basis": 0.9})
    out.error = np.array([[0.0], [0.8]])
    assert off_by(out) == "the estimate is off by up to 0.1 m (12 % of it)"
    out.error = np.array([[0.0], [0.0]])
    assert off_by(out) == "the estimate is off by up to 0.9 m"


def test_an_estimate_of_steps_that_the_truth_shares_is_said_without_them():
    out, _ = estimated(2.0, 1.0, {"basis": 0.8, "time step": 0.4})
    out.error = np.array([[0.0], [0.75]])
    said = "the estimate is off by up to 0.45 m (60 % of it)"
    assert off_by(out) == f"{said}, without its time steps by 0.05 m (6.7 % of it)"
    out.error = np.array([[0.0], [1.1]])
    assert off_by(out) == "the estimate is off by up to 0.1 m (9.1 % of it)"
    assert ABOUT_ENOUGH == "about enough"
