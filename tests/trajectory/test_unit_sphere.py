"""Euler parameters moved along the unit sphere: turned by any angle, and not stretched."""

import mpmath
import numpy as np
import pytest

from exudyn_romerr.mbs.floating.frame_node import FrameNode
from exudyn_romerr.trajectory.unit_sphere import SERIES, _sinc, bend

ROUNDING = 1e-14  # of sums of a few terms
AXIS = np.array([2.0, -3.0, 6.0]) / 7


def turned(angle, angle_t, angle_tt):
    """Euler parameters and rates (3, 1, 4) of an angle about AXIS."""
    p = np.append(np.cos(angle / 2), np.sin(angle / 2) * AXIS)
    across = np.append(-np.sin(angle / 2), np.cos(angle / 2) * AXIS) / 2
    return np.array([p, across * angle_t, across * angle_tt - p / 4 * angle_t**2])[:, None]


def ahead(spin, off):
    """What is first order in p, p', p'' (3, 1, 4) if the angle is ahead by off: d(p, p', p'')/d(angle) times it."""
    (x, x_t, x_tt), (y, y_t, y_tt) = spin, off
    p, across = turned(x, 0.0, 0.0)[0], turned(x, 1.0, 0.0)[1]
    across_t, across_tt = -p / 4 * x_t, -p / 4 * x_tt - across / 4 * x_t**2
    return np.array([across * y, across_t * y + across * y_t, across_tt * y + 2 * across_t * y_t + across * y_tt])


@pytest.mark.parametrize("off", [1e-5, 0.02, 0.3, 2.0])
def test_a_spin_that_is_ahead_is_that_spin(off):
    spin, by = np.array([0.7, 3.0, 0.8]), off * np.array([1.0, 0.5, 0.4])
    p, e = turned(*spin), ahead(spin, by)
    np.testing.assert_allclose(p + e + bend(p, e), turned(*(spin + by)), rtol=0, atol=ROUNDING * 10)  # p'' is up to 4
    if off > 0.01:
        assert np.abs(p + e - turned(*(spin + by))).max() > off**2 / 16  # straight is off


def test_frame_that_is_turned_keeps_its_size():
    """A and w of a frame node: A orthogonal, and w the spin's."""
    node = FrameNode({"nodeType": "RigidBodyEP", "referenceCoordinates": [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]})
    spin, by = np.array([0.7, 3.0, 0.8]), np.array([0.3, 0.1, 0.2])
    reference = np.append([0.0, 0.0, 0.0], node.reference[3:]) * [[[1.0]], [[0.0]], [[0.0]]]
    states, e = (np.concatenate([np.zeros((3, 1, 3)), x], axis=2) for x in (turned(*spin), ahead(spin, by)))
    states = states - reference
    motion = node.motion(*(states + e + node.bend(states, e)))
    np.testing.assert_allclose(motion.A[0] @ motion.A[0].T, np.eye(3), rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(motion.w[0], AXIS * (spin + by)[1], rtol=0, atol=ROUNDING * 10)
    np.testing.assert_allclose(motion.al[0], AXIS * (spin + by)[2], rtol=0, atol=ROUNDING * 10)


def test_what_does_not_move_is_left_bit_for_bit():
    assert not bend(turned(0.7, 3.0, 0.8), np.zeros((3, 1, 4))).any()


@pytest.mark.parametrize("s", [1e-9, 0.99 * SERIES, 1.01 * SERIES, 9.0])
def test_series_and_quotients_agree_with_many_digits(s):
    """The quotients lose what SERIES allows: 1e-16 / SERIES^2."""
    with mpmath.workdps(50):
        exact = [mpmath.diff(lambda x: mpmath.sin(mpmath.sqrt(x)) / mpmath.sqrt(x), s, n) for n in range(3)]
    found = [float(x[0]) for x in _sinc(np.array([s]))]
    np.testing.assert_allclose(found, [float(exact[0] - 1), *map(float, exact[1:])], rtol=0, atol=1e-12)
