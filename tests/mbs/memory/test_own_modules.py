"""What functions of a user's other modules keep is put back as well."""

import importlib
import sys

import numpy as np
import pytest

from exudyn_romerr.mbs.memory.own_modules import module_of, reached
from exudyn_romerr.mbs.memory.user_memory import memory_kept

SOURCE = """
import numpy as np
kept = {"sum": 0.0, "calls": []}


def integral(t):
    kept["sum"] += t
    return _noted(t)


def switched(mbs, t):
    mbs.SetObjectParameter(0, "activeConnector", t > 1.0)


def _noted(t):
    kept["calls"].append(t)
    return np.sin(kept["sum"])
"""


@pytest.fixture
def helpers(tmp_path, monkeypatch):
    """A module in a file beside the user's script."""
    (tmp_path / "helpers_of_a_user.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(tmp_path)
    yield importlib.import_module("helpers_of_a_user")
    del sys.modules["helpers_of_a_user"]


def asks(helpers, way):
    integral = helpers.integral
    return (lambda t: helpers.integral(t)) if way == "module" else (lambda t: integral(t))


@pytest.mark.parametrize("way", ["module", "function"])
def test_what_a_module_of_the_user_keeps_is_put_back(helpers, way):
    f = asks(helpers, way)
    f(1.0)
    with memory_kept(None, [f]) as memory:
        f(2.0)
        assert memory.changed
    assert helpers.kept == {"sum": 1.0, "calls": [1.0]}


def test_what_a_module_of_the_user_sets_in_an_mbs_is_lost(helpers):
    """Or a call beside the run would set it."""
    with memory_kept(None, [lambda mbs, t: helpers.switched(mbs, t)]) as memory:
        assert memory.lost == "SetObjectParameter"


def test_libraries_are_left_alone():
    found = reached([lambda t: np.linalg.norm([t, pytest.approx(t).expected])])
    assert {module_of(f) for f in found} == {__name__}
