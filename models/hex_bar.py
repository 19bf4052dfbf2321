"""A plastic bar of 4 x 1 x 1 hexahedra, 60 coordinates: few enough for all its modes in Exudyn and exact truths.

The left face may be driven: a joint with all axes locked whose offsets are functions of time.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface
from scipy import sparse

from models import floating

if TYPE_CHECKING:
    from collections.abc import Callable

SIZE, ELEMENTS = (0.4, 0.03, 0.04), 4  # m; along x
YOUNG, DENSITY, POISSON = 2e9, 2000.0, 0.3
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
LINEAR = np.polynomial.legendre.leggauss(2)[0]  # of -1..1; weights 1


@dataclass
class HexScene:
    """A model of the bar; items, markers and sensors are Exudyn's numbers.

    Markers: MarkerSuperElementRigid "left", "right". Sensors, of a corner at the far end of the bar: "displacement",
    "position", "velocity" (global axes), "displacement local", "velocity local" (in the floating frame).
    """

    SC: Any
    mbs: Any
    fem: FEMinterface
    cms: ObjectFFRFreducedOrderInterface
    items: dict[str, int]
    markers: dict[str, int]
    sensors: dict[str, int]
    settings: exu.SimulationSettings

    def solve(self) -> None:
        """Assemble if that was not done, and solve from the start to the end."""
        if not self.mbs.systemIsConsistent:
            self.mbs.Assemble()
        self.mbs.SolveDynamic(self.settings)


def load_fem() -> FEMinterface:
    """Return the bar without modes; node sets "left", "right" (end faces), "tip" (a corner of the right one)."""
    fem = FEMinterface()
    edge = np.array([SIZE[0] / ELEMENTS, *SIZE[1:]])
    grid = {cell: i for i, cell in enumerate(product(range(ELEMENTS + 1), (0, 1), (0, 1)))}
    hexes = np.array([[grid[i + x, y, z] for x, y, z in CORNERS] for i in range(ELEMENTS)])
    x = np.array(list(grid)) * edge
    mass, stiffness = _element(edge)
    fem.nodes = {"Position": x}
    fem.elements = [{"Name": "bar", "Hex8": hexes}]
    fem.massMatrix, fem.stiffnessMatrix = (_assembled(matrix, hexes, len(x)) for matrix in (mass, stiffness))
    faces = {"left": x[:, 0] == 0, "right": x[:, 0] > SIZE[0] - 1e-9}
    fem.nodeSets = [
        {"Name": name, "NodeNumbers": np.flatnonzero(face), "NodeWeights": np.full(4, 0.25)}
        for name, face in faces.items()
    ]
    fem.nodeSets.append({"Name": "tip", "NodeNumbers": np.array([len(x) - 1]), "NodeWeights": np.ones(1)})
    return fem


def bar(
    n: int = 4, kind: str = "RBE3", h: float = 1e-3, t_end: float = 0.04, gravity: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> HexScene:
    """Return the bar alone, nothing holds it; n, kind: modes, see floating.reduce; Rayleigh damping 2, 1e-5."""
    fem = load_fem()
    floating.reduce(fem, n, kind)
    cms = ObjectFFRFreducedOrderInterface(fem)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    alpha, beta = floating.RAYLEIGH
    items = cms.AddObjectFFRFreducedOrder(
        mbs, gravity=list(gravity), massProportionalDamping=alpha, stiffnessProportionalDamping=beta
    )
    flexible = items["oFFRFreducedOrder"]
    markers = {
        side: floating.add_interface_marker(mbs, flexible, *floating.interface(fem, side))
        for side in ("left", "right")
    }
    sensors = _add_sensors(mbs, flexible, len(fem.nodes["Position"]) - 1)
    return HexScene(SC, mbs, fem, cms, items, markers, sensors, floating.solver_settings(h, t_end))


def driven(motion: Callable, rate: Callable | None = None, back: bool = False, **options: Any) -> HexScene:
    """Return the bar, its left face welded to the ground but for offsets motion(t) (6,), with rates rate(t).

    back : the ground has the joint's second marker. options: those of bar.
    """
    scene = bar(**options)
    nodes, weights = floating.interface(scene.fem, "left")
    position = weights @ scene.fem.GetNodePositionsAsArray()[nodes]
    ground = scene.mbs.AddObject(itemInterface.ObjectGround(referencePosition=position))
    marker = scene.mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground))
    functions = {"offsetUserFunction": lambda mbs, t, i, parameters: list(motion(t))}
    if rate is not None:
        functions["offsetUserFunction_t"] = lambda mbs, t, i, parameters: list(rate(t))
    markers = [marker, scene.markers["left"]]
    scene.mbs.AddObject(itemInterface.GenericJoint(markerNumbers=markers[::-1] if back else markers, **functions))
    return scene


def spinning(share: float, **options: Any) -> HexScene:
    """Return the bar, hinged (axis y) at its left face, spinning at a share of its first frequency if clamped there.

    options: those of bar. It begins undeformed: centrifugal forces act at once.
    """
    scene = bar(**options)
    nodes, weights = floating.interface(scene.fem, "left")
    hinge = weights @ scene.fem.GetNodePositionsAsArray()[nodes]
    floating._add_joint(scene, "left", [1, 1, 1, 1, 0, 1])
    w = np.array([0.0, share * first_frequency(), 0.0])
    rates = [*-np.cross(w, hinge), 0.0, *(w / 2)]  # of the origin, and of Euler parameters
    scene.mbs.SetNodeParameter(scene.items["nRigidBody"], "initialVelocities", rates)
    return scene


def first_frequency() -> float:
    """Return the first frequency in rad/s of the bar whose left face has no mean motion."""
    fem = load_fem()
    floating.reduce(fem, 0, "complete")
    return float(np.sqrt(fem.eigenValues[0]))


def _element(edge: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness (24, 24) of one hexahedron, trilinear, 2 x 2 x 2 points."""
    mass, stiffness = np.zeros((2, 24, 24))
    volume, signs = float(np.prod(edge)) / 8, 2.0 * CORNERS - 1
    lame, shear = YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON), YOUNG / 2 / (1 + POISSON)
    elasticity = np.diag([2 * shear] * 3 + [shear] * 3)
    elasticity[:3, :3] += lame
    for point in product(LINEAR, repeat=3):
        lines = (1 + signs * point) / 2
        shape = lines.prod(axis=1)
        slopes = np.stack([signs[:, i] * np.delete(lines, i, axis=1).prod(axis=1) / edge[i] for i in range(3)])
        strain = np.zeros((6, 8, 3))
        for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
            strain[row, :, j] = slopes[i]
            strain[row, :, i] = slopes[j]
        strain = strain.reshape(6, 24)
        stiffness += volume * strain.T @ elasticity @ strain
        mass += volume * DENSITY * np.kron(np.outer(shape, shape), np.eye(3))
    return mass, stiffness


def _assembled(element: np.ndarray, hexes: np.ndarray, nodes: int) -> sparse.csr_matrix:
    places = (3 * hexes[:, :, None] + np.arange(3)).reshape(len(hexes), -1)
    rows, columns = (np.broadcast_to(x, (len(hexes), 24, 24)).ravel() for x in (places[:, :, None], places[:, None]))
    values = np.tile(element.ravel(), len(hexes))
    return sparse.csr_matrix((values, (rows, columns)), shape=(3 * nodes, 3 * nodes))


def _add_sensors(mbs: Any, flexible: int, node: int) -> dict[str, int]:
    kinds = exu.OutputVariableType
    shown = {
        "displacement": kinds.Displacement,
        "position": kinds.Position,
        "velocity": kinds.Velocity,
        "displacement local": kinds.DisplacementLocal,
        "velocity local": kinds.VelocityLocal,
    }
    sensor = itemInterface.SensorSuperElement
    return {
        name: mbs.AddSensor(
            sensor(bodyNumber=flexible, meshNodeNumber=node, storeInternal=True, outputVariableType=kind, name=name)
        )
        for name, kind in shown.items()
    }
