"""A robot arm whose controller is a PreStep function: a plain Exudyn script, without a line of exudyn_romerr.

A hub turns about z; a flexible link is welded to it, a payload to the link's end. A PD controller with feed forward
sets the torque of the motor at the begin of every step, as in most of Exudyn's robots. Estimated, and measured:

    romerr run examples/robot_prestep.py
    romerr verify examples/robot_prestep.py
    romerr run examples/robot_prestep.py 4          # with steps of 1 ms / 4
"""

import sys
from math import cos, pi, sin
from pathlib import Path

import exudyn as exu
from exudyn.FEM import HCBstaticModeSelection, ObjectFFRFreducedOrderInterface
from exudyn.utilities import (
    GenericJoint,
    InertiaCuboid,
    InertiaCylinder,
    LoadTorqueVector,
    MarkerBodyRigid,
    MarkerSuperElementRigid,
    SensorBody,
    SensorSuperElement,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from models import floating

END, MOVE, TURN = 0.4, 0.3, pi / 3  # s of the run and of the motion, rad
P, D = 4000.0, 60.0  # Nm/rad, Nms/rad
INERTIA = 0.9  # kg m^2 about the hub, of all that turns: for the feed forward
FINER = int(sys.argv[1]) if len(sys.argv) > 1 else 1


def set_point(t):
    """Angle, rate and acceleration that are wanted: a cycloid."""
    s, w = min(t / MOVE, 1.0), 2 * pi / MOVE
    rate, acceleration = TURN / MOVE * (1 - cos(w * s * MOVE)), TURN / MOVE * w * sin(w * s * MOVE)
    return TURN * (s - sin(2 * pi * s) / (2 * pi)), rate, acceleration


def main():
    """Build the robot, turn it by 60 degrees, print where the payload is."""
    fem = floating.load_fem("bar_fine")  # as if just imported from ngsolve
    faces = [floating.interface(fem, side) for side in ("left", "right")]
    fem.ComputeHurtyCraigBamptonModes(
        boundaryNodesList=[nodes for nodes, _ in faces],
        boundaryNodesWeights=[weights for _, weights in faces],
        nEigenModes=6,
        useSparseSolver=True,
        computationMode=HCBstaticModeSelection.RBE3,
    )
    positions = fem.GetNodePositionsAsArray()
    ends = [weights @ positions[nodes] for nodes, weights in faces]

    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    oGround = mbs.CreateGround()
    bHub = mbs.CreateRigidBody(referencePosition=ends[0], inertia=InertiaCylinder(7800, 0.05, 0.04, axis=2))
    mbs.CreateRevoluteJoint(itemNumbers=[oGround, bHub], position=ends[0], axis=[0, 0, 1])
    oLink = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(mbs, stiffnessProportionalDamping=2e-5)
    link = oLink["oFFRFreducedOrder"]
    bPayload = mbs.CreateRigidBody(referencePosition=ends[1], inertia=InertiaCuboid(7800, [0.08, 0.08, 0.08]))
    for body, (nodes, weights) in zip((bHub, bPayload), faces, strict=True):
        mBody = mbs.AddMarker(MarkerBodyRigid(bodyNumber=body))
        mLink = mbs.AddMarker(
            MarkerSuperElementRigid(bodyNumber=link, meshNodeNumbers=nodes, weightingFactors=weights)
        )
        mbs.AddObject(GenericJoint(markerNumbers=[mBody, mLink]))
    mHub = mbs.AddMarker(MarkerBodyRigid(bodyNumber=bHub))
    lMotor = mbs.AddLoad(LoadTorqueVector(markerNumber=mHub, loadVector=[0, 0, 0]))
    shows = exu.OutputVariableType
    sAngle = mbs.AddSensor(SensorBody(name="angle", bodyNumber=bHub, outputVariableType=shows.Rotation))
    sRate = mbs.AddSensor(SensorBody(name="rate", bodyNumber=bHub, outputVariableType=shows.AngularVelocity))
    mbs.AddSensor(SensorBody(name="payload", bodyNumber=bPayload, outputVariableType=shows.Position))
    nMiddle = floating.interface(fem, "tip")[0][0]
    mbs.AddSensor(
        SensorSuperElement(
            name="bending", bodyNumber=link, meshNodeNumber=nMiddle, outputVariableType=shows.DisplacementLocal
        )
    )

    def control(mbs, t):
        """Set the torque that holds during this step."""
        angle, rate, acceleration = set_point(t)
        torque = P * (angle - mbs.GetSensorValues(sAngle)[2]) + D * (rate - mbs.GetSensorValues(sRate)[2])
        mbs.SetLoadParameter(lMotor, "loadVector", [0, 0, torque + INERTIA * acceleration])
        return True

    mbs.SetPreStepUserFunction(control)
    mbs.Assemble()
    simulationSettings = exu.SimulationSettings()
    simulationSettings.timeIntegration.endTime = END
    simulationSettings.timeIntegration.numberOfSteps = round(END / 1e-3) * FINER
    simulationSettings.timeIntegration.verboseMode = 0
    simulationSettings.solution.file.write = False
    mbs.SolveDynamic(simulationSettings)
    print("payload:", mbs.GetSensorValues(2))


if __name__ == "__main__":
    main()
