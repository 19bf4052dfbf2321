"""Random scripts of benchmarks/endurance.py, a few of them: nothing of the user's run changes, no answer is lost."""

import pytest

pytest.importorskip("resource")  # there is none on Windows

from benchmarks import endurance

SEEDS = (7, 1, 4)  # a user function throws; a PreStep function and threads; sys.exit, loops of solves


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_changes_and_nothing_is_lost(seed):
    happens, wrong = endurance.verdicts_of(seed)
    assert happens
    assert not wrong


def test_what_is_wrong_is_counted():
    text = endurance.table([(0, {"error"}, set()), (1, {"error", "exit"}, {"other numbers"})])
    assert "error                       2      1" in text
    assert "seed 1: other numbers" in text
