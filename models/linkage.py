"""The stabiliser linkage of a car's front suspension, example of Ruiner, Fehr, Haasdonk, Eberhard (2012).

The paper does not print the geometry. This steel U-bar of 19 beam elements was fitted to the constants C1,
C11, C12, C2 that it does print. It is clamped at its first node, loaded and observed in z at its last one.
"""

import numpy as np
from scipy import sparse

import exudyn_romerr as romerr
from models.beam3d import DOFS_PER_NODE, STEEL, RoundSection, assemble

LENGTH = 0.273414672  # m, in x
RISE = 0.0227476307  # m, in z
WIDTH = 0.940711435  # m, in y
CORNERS = np.array([[0.0, 0.0, 0.0], [LENGTH, 0.0, RISE], [LENGTH, WIDTH, RISE], [0.0, WIDTH, 0.0]])
ELEMENTS_PER_PIECE = (3, 13, 3)
SECTION = RoundSection(diameter=0.0226060158)  # m
RAYLEIGH = (0.0, 2.12087106e-5)  # alpha in 1/s, beta in s

TIP = sum(ELEMENTS_PER_PIECE)  # node 20 of the paper, which counts from 1
TIP_Z = DOFS_PER_NODE * TIP + 2
CLAMPED = range(DOFS_PER_NODE)

AMPLITUDE = 100.0  # N
FREQUENCY = 1.0  # Hz


def mesh() -> tuple[np.ndarray, np.ndarray]:
    """Nodes along the bar and the elements between neighbours.

    Returns
    -------
    nodes : ndarray, (20, 3)
        Positions in m.
    elements : ndarray of int, (19, 2)
        The two nodes of every element.
    """
    pieces = zip(CORNERS[:-1], CORNERS[1:], ELEMENTS_PER_PIECE, strict=True)
    nodes = np.vstack([np.linspace(a, b, n, endpoint=False) for a, b, n in pieces] + [CORNERS[-1]])
    index = np.arange(len(nodes))
    return nodes, np.column_stack([index[:-1], index[1:]])


def matrices() -> tuple[sparse.csc_array, sparse.csc_array]:
    """Mass and stiffness matrices of the bar, not clamped yet.

    Returns
    -------
    mass, stiffness : csc_array, (120, 120)
        In kg, m, N and rad.
    """
    return assemble(*mesh(), SECTION, STEEL)


def build() -> tuple[romerr.ElasticBody, np.ndarray, romerr.Output]:
    """Elastic body, input matrix and output of the example.

    Returns
    -------
    body : ElasticBody
        120 degrees of freedom, the first six fixed.
    inputs : ndarray, (120, 1)
        Unit force at the tip in z.
    output : Output
        Displacement of the tip in z, in m.
    """
    mass, stiffness = matrices()
    body = romerr.ElasticBody(mass, stiffness, rayleigh=RAYLEIGH, fixed=CLAMPED, positions=mesh()[0])
    inputs = np.zeros((mass.shape[0], 1))
    inputs[TIP_Z] = 1.0
    return body, inputs, romerr.node_displacement("tip z", node=TIP, component="z", unit="m")


def force(t: float | np.ndarray) -> float | np.ndarray:
    """Force at the tip in z.

    Parameters
    ----------
    t : float or ndarray
        Time in s.

    Returns
    -------
    float or ndarray
        Force in N, of the shape of t.
    """
    return AMPLITUDE * np.sin(2 * np.pi * FREQUENCY * t)
