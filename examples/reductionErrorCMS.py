#+++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++
# This is an EXUDYN example
#
# Details:  Double pendulum of two flexible links with ObjectFFRFreducedOrder, meshed by NGsolve;
#           exudyn_romerr tells how wrong the result is: by modes that are left out, and by the step size;
#           requires ngsolve and exudyn_romerr
#
# Author:   the exudyn_romerr developers
# Date:     2026-11-29
#
# Copyright:This file is part of exudyn_romerr, BSD 3-Clause License. See 'LICENSE'.
#
#+++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++++

import exudyn as exu
from exudyn.utilities import * #includes itemInterface and rigidBodyUtilities
import exudyn.graphics as graphics #only import if it does not conflict
from exudyn.FEM import *

import numpy as np
from netgen import occ
import ngsolve as ngs
import exudyn_romerr as romerr

useGraphics = True
nModes = 6      #eigenmodes of each link; try 0 or 2
nSteps = 1000   #3000 are enough, as the report says
L = 1           #length of link
W = 0.05        #width of link

SC = exu.SystemContainer()
mbs = SC.AddSystem()

#create mesh of link with named faces:
link = occ.Box((0, -W/2, -W/2), (L, W/2, W/2))
boundaryNames = ['left', 'right']
link.faces.Min((1, 0, 0)).name = boundaryNames[0]
link.faces.Max((1, 0, 0)).name = boundaryNames[1]
link.name = 'steel'
mesh = ngs.Mesh(occ.OCCGeometry(link).GenerateMesh(maxh=W))

fem = FEMinterface()
fem.ImportMeshFromNGsolve(mesh=mesh, materials={'steel':{'youngsModulus':2e11, 'poissonsRatio':0.3, 'density':7850}},
                          boundaryNamesList=boundaryNames, meshOrder=2)
[nodesList, weightsList] = fem.GetBoundaryNodeSetsAsLists()
fem.ComputeHurtyCraigBamptonModes(boundaryNodesList=nodesList, nEigenModes=nModes, boundaryNodesWeights=weightsList,
                                  computationMode=HCBstaticModeSelection.RBE3)

link0 = mbs.CreateFFRFReducedOrderObject(name='link0', femInterface=fem, gravity=[0,0,-9.81],
                                         stiffnessProportionalDamping=1e-4)
link1 = mbs.CreateFFRFReducedOrderObject(name='link1', femInterface=fem, referencePosition=[L,0,0], gravity=[0,0,-9.81],
                                         stiffnessProportionalDamping=1e-4)

oGround = mbs.CreateGround(graphicsDataList=[graphics.CheckerBoard(point=[0,0,-2.5], size=8, normal=[0,0,1])])
mbs.CreateSphericalJoint(itemNumbers=[link0['link0:left'], oGround], jointRadius=W/4)
mbs.CreateSphericalJoint(itemNumbers=[link0['link0:right'], link1['link1:left']], jointRadius=W/4)

#deformation of the second link at its free end:
nTip = fem.GetNodeAtPoint([L, W/2, W/2])
mbs.AddSensor(SensorSuperElement(name='tip', bodyNumber=link1['FFRFReducedOrderObjectDict']['oFFRFreducedOrder'], meshNodeNumber=nTip, storeInternal=True,
                                 outputVariableType=exu.OutputVariableType.DisplacementLocal))

#two lines for the error: which FE model is behind each body, and what to watch
flexBodies = [romerr.floating_body(fem, link) for link in [link0, link1]]
monitor = romerr.attach(mbs, flexBodies)

mbs.Assemble()
simulationSettings = exu.SimulationSettings() #takes currently set values or default values
simulationSettings.timeIntegration.numberOfSteps = nSteps
simulationSettings.timeIntegration.endTime = 0.5
simulationSettings.solution.file.write = useGraphics

mbs.SolveDynamic(simulationSettings)

report = monitor.report()
print(report) #answer, what to do, and error of each sensor
if useGraphics:
    report.plot('tipError.png')
    mbs.SolutionViewer()
