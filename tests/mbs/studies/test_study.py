"""sweep: order, processes, failures and options; the sensitivity study, shortened: what breaks and what does not."""

from itertools import product

import numpy as np
import pytest

import exudyn_romerr as romerr
from examples import numerical_stability
from exudyn_romerr.mbs.studies.parameter_sweep import OPTIONS, Failure
from models import exact, sensitivity
from models.sensitivity import BINARY, DECIMAL, MOVED, UNITS

SHORT = 4e-3  # s between samples
LINKAGE = {"bits": [64, 32], "n": [6, 12]}
SIGNAL = np.max(np.abs(sensitivity.exact_tip(np.linspace(0, 2, 201))))  # m
# Arithmetic in units that differ by powers of two rounds alike, unless a constant in metres were somewhere.
SAME = 1e-14
# Converted entries are rounded anew. That moves bounds as much as any change of last digits does, within the luck of
# three draws.
LUCK = 30


def bounds_of_linkage(parameters):
    """Bounds and their whole report's error; at the top, for other processes to find."""
    level = sensitivity.our_level({"units": 0, "functionData": {"step": 1e-2}, **parameters})
    return np.vstack([level.error, *level.bound.values()])


def product_or_error(parameters):
    if parameters["a"] == 2 and parameters["b"] == 0.5:
        raise ZeroDivisionError("two halves")
    return parameters["a"] * parameters["b"]


def what_it_got(parameters):
    return parameters


def test_processes_give_what_a_serial_sweep_gives():
    serial = romerr.sweep(bounds_of_linkage, LINKAGE).complete()
    parallel = romerr.sweep(bounds_of_linkage, LINKAGE, useMultiProcessing=True, numberOfThreads=2).complete()
    assert len(serial) == 4
    assert not np.array_equal(serial[0], serial[2])  # precision matters: not four times the same
    np.testing.assert_array_equal(parallel, serial)


@pytest.mark.parametrize("options", [{}, {"useMultiProcessing": True, "numberOfThreads": 2}])
def test_a_failure_leaves_the_other_variations(options, tmp_path):
    file = tmp_path / "results.txt"
    result = romerr.sweep(product_or_error, {"a": [1, 2, 3], "b": [0.5, 4.0]}, resultsFile=str(file), **options)
    parameters, values = result
    np.testing.assert_array_equal(parameters["a"], [1, 1, 2, 2, 3, 3])
    np.testing.assert_array_equal(parameters["b"], [0.5, 4.0] * 3)  # the last name varies fastest
    assert values == [0.5, 4.0, "ZeroDivisionError: two halves", 8.0, 1.5, 12.0]
    assert list(result.failures) == [2]
    assert isinstance(values[2], Failure)
    with pytest.raises(
        romerr.RunError, match=r"1 of 6 variations failed:\na=2, b=0.5: ZeroDivisionError: two halves"
    ):
        result.complete()
    assert "ZeroDivisionError: two halves" in file.read_text()


def test_values_reach_the_function_as_parameter_variation_gives_them():
    values = romerr.sweep(what_it_got, {"a": (1, 3, 3), "b": [0.5]}, parameterFunctionData={"x": "y"}).complete()
    assert values == [{"a": a, "b": 0.5, "functionData": {"x": "y"}} for a in (1, 2, 3)]
    assert romerr.sweep(what_it_got, {"a": (1, 100, 3)}, useLogSpace=True).values[1] == {"a": pytest.approx(10.0)}


def test_every_option_is_passed_through_unchanged(monkeypatch):
    given = dict.fromkeys(OPTIONS, True)
    seen = {}
    monkeypatch.setattr(
        "exudyn_romerr.mbs.studies.parameter_sweep.ParameterVariation",
        lambda f, p, **options: (seen.update(options), [p, [f({})]])[1],
    )
    assert romerr.sweep(what_it_got, {"a": [1]}, **given).values == [{}]
    assert seen == given


def test_dispy_gets_the_function_itself_and_a_missing_result_is_a_failure(monkeypatch):
    """It sends source code, which a wrapped function does not have, and returns None for an exception."""
    monkeypatch.setattr(
        "exudyn_romerr.mbs.studies.parameter_sweep.ParameterVariation", lambda f, p, **options: [p, [f, None]]
    )
    cluster = {"clusterHostNames": ["127.0.0.1"], "useMultiProcessing": True}
    result = romerr.sweep(what_it_got, {"a": [1, 2]}, **cluster)
    assert result.values[0] is what_it_got
    assert "no result from the dispy cluster" in result.failures[1]


