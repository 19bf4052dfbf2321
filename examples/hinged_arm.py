"""A flexible arm falls about a hinge and is pushed: a plain Exudyn script, without a line of exudyn_romerr.

romerr run examples/hinged_arm.py         # how wrong is its tip?
"""

import sys
from math import sin
from pathlib import Path

import exudyn as exu
from exudyn.FEM import HCBstaticModeSelection, ObjectFFRFreducedOrderInterface
from exudyn.utilities import (
    GenericJoint,
    LoadForceVector,
    MarkerBodyRigid,
    MarkerSuperElementRigid,
    ObjectGround,
    SensorSuperElement,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from models import floating


def push(mbs, t, loadVector) -> list[float]:
    """Push the end to and fro, across the plane of the hinge."""
    return [0, 500 * sin(50 * t) ** 2, 0]


def main() -> None:
    """Build the arm, let it fall for 0.2 s, print where its tip is."""
    fem = floating.load_fem("bar_fine")  # 311 nodes, as if just imported from ngsolve
    faces = [floating.interface(fem, side) for side in ("left", "right")]
    fem.ComputeHurtyCraigBamptonModes(
        boundaryNodesList=[nodes for nodes, _ in faces],
        boundaryNodesWeights=[weights for _, weights in faces],
        nEigenModes=4,
        useSparseSolver=True,
        computationMode=HCBstaticModeSelection.RBE2,
    )
    cms = ObjectFFRFreducedOrderInterface(fem)

    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    oArm = cms.AddObjectFFRFreducedOrder(
        mbs, gravity=[0, 0, -9.81], massProportionalDamping=2, stiffnessProportionalDamping=1e-5
    )["oFFRFreducedOrder"]
    nodes, weights = faces[0]
    hinge = weights @ fem.GetNodePositionsAsArray()[nodes]
    oGround = mbs.AddObject(ObjectGround(referencePosition=hinge))
    mGround = mbs.AddMarker(MarkerBodyRigid(bodyNumber=oGround))
    mArm = mbs.AddMarker(MarkerSuperElementRigid(bodyNumber=oArm, meshNodeNumbers=nodes, weightingFactors=weights))
    mbs.AddObject(GenericJoint(markerNumbers=[mGround, mArm], constrainedAxes=[1, 1, 1, 1, 0, 1]))
    nodes, weights = faces[1]
    mEnd = mbs.AddMarker(MarkerSuperElementRigid(bodyNumber=oArm, meshNodeNumbers=nodes, weightingFactors=weights))
    mbs.AddLoad(LoadForceVector(markerNumber=mEnd, loadVectorUserFunction=push))
    nTip = floating.interface(fem, "tip")[0][0]
    for name, shows in (
        ("tip", exu.OutputVariableType.Displacement),
        ("bending", exu.OutputVariableType.DisplacementLocal),
    ):
        mbs.AddSensor(SensorSuperElement(name=name, bodyNumber=oArm, meshNodeNumber=nTip, outputVariableType=shows))
    mbs.Assemble()

    simulationSettings = exu.SimulationSettings()
    simulationSettings.timeIntegration.endTime = 0.2
    simulationSettings.timeIntegration.numberOfSteps = 400
    simulationSettings.timeIntegration.verboseMode = 0
    simulationSettings.solution.file.write = False
    mbs.SolveDynamic(simulationSettings)
    print("tip:", mbs.GetSensorValues(0))


if __name__ == "__main__":
    main()
