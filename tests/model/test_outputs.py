"""Outputs and their makers: rows, units, which nodes, which coordinates."""

import numpy as np
import pytest

from exudyn_romerr import (
    ElasticBody,
    InputError,
    Output,
    mean_displacement,
    node_displacement,
    node_rotation,
    node_velocity,
    relative_displacement,
)
from exudyn_romerr.linear.residual.problem import checked_outputs
from exudyn_romerr.model.outputs import stacked_rows
from tests.helpers import tolerances as tol

NODES = 4


def body(per_node=6):
    """Diagonal body: only sizes, positions and masses matter."""
    size = per_node * NODES
    positions = np.arange(3.0 * NODES).reshape(NODES, 3)
    return ElasticBody(np.diag(np.arange(1.0, size + 1)), np.eye(size), fixed=(0, 1), positions=positions)


MAKERS = [node_displacement, node_velocity, node_rotation]


@pytest.mark.parametrize("component", ["x", "z", "xyz", "zx"])
@pytest.mark.parametrize("node", range(NODES))
@pytest.mark.parametrize("maker", MAKERS)
def test_node_makers_pick_one_coordinate_a_row(maker, node, component):
    """Row k is 1 at coordinate 6 node + component (3 more for rotations), in the order of the letters."""
    rows = maker("o", node=node, component=component).resolve(body())
    wanted = np.zeros((len(component), 6 * NODES))
    for row, letter in enumerate(component):
        wanted[row, 6 * node + "xyz".index(letter) + 3 * (maker is node_rotation)] = 1.0
    assert np.array_equal(rows, wanted)


def test_units_and_kinds():
    """Nobody knows the unit of lengths but the user; radians are the same in all systems of units."""
    made = [maker("o", node=1) for maker in MAKERS]
    assert [(out.unit, out.of) for out in made] == [
        ("", "displacement"),
        ("", "velocity"),
        ("rad", "displacement"),
    ]
    assert [out.quantity for out in made] == ["displacement", "velocity", "rotation"]
    assert (Output("own", np.ones(3)).unit, Output("own", np.ones(3)).quantity) == ("", "")


def test_mean_displacement():
    """Weights are scaled to sum 1; equal by default; a node named twice counts twice."""
    q = np.random.default_rng(0).standard_normal(6 * NODES)
    z = q[2::6]
    cases = {(): z[[1, 3]].mean(), (1.0, 3.0): (z[1] + 3 * z[3]) / 4}
    for weights, wanted in cases.items():
        out = mean_displacement("m", nodes=[1, 3], weights=weights or None, component="z")
        assert out.resolve(body()) @ q == pytest.approx([wanted], rel=tol.ENTRIES)
    twice = mean_displacement("m", nodes=[1, 1, 3], component="z")
    assert twice.resolve(body()) @ q == pytest.approx([(2 * z[1] + z[3]) / 3], rel=tol.ENTRIES)


def test_relative_displacement():
    """Displacement of node minus that of the other; blind to a translation of both."""
    q = np.random.default_rng(1).standard_normal(6 * NODES).reshape(NODES, 6)
    rows = relative_displacement("r", node=3, other=1).resolve(body())
    assert rows @ q.ravel() == pytest.approx(q[3, :3] - q[1, :3], rel=tol.ENTRIES)


def test_rows_may_be_one_vector_or_several():
    """(N,) becomes (1, N); a callable is resolved with the body."""
    size = 6 * NODES
    assert Output("o", np.ones(size)).resolve(body()).shape == (1, size)
    assert Output("o", np.ones((3, size))).resolve(body()).shape == (3, size)
    assert Output("o", lambda b: np.full(b.N, 2.0)).resolve(body()).tolist() == [[2.0] * size]


def test_constant_of_a_fixed_coordinate_is_zero():
    """C2_i = 1/sqrt(mass) for a diagonal M, zero where the coordinate is fixed: it cannot err."""
    constant = node_displacement("o", node=0).constant(body())
    assert constant == pytest.approx([0.0, 0.0, 1 / np.sqrt(3.0)], rel=tol.ENTRIES)


def test_stacked_rows():
    """All rows on the free coordinates, the velocity rows marked, one slice for each output."""
    outputs = (node_displacement("a", node=1), node_velocity("b", node=2, component="x"), Output("c", np.ones(24)))
    rows, velocity, slices = stacked_rows(outputs, body())
    assert rows.shape == (5, 22)
    assert velocity.tolist() == [False, False, False, True, False]
    assert slices == [slice(0, 3), slice(3, 4), slice(4, 5)]


def test_two_outputs_of_one_name_are_refused():
    """A report finds outputs by name."""
    with pytest.raises(InputError, match="'a' is used more than once"):
        checked_outputs([Output("a", np.ones(24))] * 2)
