"""The judge of rules for the number of modes: its truth is exact, its rules do what they say."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks import mode_rule_cases, mode_rules
from benchmarks.mode_rule_cases import Case, Held
from models.floating import interface
from models.hex_bar import hex_bar


@pytest.fixture
def held(monkeypatch):
    """A short bar over a short time."""
    monkeypatch.setattr(mode_rule_cases, "PERIODS", 2)
    monkeypatch.setattr(mode_rule_cases, "A_PERIOD", 60)
    fem = hex_bar(4)
    return Held("short", fem, int(interface(fem, "tip")[0][0]))


@pytest.mark.parametrize("course", ["ramp", "pulse", "sweep", "sudden"])
def test_responses_are_those_of_an_integrator_with_error_control(course, held):
    case, whole = Case(held, "force", course), held.whole
    alpha, beta = held.rayleigh
    gains, squares = (held.modes.T @ held.loads["force"])[:3], whole.omega[:3] ** 2

    def rates(t, y):
        return np.r_[
            y[3:], gains * np.interp(t, case.t, case.force) - (alpha + beta * squares) * y[3:] - squares * y[:3]
        ]

    y = np.zeros((len(case.t), 6))
    for k, span in enumerate(pairwise(case.t)):  # the force has kinks at samples, over which no step goes
        y[k + 1] = solve_ivp(rates, span, y[k], method="DOP853", rtol=1e-11, atol=1e-16).y[:, -1]
    for order, theirs in enumerate((y[:, :3], y[:, 3:])):
        ours = case.motion(whole, order)[:, :3]
        assert np.abs(ours - theirs).max() <= 1e-8 * np.abs(ours).max()  # of its tolerances


def test_all_modes_are_the_whole_and_few_are_not(held):
    case = Case(held, "shaken", "pulse")
    assert max(case.errors(held.reduced(held.modes)).values()) < 1e-6  # rounding of the projection, 3e-8
    assert min(case.errors(held.reduced(held.modes[:, :1])).values()) > mode_rules.ALLOWED


def test_what_is_bounded_is_enough_and_the_table_says_so(held, monkeypatch):
    monkeypatch.setattr(mode_rules, "bodies", lambda: iter([held]))
    monkeypatch.setattr(mode_rules, "cases", lambda one: iter([Case(one, "force", "pulse")]))
    monkeypatch.setattr(mode_rules, "SIZES", (8,))
    table, numbers = mode_rules.measured(1)
    for name, of in numbers.items():
        if "bound" in name:
            assert all(one.n is not None and one.error <= mode_rules.ALLOWED for one in of)
            assert all(one.fewest <= one.n for one in of)
    lines = {line[:40].strip(): line for line in table.splitlines()}
    assert "100%" in lines["Craig-Bampton: bound within 1 %"]
