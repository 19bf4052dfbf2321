"""Outputs: changes of what sensors show are differences of what they show in moved states."""

import numpy as np
import pytest

from exudyn_romerr.mechanism.outputs import CLOSED, NodeSensor, Outputs
from exudyn_romerr.mechanism.rows import Rows
from tests.helpers.small_mechanism import SmallMechanism

STEP = 1e-6


def sensor_of(mechanism, kind, node=2):
    small = mechanism.small
    return NodeSensor(0, 0, kind, small.shapes[3 * node : 3 * node + 3], small.positions[node])


def moved_rows(u, rows, e):
    """Rows moved by e (3, n_a) of the unknowns in global axes, without vectors."""
    moved = u.moved((rows.q, rows.v, rows.a), np.tile(e[:, None], (1, len(rows), 1)))
    return Rows(rows.t, *moved, rows.multipliers)


@pytest.mark.parametrize("kind", CLOSED)
def test_sensors_of_nodes_in_closed_form(kind):
    mechanism = SmallMechanism()
    u, rows, node = mechanism.unknowns, mechanism.rows, sensor_of(mechanism, kind)
    outputs = Outputs(u, rows, np.full(3, -1 if kind.endswith("Local") else 0), [node])
    rng = np.random.default_rng(4)
    e = rng.normal(size=(3, u.n_a))
    e[:, u.kept] = 0.0
    states = [moved_rows(u, rows, sign * STEP * e) for sign in (1, -1)]
    truth = (node.values(u.bodies[0], states[0]) - node.values(u.bodies[0], states[1])) / (2 * STEP)
    wide = np.zeros((len(rows), 3, u.n, 1))
    wide[:, :, : u.n_a, 0] = STEP * e
    found = outputs(0, wide, np.zeros((len(rows), 1, 1)))[..., 0] / STEP
    np.testing.assert_allclose(found, truth, rtol=0, atol=1e-5 * np.abs(truth).max())  # STEP e of second order


def test_sensors_of_nodes_that_are_turned_far():
    """By some 0.3 rad: positions are those of moved states, velocities how these change while all goes on."""
    mechanism, dt = SmallMechanism(), 1e-5
    u, rows = mechanism.unknowns, mechanism.rows
    e = 0.3 * np.random.default_rng(4).normal(size=(3, u.n_a))
    e[:, u.kept] = 0.0

    def shown(kind, s):
        later = Rows(rows.t, rows.q + s * rows.v, rows.v, rows.a, rows.multipliers)
        now = e[0] + s * e[1]
        moved = moved_rows(u, later, np.array([now, e[1], e[2]]))
        node, wide = sensor_of(mechanism, kind), np.zeros((len(rows), 3, u.n, 1))
        wide[:, 0, : u.n_a, 0], wide[:, 1, : u.n_a, 0] = now, e[1]
        changes = Outputs(u, later, np.full(3, 0), [node])(0, wide, np.zeros((len(rows), 1, 1)))[..., 0]
        return [node.values(u.bodies[0], x) for x in (moved, later)], changes

    (moved, own), changes = shown("Position", 0.0)
    np.testing.assert_allclose(changes, moved - own, atol=1e-6 * np.abs(own).max())  # what SERIES misses
    (after, _), (before, _) = (shown("Position", s)[0] for s in (dt, -dt))
    (_, own), changes = shown("Velocity", 0.0)
    truth = (after - before) / (2 * dt) - own
    np.testing.assert_allclose(changes, truth, atol=7e-6 * np.abs(truth).max())  # of its rate seven times as much


def test_vectors_move_nodes():
    mechanism = SmallMechanism()
    u, rows, node = mechanism.unknowns, mechanism.rows, sensor_of(mechanism, "DisplacementLocal")
    e = np.zeros((len(rows), 3, u.n, 1))
    k = u.waves[0].start
    e[:, 0, k] = 2.0
    found = Outputs(u, rows, np.full(3, -1), [node])(0, e, np.zeros((len(rows), 1, 1)))[..., 0]
    np.testing.assert_allclose(found, np.tile(2.0 * node.shapes[:, u.bodies[0].na], (len(rows), 1)))


class Asked:
    """Gradients of a sensor that change over time; counts how often it is asked."""

    uses = (True, False, False, True)

    def __init__(self, n, over):
        self._n, self._over, self.asked = n, over, 0

    def gradients(self, i):
        self.asked += 1
        return [
            self._over(i) * np.ones((1, self._n)),
            np.zeros((1, self._n)),
            np.zeros((1, self._n)),
            np.ones((1, 1)),
        ]


@pytest.mark.parametrize(("over", "most"), [(lambda i: 1.0 + i, 3), (lambda i: 1 + np.sin(i / 10), 65)])
def test_gradients_are_asked_for_until_they_are_straight(over, most):
    mechanism = SmallMechanism(T=60)
    u, rows = mechanism.unknowns, mechanism.rows
    source = Asked(u.n, over)
    outputs = Outputs(u, rows, np.array([-1]), [], [slice(0, 1)], source)
    assert source.asked == len(outputs.at) <= most
    e, lam = np.zeros((60, 3, u.n, 1)), np.full((60, 1, 1), 5.0)
    e[:, 0, -1] = 1.0
    e[:, 1] = 7.0  # rates are not used
    truth = np.array([over(i) + 5.0 for i in range(60)])
    whole = outputs(0, e, lam)[:, 0, 0]
    np.testing.assert_allclose(whole, truth, rtol=3e-3)
    np.testing.assert_array_equal(outputs(20, e[20:45], lam[20:45])[:, 0, 0], whole[20:45])
