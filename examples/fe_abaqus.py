"""A flexible body from Abaqus files, and how wrong its reduction to 10 modes is: displacement and stress.

    python examples/fe_abaqus.py     prints the bounds (2 s)

The files are an .inp with one part and the two matrices that *Matrix Output, format=coordinate writes; those here are
made by models/make_abaqus_files.py. Abaqus counts nodes from 1, Exudyn from 0: node 11 there is node 10 here.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from exudyn import itemInterface
from exudyn.FEM import FEMinterface, HCBstaticModeSelection, KirchhoffMaterial, ObjectFFRFreducedOrderInterface

import exudyn_romerr as romerr

FILES = Path(__file__).resolve().parents[1] / "models" / "data" / "abaqus_bar"


def read_fem(files: str | Path = FILES) -> FEMinterface:
    """Return nodes, elements and matrices of NAME.inp, NAME_MASS1.mtx and NAME_STIF1.mtx."""
    return romerr.read_body(f"{files}.inp").to_fem()


def main(t_end: float = 0.02) -> romerr.BoundReport:
    """Weld the left face, load the right one, print and return the bounds."""
    fem = read_fem()
    faces = [fem.GetNodesInPlane([x, 0, 0], [1, 0, 0]) for x in (0, 0.4)]  # m
    weights = [fem.GetNodeWeightsFromSurfaceAreas(face) for face in faces]
    fem.ComputeHurtyCraigBamptonModes(
        faces, 4, computationMode=HCBstaticModeSelection.RBE3, boundaryNodesWeights=weights
    )
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    cms = ObjectFFRFreducedOrderInterface(fem)
    items = cms.AddObjectFFRFreducedOrder(mbs, massProportionalDamping=2, stiffnessProportionalDamping=1e-5)
    marker, body = itemInterface.MarkerSuperElementRigid, items["oFFRFreducedOrder"]
    left, right = (
        mbs.AddMarker(marker(bodyNumber=body, meshNodeNumbers=face, weightingFactors=weight))
        for face, weight in zip(faces, weights, strict=True)
    )
    ground = mbs.AddObject(itemInterface.ObjectGround(referencePosition=[0, 0.02, 0.03]))
    weld = mbs.AddMarker(itemInterface.MarkerBodyRigid(bodyNumber=ground))
    mbs.AddObject(itemInterface.GenericJoint(markerNumbers=[weld, left], constrainedAxes=[1] * 6))

    def force(mbs, t, loadVector):
        return [0, 0, 200 * np.sin(400 * t) ** 2]  # N

    mbs.AddLoad(itemInterface.LoadForceVector(markerNumber=right, loadVectorUserFunction=force))
    tip, root = fem.GetNodeAtPoint([0.4, 0.04, 0.06]), fem.GetNodeAtPoint([0.12, 0, 0.06])
    steel = KirchhoffMaterial(210e9, 0.3, 7850)
    outputs = [
        romerr.node_displacement("tip z", node=tip, component="z", unit="m"),
        romerr.node_stress("stress xx", node=root, fem=fem, material=steel, component="xx", unit="Pa"),
    ]
    monitor = romerr.attach(mbs, romerr.floating_body(fem, items), outputs=outputs, auxiliary_modes=100)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = t_end, round(t_end / 1e-4)
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    mbs.SolveDynamic(settings)
    print(monitor.report())
    return monitor.report()


if __name__ == "__main__":
    main()
