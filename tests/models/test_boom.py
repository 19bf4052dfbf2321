"""The boom's file is what its code writes; its elements bend as beams do, and move freely."""

import numpy as np
import pytest
import scipy.sparse.linalg as sla

from models.boom_mesh import FILE, MOUNTS, STEEL, boom_fem, input_file, matrices
from models.hex_block import hex_block


def test_the_file_is_what_the_code_writes():
    assert FILE.read_text(encoding="ascii") == input_file()
    fem = boom_fem()
    assert [nodes["Name"] for nodes in fem.nodeSets] == [*MOUNTS]
    x = fem.GetNodePositionsAsArray()
    for name, (sections, side) in MOUNTS.items():
        nodes = next(of["NodeNumbers"] for of in fem.nodeSets if of["Name"] == name)
        assert len(nodes) == len(sections) * (4 if side else 16)
        assert len(np.unique(x[nodes, 0])) == len(sections)


def test_nothing_holds_it():
    fem = boom_fem()
    x, K = fem.GetNodePositionsAsArray(), fem.stiffnessMatrix
    for spin in np.eye(3):
        turned = K @ np.cross(spin, x).ravel()
        assert np.abs(turned).max() < 1e-9 * np.abs(K.data).max()
    moved = np.tile([1.0, 0.0, 0.0], len(x))
    assert np.abs(K @ moved).max() < 1e-9 * np.abs(K.data).max()
    assert moved @ fem.massMatrix @ moved == pytest.approx(630, rel=0.01)  # kg


def test_thin_elements_bend_as_a_beam():
    """One element over the height; plain hexahedra are 3 times as stiff."""
    length, width, height, force = 1.0, 0.05, 0.02, 100.0
    fem = hex_block((12, 1, 1), (length, width, height))
    x, hexes = fem.GetNodePositionsAsArray(), fem.elements[0]["Hex8"]
    _, K = matrices(x, hexes)
    end, free = np.flatnonzero(x[:, 0] == length), np.flatnonzero(np.repeat(x[:, 0] > 0, 3))
    f = np.zeros(x.size)
    f[3 * end + 2] = force / len(end)
    u = np.zeros(x.size)
    u[free] = sla.spsolve(K[free][:, free].tocsc(), f[free])
    beam = force * length**3 / (3 * STEEL[0] * width * height**3 / 12)
    assert u[3 * end + 2].mean() == pytest.approx(beam, rel=0.03)
    u[free] = sla.spsolve(fem.stiffnessMatrix[free][:, free].tocsc(), f[free])
    assert u[3 * end + 2].mean() < beam / 3
