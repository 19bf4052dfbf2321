"""Rows of a run: in memory, in a file where they are many, and what a solver that begins again makes of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from exudyn_romerr.errors import RunError
from exudyn_romerr.mbs.mirror import recorder as module
from exudyn_romerr.mbs.mirror.recorder import Recorder, StoredRows


class System:
    """What a recorder reads: q, q_t, q_tt of two coordinates, one multiplier; accelerations are numbers of rows."""

    def __init__(self):
        self.q, self.number = np.zeros(2), 0

    def GetODE2Coordinates(self, *_):
        return self.q

    def GetODE2Coordinates_t(self, *_):
        return 10 * self.q

    def GetODE2Coordinates_tt(self, *_):
        return np.full(2, self.number)

    def GetAECoordinates(self, *_):
        return self.q[:1] - 1


def recorded(times):
    """A recorder of rows whose coordinates are t, 2 t."""
    mbs = SimpleNamespace(systemData=System())
    found = Recorder(mbs, None)
    for number, t in enumerate(times):
        mbs.systemData.q, mbs.systemData.number = np.array([t, 2 * t]), number
        assert found(mbs, t) is True
    return found, mbs


@pytest.mark.parametrize("count", [1, 3, 4, 5, 23])
def test_rows_in_a_file_are_the_same(count, monkeypatch):
    (wanted,) = recorded(np.arange(count))[0].runs()
    monkeypatch.setattr(module, "MOST", 8 * 8 * 11)  # eleven rows
    found, mbs = recorded(np.arange(count))
    (rows,) = found.runs()
    assert isinstance(rows.q, np.memmap) == (count > 12)
    for one, other in zip(vars(rows).values(), vars(wanted).values(), strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(wanted.v, 10 * np.outer(np.arange(count), [1, 2]))
    np.testing.assert_array_equal(wanted.multipliers[:, 0], np.arange(count) - 1)
    mbs.systemData.q = np.array([99.0, 198.0])
    found(mbs, 99.0)  # it goes on where it was
    np.testing.assert_array_equal(found.runs()[0].t, [*range(count), 99.0])


def test_a_solver_that_begins_again_begins_a_run_or_goes_on():
    runs = recorded([0, 1, 2, 2, 3, 0, 1, 0.5, 1.5])[0].runs()
    assert [rows.t.tolist() for rows in runs] == [[0, 1, 2, 3], [0, 1], [0.5, 1.5]]
    assert runs[0].a[:, 0].tolist() == [0, 1, 3, 4]  # accelerations that a solver finds anew
    assert recorded([])[0].runs() == []


def test_what_cannot_be_kept_is_told_and_stops_nothing(monkeypatch):
    def full(*_):
        raise OSError("No space left on device")

    monkeypatch.setattr(StoredRows, "append", full)
    with pytest.raises(RunError, match="could not be kept: No space left"):
        recorded([0.0, 1.0])[0].runs()
    monkeypatch.undo()
    found, mbs = recorded([0.0])
    mbs.systemData.q = np.zeros(3)
    assert found(mbs, 1.0) is True
    with pytest.raises(RunError, match="could not be kept"):
        found.runs()