@pytest.mark.parametrize(
    ("parameters", "options", "message"),
    [
        ({"a": [1]}, {"useMpi": True}, "option='useMpi' is unknown; allowed: 'useMultiProcessing'"),
        ({"a": [1]}, {"useMPI": True}, "useMPI needs useMultiProcessing=True"),
        ({"a": [1]}, {"clusterHostNames": ["a"]}, "clusterHostNames needs useMultiProcessing=True"),
        ({}, {}, "parameters is empty"),
        ([1], {}, "parameters is a list; pass a dict"),
        ({"a": [1]}, {"executor": 2}, "executor=2; pass an executor"),
        ({"a": []}, {}, r"parameters\['a'\]=\[\]; needed: a list of numbers"),
        ({"a": 3}, {}, r"parameters\['a'\]=3; needed: a list of numbers"),
        ({"a": (1, 2)}, {}, r"parameters\['a'\]=\(1, 2\); a tuple is \(begin, end, count\)"),
        ({"a": (1, 2, 0)}, {}, r"parameters\['a'\]=\(1, 2, 0\); a tuple is"),
        ({"a": [1, "direct"]}, {}, r"parameters\['a'\] has 'direct'; needed: .*Number other things"),
        ({"a": [True]}, {}, r"parameters\['a'\] has True"),
    ],
)
def test_what_exudyn_would_take_without_a_word_is_refused(parameters, options, message):
    with pytest.raises(romerr.InputError, match=message):
        romerr.sweep(what_it_got, parameters, **options)


@pytest.fixture(scope="module", params=[(12, 114), pytest.param((6, 12, 114), marks=pytest.mark.slow)], ids=len)
def study(request, tmp_path_factory):
    directory = tmp_path_factory.mktemp("stability")
    return numerical_stability.main(directory, SHORT, request.param, whole=False), directory


def test_units_describe_the_same_body():
    """Eigenvalues are 1/s^2 in all of them, and the exact motion of the tip is the same."""
    t = np.linspace(0, 0.5, 11)
    for units in UNITS:
        body = sensitivity.linkage_in(units)
        full = exact.full_solution(body, sensitivity.INPUTS, units.amplitude, sensitivity.OMEGA)
        tip = full.output(sensitivity.OUTPUT.resolve(body), t)[:, 0] / units.length
        np.testing.assert_allclose(tip, sensitivity.exact_tip(t), atol=1e-11)  # converted entries are rounded
        V = units.vectors(sensitivity.krylov(12))[body.free]
        np.testing.assert_allclose(V.T @ (body.M @ V), np.eye(12), atol=1e-12)


def test_every_bound_of_the_study_holds(study):
    """Exact truth; of n = 114 and late times nothing but its rounding is left."""
    for level in study[0].ours.values():
        for bound in level.bound.values():
            assert np.all(np.abs(level.error) <= bound + numerical_stability.TRUTH_FLOOR)


def test_the_paper_breaks_in_single_precision_and_the_package_does_not(study):
    paper, ours = study[0].paper, study[0].ours
    for i in DECIMAL:
        assert paper[64, i, 12].largest("fast") < 0.01 * SIGNAL
        assert paper[32, i, 12].largest("fast") > 10 * SIGNAL
        # the displacement is right: 7 digits, amplified by the condition of K to less than 1 %
        assert paper[32, i, 12].largest_error < 0.01 * SIGNAL
        assert ours[32, i, 12].largest("auxiliary") < 1.01 * ours[64, i, 12].largest("auxiliary")


def test_method_2_gives_the_full_model_a_residual(study):
    """It has none; the square root of rounding is left, and negative squares."""
    level = study[0].paper[64, 0, 114]
    assert np.max(level.residual["expanded"]) > 1e5 * np.max(level.residual["direct"])
    assert level.negative > 0


def test_units_move_the_paper_s_bounds_and_leave_the_package_s(study):
    paper, ours = study[0].paper, study[0].ours
    assert numerical_stability.spread([paper[64, i, 114] for i in DECIMAL], "fast") > 3
    for e, n in product(sensitivity.ESTIMATORS, {n for _, _, n in ours}):
        binary, decimal, moved = (
            numerical_stability.spread([ours[64, i, n] for i in units], e) for units in (BINARY, DECIMAL, MOVED)
        )
        assert binary < SAME
        assert decimal < LUCK * moved


def test_the_report_tells_what_rounding_of_the_input_does(study):
    for (_, units, _), level in study[0].ours.items():
        if units in DECIMAL:
            assert level.from_data <= level.round_off


def test_an_absolute_tolerance_makes_kilometres_unusable():
    """The paper's finding, with its integrator; shorter and looser than in the example."""
    levels = [sensitivity.integrated_level({"units": i, "tolerances": 0}) for i in (0, 1)]
    metres, kilometres = (paper.largest("fast") for paper, _ in levels)
    assert kilometres > 10 * metres
    for paper, ours in levels:
        assert paper.largest_error < 1e-3 * SIGNAL
        assert ours.largest("auxiliary") < 1e-3 * paper.largest("fast")
        assert np.all(np.abs(ours.error) <= ours.bound["auxiliary"])


def test_the_example_writes_its_tables_and_pictures(study):
    directory = study[1]
    text = (directory / "numerical_stability.txt").read_text()
    assert text.count("|R| / (m √kg/s²)") == 1
    assert text.count("[km, g, s]") == 2
    for name in ("residuals", "bounds", "units"):
        assert (directory / f"numerical_stability_{name}.png").read_bytes().startswith(b"\x89PNG")
