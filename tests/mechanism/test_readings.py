"""Readings: few where tangents are smooth, more where they are not; where they jump that is said."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from exudyn_romerr.mechanism.readings import FIRST, MOST, Readings
from exudyn_romerr.mechanism.rotations import rotation_matrix, skew
from exudyn_romerr.mechanism.rows import Rows
from exudyn_romerr.mechanism.splined import KNOTS, Reading, Splined
from exudyn_romerr.mechanism.unknowns import TurningNode

S, T_END = 400, 0.4


class Source:
    """A stiffness over time between two unknowns, everything else as it is; counts how often it is asked.

    unit : of length, in which all is told.
    """

    def __init__(self, stiffness, unit=1.0):
        self._stiffness, self.asked, self.unit = stiffness, 0, unit
        self.scales, self.inertia, self.noted = 1e-5 * unit * np.ones(2), 1e-10, 0
        self.frames, self.independent = (), np.array([0])

    def read(self, t, q, v, a, multipliers):
        self.asked += 1
        K = self._stiffness(t) / self.unit**2 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        H = np.zeros((2, 2, 1))
        H[0, 0] = 3.0 / self.unit**2
        C = np.array([[1.0, 0.0]])
        return Reading.of(np.eye(2) / self.unit**2, np.zeros((2, 2)), K, C, C, H.reshape(-1, H.shape[2]))

    def note_dependence(self, readings):
        self.noted = len(readings)


def rows_of(count=S):
    t = np.linspace(0, T_END, count)
    none = np.zeros((count, 2))
    return Rows(t, none, none, none, np.sin(40 * t)[:, None])


def smooth(t):
    return 1e4 * (1 + 0.3 * np.sin(15 * t))


def test_what_is_smooth_is_read_seldom_and_told_well():
    source, rows = Source(smooth), rows_of()
    readings = Readings(source, rows)
    assert source.asked == len(readings.at) <= 5 * FIRST
    assert source.noted <= FIRST + 3
    assert readings.doubtful == set()
    K = readings.splined("K", rows)
    np.testing.assert_allclose(K[:, 0, 0], smooth(rows.t), rtol=5e-3)
    np.testing.assert_allclose(readings.splined("M", rows), np.tile(np.eye(2), (S, 1, 1)))


def test_forces_of_constraints_follow_multipliers_at_every_row():
    """They ring faster than anything is read: what they add is linear in them."""
    readings, rows = Readings(Source(smooth), rows_of()), rows_of()
    added = readings.splined.stiffness(rows) - readings.splined("K", rows)
    np.testing.assert_allclose(added[:, 0, 0], 3.0 * rows.multipliers[:, 0], atol=1e-9)


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_jump_is_found_between_two_rows(unit):
    """As of a stop; whatever the units are."""

    def jumping(t):
        return 1e4 if t < 0.123 * T_END else 1e7

    readings = Readings(Source(jumping, unit), rows_of())
    first = int(np.searchsorted(rows_of().t, 0.123 * T_END)) - 1
    assert {first, first + 1} <= readings.doubtful
    assert len(readings.at) <= MOST * S


def test_what_rings_faster_than_it_is_read_is_doubtful():
    readings = Readings(Source(lambda t: 1e7 * (1 + np.sin(3000 * t))), rows_of())
    assert len(readings.doubtful) > 10


def test_a_turn_is_not_read_at_halves_alone():
    """Halves of a turn look like the whole."""
    readings, rows = Readings(Source(lambda t: 1e6 * (2 + np.cos(2 * np.pi * 8 * t / T_END))), rows_of()), rows_of()
    K = readings.splined("K", rows)[:, 0, 0]
    np.testing.assert_allclose(K, 1e6 * (2 + np.cos(2 * np.pi * 8 * rows.t / T_END)), rtol=0, atol=3e4)


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_runs_of_few_rows_are_read(count):
    readings = Readings(Source(smooth), rows_of(count))
    assert len(readings.at) == min(count, len(readings.at))
    assert readings.splined("K", rows_of(count)).shape == (count, 2, 2)


class Hinge(Source):
    """A body on a joint whose three rows stand in axes of the ground, and a fourth one that stands in the body's."""

    def __init__(self):
        super().__init__(smooth)
        self.node = TurningNode(np.arange(7), np.array([0, 0, 0, 1.0, 0, 0, 0]), 0, True)
        self.frames, self.independent, self.scales = [self.node], np.array([1, 2, 3, 5]), 1e-5 * np.ones(6)

    def read(self, t, q, v, a, multipliers):
        self.asked += 1
        A, arm = rotation_matrix(self.node.parameters(q)), skew(np.array([0.3, -0.2, 0.1]))
        of_body = np.hstack([np.eye(3), -arm])
        C = np.vstack([A @ of_body, [0, 0, 0, 0, 0, 1.0]])
        H = np.zeros((6, 6, 6))
        for j in range(3):  # of G^T lam = of_body^T A^T lam, by a turn in axes of the body
            H[:, 3:, 1 + j] = of_body.T @ skew(A[j])
        return Reading.of(np.eye(6), np.zeros((6, 6)), np.zeros((6, 6)), C, C, H.reshape(-1, H.shape[2]))


