"""A valid frame for the tests of bad input, in which one thing at a time is made wrong."""

import re

import numpy as np
import pytest

from exudyn_romerr import Basis, ElasticBody, InputError, RomErrError, Trajectory, evaluate
from exudyn_romerr.linear.run.prepare import BoundOptions, prepare
from tests.helpers.bodies import model

N = 10
FULL = model("chain", "under", 0)
M, K, BODY = FULL.M, FULL.K, FULL.body
GENERAL = model("chain", "matrix", 0).body
V = np.random.default_rng(0).standard_normal((N, 3))
B = np.ones((N, 1))
FREE = 2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)  # springs in a row that nothing holds
FREE[0, 0] = FREE[-1, -1] = 1.0
T = np.linspace(0, 1, 5)
ZERO = np.zeros((5, 3))


def changed(matrix, at, value):
    """A copy with one entry replaced."""
    matrix = np.array(matrix, dtype=float)
    matrix[at] = value
    return matrix


def with_nodes(per_node=6):
    """A body of two nodes."""
    return ElasticBody(np.eye(2 * per_node), np.eye(2 * per_node), positions=np.zeros((2, 3)))


def trajectory(**arrays):
    return Trajectory(**{"t": T, "q": ZERO, "q_t": ZERO, "q_tt": ZERO, "u": np.ones(5), **arrays})


def run(body=BODY, basis=None, **options):
    """Evaluate with one thing wrong; estimators and time are given, as defaults may change."""
    common = {"inputs": B, "estimators": "fast", "time": "sampled"}
    return evaluate(
        body, Basis(V) if basis is None else basis, options.pop("traj", trajectory()), **{**common, **options}
    )


def offline():
    options = BoundOptions(inputs=B, input_function=np.sin, estimators="fast", time="sampled")
    return prepare(BODY, Basis(V), options)


def check_error(action, kind, message):
    """The action raises exactly this type of RomErrError, with a message that matches."""
    with pytest.raises(RomErrError) as caught:
        action()
    assert type(caught.value) is kind
    assert re.search(message, str(caught.value)), str(caught.value)


def check_refused(action, message, kind=InputError):
    """A row of a table of refusals: most are of input."""
    check_error(action, kind, message)
