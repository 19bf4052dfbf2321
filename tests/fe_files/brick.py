"""A bar of 8 x 1 x 2 Hex8 elements, by products of matrices of its three edges, as files that programs write of it.

0.4 x 0.02 x 0.03 m of steel; node numbers of the files have gaps. Held at x = 0 its first frequency is OMEGA, which
another program of ours (2 x 2 x 2 Gauss points an element) and a dense eigensolver gave.
"""

from functools import cache, reduce

import numpy as np
from scipy import sparse
from scipy.io import mmwrite

SIZE, COUNT = (0.4, 0.02, 0.03), (8, 1, 2)
LAME, SHEAR, DENSITY = 2.1e11 * 0.3 / (1.3 * 0.4), 2.1e11 / 2.6, 7850.0
OMEGA = 1235.55
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))


def edge(size, count):
    """Integrals over an edge of products of its hat functions or slopes: by how many of the two are slopes."""
    h, n = size / count, count + 1
    inner = np.r_[1.0, np.full(n - 2, 2.0), 1.0]
    slope = np.diag(np.full(n - 1, -0.5), 1) + np.diag(np.full(n - 1, 0.5), -1)
    slope[0, 0], slope[-1, -1] = -0.5, 0.5
    beside = np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    return {
        (0, 0): h / 6 * (np.diag(2 * inner) + beside),
        (1, 1): (np.diag(inner) - beside) / h,
        (1, 0): slope,
        (0, 1): slope.T,
    }


@cache
def brick():
    """Mass, stiffness, positions, cells."""
    edges = [edge(*x) for x in zip(SIZE, COUNT, strict=True)]

    def product(a=None, b=None):
        """Integrals of the slopes along a of one function and along b of the other."""
        return reduce(np.kron, [edges[t][(int(t == a), int(t == b))] for t in range(3)])

    K = np.zeros((3, 3, 54, 54))
    for a in range(3):
        for b in range(3):
            K[a, b] = LAME * product(a, b) + SHEAR * product(b, a)
        K[a, a] += SHEAR * sum(product(c, c) for c in range(3))
    K = K.transpose(2, 0, 3, 1).reshape(162, 162)
    grid = np.indices([n + 1 for n in COUNT]).reshape(3, -1).T
    at = {tuple(x): i for i, x in enumerate(grid.tolist())}
    first = np.indices(COUNT).reshape(3, -1).T
    cells = np.array([[at[tuple(x)] for x in (corner + np.array(CORNERS)).tolist()] for corner in first])
    K[np.abs(K) < 1e-9 * np.abs(K).max()] = 0.0
    M = DENSITY * np.kron(product(), np.eye(3))
    return sparse.csr_matrix(M), sparse.csr_matrix((K + K.T) / 2), grid * np.array(SIZE) / COUNT, cells


NUMBERS = 5 + 3 * np.arange(54)  # what files call the nodes
LEFT = np.arange(6)
FREE = np.arange(18, 162)  # coordinates beside those of the left end


def deck(path, *, clamped=False, numbers=NUMBERS, more=""):
    """An .inp; clamped: *Boundary holds the left end."""
    _, _, x, cells = brick()
    lines = [
        "*NODE, NSET=Nall",
        *(f"{n}, {a:.9g}, {b:.9g}, {c:.9g}" for n, (a, b, c) in zip(numbers, x, strict=True)),
    ]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=Eall"]
    lines += [f"{i}, {', '.join(map(str, numbers[cell]))}" for i, cell in enumerate(cells, start=1)]
    lines += ["*NSET, NSET=left", *(f"{n}," for n in numbers[LEFT])]
    lines += ["*BOUNDARY", "left, 1, 3"] if clamped else []
    path.write_text("\n".join([*lines, more, ""]))
    return path


def triples(matrix):
    """Lines of row, column, value of a whole matrix or a triangle."""
    found = sparse.coo_matrix(matrix)
    return "".join(f"{i} {k} {x:20.13e}\n" for i, k, x in zip(found.row + 1, found.col + 1, found.data, strict=True))


def calculix(folder, rows, job="job", change=lambda matrix: sparse.triu(matrix)):
    """JOB.inp, .sti, .mas and .dof of *Frequency, solver=MatrixStorage; rows: those that *Boundary leaves."""
    M, K, *_ = brick()
    for ending, matrix in (("sti", K), ("mas", M)):
        (folder / f"{job}.{ending}").write_text(triples(change(matrix[rows][:, rows])))
    (folder / f"{job}.dof").write_text("".join(f"{NUMBERS[i // 3]}.{i % 3 + 1}\n" for i in rows))
    return deck(
        folder / f"{job}.inp", clamped=len(rows) < 162, more="*STEP\n*FREQUENCY, SOLVER=MATRIXSTORAGE\n*END STEP"
    )


def harwell(matrix, kind="RSA", exponent="D", rhs=0, a_line=3):
    """Text of a Harwell-Boeing file as Ansys writes it: a triangle, right-hand sides, exponents with D."""
    part = sparse.csc_matrix(sparse.tril(matrix) if kind[1] == "S" else matrix)
    part.sort_indices()
    pointers, indices = ([f"{x + 1:9d}" for x in numbers] for numbers in (part.indptr, part.indices))
    values = [f"{x:25.15E}".replace("E", exponent) for x in part.data]
    blocks = [in_lines(pointers, 8), in_lines(indices, 8), in_lines(values, a_line), ["0.0"] * rhs]
    counts = [sum(map(len, blocks)), *map(len, blocks)]
    head = [
        f"{'Matrix of a test':72}{'KEY':8}",
        "".join(f"{n:14d}" for n in counts),
        f"{kind:14}" + "".join(f"{n:14d}" for n in (*part.shape, part.nnz, 0)),
        f"{'(8I9)':16}{'(8I9)':16}{f'({a_line}{exponent}25.15)':20}{'(D25.15)':20}",
    ]
    return "\n".join(
        [*head, *([f"{'F':14}{1:14d}{0:14d}"] if rhs else []), *(x for block in blocks for x in block), ""]
    )


def in_lines(words, a_line):
    return ["".join(words[i : i + a_line]) for i in range(0, len(words), a_line)]


def pair(folder, ending, write, *, stiffness=None, mass=None):
    """K.ending and M.ending, each of the brick or as given."""
    M, K, *_ = brick()
    for name, matrix in (("K", K if stiffness is None else stiffness), ("M", M if mass is None else mass)):
        write(folder / f"{name}.{ending}", matrix)
    return folder / f"K.{ending}"


def market(path, matrix):
    mmwrite(path.with_suffix(".mtx"), sparse.coo_matrix(matrix), symmetry="general", precision=17)
    path.with_suffix(".mtx").rename(path)
