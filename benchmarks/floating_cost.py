"""What bounds of a floating body cost beside a simulation, and whether that depends on the size of the mesh.

The pendulum of models/floating.py with 14 modes, one output, estimators "energy" and "auxiliary" with 20 modes, scope
"inputs frozen", or the clamped bar, scope "complete".
Paired runs, CPU time: see pairs.py.

    python benchmarks/floating_cost.py [--steps 5000] [--pairs 15] [--step 1e-3] [--scene complete]
    python benchmarks/floating_cost.py --dof 1000 30000 [300000] [--kind RBE2]     with ngsolve (pip install .[mesh])

With --dof: CPU time spent in the PostStep function, which is all that bounds add to a step, and offline seconds
beside those of Exudyn's Craig-Bampton modes for the same body. The function stores the state in every step and
evaluates bounds in blocks. Storing takes longer where the simulation itself, on a larger mesh, has filled the caches.
Of 1e5 coordinates with 560 nodes on each face, 17 GB are too few for Exudyn's RBE3 modes, and for the bounds as well.
"""

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, thread_time
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # on a shared machine threads wait for one another

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, HCBstaticModeSelection, ObjectFFRFreducedOrderInterface

import exudyn_romerr as romerr
from benchmarks import pairs
from models import floating

MODES = 8  # eigenmodes beside the 6 static ones
ESTIMATORS = ("energy", "auxiliary")
AUXILIARY = 20
FROZEN = "inputs frozen"
BAR = (0.4, 0.04, 0.06)  # m
SPREAD = 1.1  # of the time that bounds add to a step, from mesh to mesh: what the project promises
SCENES = {"frozen": f"pendulum of {6 + MODES} modes", "complete": f"clamped bar of {6 + MODES} modes"}
CLOSE, TRIES = 0.1, 6  # a mesh within 10 % of the number of coordinates asked for is taken, or the last one tried


def settings(steps: int, h: float) -> exu.SimulationSettings:
    """Return settings that write nothing."""
    made = pairs.quiet(exu.SimulationSettings(), steps, h)
    made.timeIntegration.generalizedAlpha.spectralRadius = floating.SPECTRAL_RADIUS
    return made


class Bare(pairs.Variant):
    """The pendulum, or the clamped bar, nothing beside it."""

    def __init__(self, steps: int, h: float, complete: bool = False):
        self.complete = complete
        self.scene, self.settings = self.build(h, steps * h), settings(steps, h)
        self.mbs = self.scene.mbs
        self.timed_prepare()

    def build(self, h: float, t_end: float) -> Any:
        """Return the scene."""
        return (floating.clamped_bar if self.complete else floating.pendulum)(MODES, h=h, t_end=t_end)

    def prepare(self) -> None:
        """Assemble."""
        self.scene.mbs.Assemble()


class Sampled(Bare):
    """Bounds of the reduction error."""

    label = "energy + auxiliary 20, sampled"
    time = "sampled"
    limit = 1.05

    def prepare(self) -> None:
        """Attach the monitor, and do its offline work."""
        scene = self.scene
        node = int(floating.interface(scene.fem, "tip")[0][0])
        flex = romerr.floating_body(scene.fem, scene.items)
        self.monitor = monitor(scene.mbs, flex, node, self.time, "auto" if self.complete else FROZEN)

    def finish(self) -> None:
        """Ask for the report: it evaluates the last block."""
        self.report = self.monitor.report()


class Reconstructed(Sampled):
    """The time integration is covered too."""

    label = "energy + auxiliary 20, reconstructed"
    time = "reconstructed"


VARIANTS = (Bare, Sampled, Reconstructed)


def monitor(mbs: exu.MainSystem, flex: Any, node: int, time: str = "reconstructed", scope: str = FROZEN) -> Any:
    """Return a monitor of the displacement of a node, its offline work done."""
    outputs = [romerr.node_displacement("tip", node=node, component="z")]
    options = {"estimators": ESTIMATORS, "auxiliary_modes": AUXILIARY, "time": time, "scope": scope}
    made = romerr.attach(mbs, flex, outputs=outputs, **options)
    mbs.Assemble()
    _ = made.plan
    return made


class Costs(NamedTuple):
    """CPU time of a step in s: of the simulation, of all that bounds add to it, of what they do in every step.

    What they do in every step is to store the state. The rest of `extra` is the evaluation of blocks of steps.
    """

    simulation: float
    extra: float
    storing: float


@dataclass
class Mesh:
    """The pendulum of a meshed bar; craig_bampton, offline: seconds that Exudyn's modes and the bounds took."""

    dof: int
    mbs: exu.MainSystem
    monitor: Any
    craig_bampton: float
    offline: float

    def __post_init__(self):
        hook, self.spent = self.mbs.GetPostStepUserFunction()["function"], []

        def timed(mbs: exu.MainSystem, t: float) -> bool:
            begin = thread_time()
            go_on = hook(mbs, t)
            self.spent.append(thread_time() - begin)
            return go_on

        self.mbs.SetPostStepUserFunction(timed)

    def costs(self, steps: int, h: float) -> Costs:
        """Solve once. The call that begins the solve, which reads the body again, does not count."""
        self.spent.clear()
        begin = thread_time()
        self.mbs.SolveDynamic(settings(steps, h))
        solved = thread_time()
        _ = self.monitor.runs  # evaluates the last block
        extra = sum(self.spent[1:]) + thread_time() - solved
        return Costs((solved - begin - sum(self.spent)) / steps, extra / steps, np.median(self.spent))


