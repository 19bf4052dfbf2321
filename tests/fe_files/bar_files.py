"""The bar of models/floating.py as files of other programs, its nodes numbered with gaps and in another order."""

from functools import cache

import numpy as np
from scipy import sparse

from models import floating

SEED = 7
NODES = 65


@cache
def numbers():
    """What the file calls nodes 0 .. 64: no two in a row, not in the bar's order."""
    return 10 + 3 * np.random.default_rng(SEED).permutation(NODES)


@cache
def bar():
    """The fem in the order of the numbers: positions, tetrahedra, mass, stiffness, node sets by name."""
    fem = floating.load_fem("bar")
    order = np.argsort(numbers())
    new = np.argsort(order)
    dofs = (3 * order[:, None] + np.arange(3)).ravel()
    matrices = [sparse.csr_matrix(A)[dofs][:, dofs] for A in (fem.massMatrix, fem.stiffnessMatrix)]
    sets = {part["Name"]: np.sort(new[part["NodeNumbers"]]) for part in fem.nodeSets}
    tets = new[np.asarray(fem.elements[0]["Tet4"])][:, [0, 2, 1, 3]]  # Abaqus's way round
    return fem.GetNodePositionsAsArray()[order], tets, *matrices, sets


def in_order():
    """Numbers of the nodes of bar(), ascending."""
    return np.sort(numbers())


def matrix_input(matrix, labels, triangle=None):
    """Lines of *Matrix Output, format=matrix input; labels (n, 2): node and coordinate from 1."""
    entries = sparse.coo_matrix(matrix if triangle is None else triangle(matrix))
    rows = zip(labels[entries.row], labels[entries.col], entries.data, strict=True)
    return "".join(f"{i},{k}, {j},{m}, {x:.15e}\n" for (i, k), (j, m), x in rows)


def labels():
    """(node, coordinate from 1) of every row of bar()'s matrices."""
    return np.column_stack([np.repeat(in_order(), 3), np.tile([1, 2, 3], NODES)])


def node_lines(positions=None):
    x = bar()[0] if positions is None else positions
    return "".join(f"{n}, {a!r}, {b!r}, {c!r}\n" for n, (a, b, c) in zip(in_order(), x.tolist(), strict=True))


def tet_lines(tets, first=1):
    return "".join(f"{e}, {', '.join(map(str, in_order()[t]))}\n" for e, t in enumerate(tets, start=first))


def write_abaqus(folder, text=None, mass=None, stiffness=None):
    """job.inp, job_MASS1.mtx and job_STIF1.mtx; each as given, or the bar's."""
    _, tets, M, K, _ = bar()
    text = f"*Node\n{node_lines()}*Element, type=C3D4\n{tet_lines(tets)}" if text is None else text
    (folder / "job.inp").write_text(text)
    for name, given, matrix in (("MASS", mass, M), ("STIF", stiffness, K)):
        lines = matrix_input(matrix, labels(), sparse.tril) if given is None else given
        (folder / f"job_{name}1.mtx").write_text(lines)
    return folder / "job.inp"


def assert_bar(model, digits=1e-14):
    """Nodes and matrices are those of bar()."""
    x, _, M, K, _ = bar()
    np.testing.assert_array_equal(model.node_numbers, in_order())
    np.testing.assert_allclose(model.positions, x, rtol=0, atol=1e-15)
    for found, wanted in ((model.mass, M), (model.stiffness, K)):
        assert abs(found - wanted).max() <= digits * abs(wanted).max()