def test_rows_that_turn_with_a_body_are_read_in_its_axes():
    count, turns = 400, 12
    t = np.linspace(0, 1, count)
    angle, axis = np.pi * turns * t, np.array([0.6, 0.0, 0.8])
    q = np.zeros((count, 7))
    q[:, 3:] = np.column_stack([np.cos(angle), np.sin(angle)[:, None] * axis]) - np.eye(4)[0]
    multipliers = np.column_stack([np.zeros(count), np.cos(9 * t), np.sin(50 * t), t, t, t])
    rows, source = Rows(t, q, 0 * q, 0 * q, multipliers), Hinge()
    readings = Readings(source, rows)
    assert source.asked <= 2 * FIRST + 3  # else some hundred
    for i in (0, 57, 201, 399):
        now = source.read(*rows.row(i))
        part = rows[i : i + 1]
        np.testing.assert_allclose(readings.splined("C", part)[0], now.C.toarray(), atol=1e-10)
        np.testing.assert_allclose(readings.splined("G", part)[0], now.G.toarray(), atol=1e-10)
        np.testing.assert_allclose(readings.splined.stiffness(part)[0], now.stiffness(multipliers[i]), atol=1e-10)


def test_forces_that_move_no_body_are_not_read_for():
    """What springs of 1e-9 N/m do along the run is less than any number shows."""
    source = Source(lambda t: 1e-9 * (1 + np.sign(np.sin(500 * t))))
    readings = Readings(source, rows_of())
    assert source.asked <= 2 * FIRST + 3
    assert readings.doubtful == set()


def test_many_readings_are_splined_in_windows():
    """An engine's spline takes gigabytes as a whole; in windows it is the same to 0.27^16 = 1e-9."""
    t = np.linspace(0.0, 1.0, 6 * KNOTS) ** 1.1
    values = np.column_stack([np.sin(60 * t), np.cos(17 * t)])
    readings = [Reading.of(*[np.diag(row)] * 5, np.zeros((4, 0))) for row in values]
    rows = Rows(t, *np.zeros((3, len(t), 2)), np.zeros((len(t), 0)))
    splined, at = Splined(rows, readings, np.ones(2), np.zeros(0)), np.linspace(0.0, 1.0, 1001)
    rows = Rows(at, *np.zeros((3, len(at), 2)), np.zeros((len(at), 0)))
    found, whole = splined("K", rows)[:, [0, 1], [0, 1]], CubicSpline(t, values)(at)
    assert np.abs(found - whole).max() < 1e-8
    assert np.abs(found - np.column_stack([np.sin(60 * at), np.cos(17 * at)])).max() < 0.02