def meshed(dof: int) -> FEMinterface:
    """Return a bar of quadratic tetrahedra with about so many coordinates; needs ngsolve."""
    import netgen.occ as occ
    import ngsolve

    shape = occ.OCCGeometry(occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(*BAR)))
    size, found = 0.04, 945
    for _ in range(TRIES):
        size *= (found / dof) ** (1 / 3)
        mesh = ngsolve.Mesh(shape.GenerateMesh(maxh=size))
        found = 3 * (mesh.nv + mesh.nedge)
        if abs(found / dof - 1) < CLOSE:
            break
    fem = FEMinterface()
    fem.ImportMeshFromNGsolve(mesh, density=7850, youngsModulus=2.1e11, poissonsRatio=0.3, meshOrder=2)
    return fem


def reduced(fem: FEMinterface, kind: str = "RBE3") -> Mesh:
    """Reduce a bar, hang it up as a pendulum, attach a monitor; both offline parts are timed."""
    faces = [fem.GetNodesInPlane([x, 0, 0], [1, 0, 0]) for x in (0.0, BAR[0])]
    weights = [fem.GetNodeWeightsFromSurfaceAreas(nodes) for nodes in faces]
    begin = perf_counter()
    mode = HCBstaticModeSelection[kind]
    fem.ComputeHurtyCraigBamptonModes(faces, MODES, computationMode=mode, boundaryNodesWeights=weights)
    craig_bampton = perf_counter() - begin
    mbs, items = pendulum(fem, faces, weights)
    begin = perf_counter()
    made = monitor(mbs, romerr.floating_body(fem, items), int(faces[1][0]))
    return Mesh(3 * fem.NumberOfNodes(), mbs, made, craig_bampton, perf_counter() - begin)


def pendulum(fem: FEMinterface, faces: list, weights: list) -> tuple[exu.MainSystem, dict[str, int]]:
    """Return an mbs with the bar hinged at its first face and loaded at its second, and the body's items."""
    cms = ObjectFFRFreducedOrderInterface(fem)
    mbs = exu.SystemContainer().AddSystem()
    alpha, beta = floating.RAYLEIGH
    items = cms.AddObjectFFRFreducedOrder(
        mbs, gravity=floating.GRAVITY, massProportionalDamping=alpha, stiffnessProportionalDamping=beta
    )
    on_face = {"bodyNumber": items["oFFRFreducedOrder"]}
    left, right = (
        mbs.AddMarker(itemInterface.MarkerSuperElementRigid(meshNodeNumbers=nodes, weightingFactors=w, **on_face))
        for nodes, w in zip(faces, weights, strict=True)
    )
    place = weights[0] @ fem.GetNodePositionsAsArray()[faces[0]]
    ground = mbs.AddObject(itemInterface.ObjectGround(referencePosition=place))
    hinge = [mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground)), left]
    mbs.AddObject(itemInterface.GenericJoint(markerNumbers=hinge, constrainedAxes=[1, 1, 1, 1, 0, 1]))
    mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=right, loadVector=[0, 200, 0]))
    return mbs, items


def measure_meshes(meshes: list[Mesh], steps: int, rounds: int, h: float) -> np.ndarray:
    """Return Costs of every mesh (pairs, meshes, 3); one round before is not counted."""
    return np.array([[mesh.costs(steps, h) for mesh in meshes] for _ in range(1 + rounds)][1:])


def print_meshes(meshes: list[Mesh], costs: np.ndarray) -> None:
    """Print what bounds add to a step and offline seconds, mesh by mesh."""
    print(f"{'dof':>8}{'simulation':>12}{'bounds':>8}{'storing':>9}{'evaluation':>12}   CPU us a step, medians")
    for mesh, (simulation, extra, storing) in zip(meshes, 1e6 * np.median(costs, axis=0), strict=True):
        print(f"{mesh.dof:8d}{simulation:12.1f}{extra:8.1f}{storing:9.1f}{extra - storing:12.1f}")
    print(f"{'dof':>8}{'offline / s':>13}{'Craig-Bampton / s':>19}{'ratio':>7}")
    for mesh in meshes:
        ratio = mesh.offline / mesh.craig_bampton
        print(f"{mesh.dof:8d}{mesh.offline:13.3g}{mesh.craig_bampton:19.3g}{ratio:7.2f}")
    extra, storing = costs[..., 1], costs[..., 2]
    for name, part in (("bounds", extra), ("evaluation", extra - storing)):
        middle = np.median(part / part[:, :1], axis=0)
        spread = middle.max() / middle.min()
        kept = "kept" if spread <= SPREAD else "NOT KEPT"
        print(f"{name}: largest over smallest mesh {spread:.3f}; promised at most {SPREAD:g}: {kept}")


def main(arguments: list[str] | None = None) -> tuple[list[Bare] | list[Mesh], np.ndarray]:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--pairs", type=int, default=15)
    parser.add_argument("--step", type=float, default=1e-3, help="step size in s")
    parser.add_argument("--scene", choices=SCENES, default="frozen")
    parser.add_argument("--dof", type=int, nargs="+", help="sizes of meshes; instead of the ratios")
    parser.add_argument("--kind", choices=("RBE3", "RBE2"), default="RBE3", help="modes of the meshes")
    options = parser.parse_args(arguments)
    if options.dof:
        meshes = [reduced(meshed(dof), options.kind) for dof in options.dof]
        found = meshes, measure_meshes(meshes, options.steps, options.pairs, options.step)
        print_meshes(*found)
    else:
        variants = [kind(options.steps, options.step, options.scene == "complete") for kind in VARIANTS]
        found = variants, pairs.measure(variants, options.pairs)
        pairs.print_ratios(*found, f"{SCENES[options.scene]}, one output")
    return found


if __name__ == "__main__":
    main()
