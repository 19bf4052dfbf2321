"""A flexible body from a geometry: meshed by ngsolve, reduced by Exudyn, bounded while it is shaken.

    python examples/fe_ngsolve.py     prints the bounds (10 s)

Needs ngsolve: pip install ngsolve, or pip install '.[mesh]' in the checkout.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from exudyn.FEM import FEMinterface, HCBstaticModeSelection, KirchhoffMaterial

import exudyn_romerr as romerr

STEEL = {"density": 7850.0, "youngsModulus": 210e9, "poissonsRatio": 0.3}
LENGTH, RADIUS, HOLE = 0.3, 0.02, 0.008  # m, of a rod with a hole across


def import_ngsolve():
    """Return netgen.occ and ngsolve; SystemExit says how to get them."""
    try:
        import netgen.occ as occ
        import ngsolve
    except ImportError as error:
        raise SystemExit("this example needs ngsolve: pip install ngsolve") from error
    return occ, ngsolve


def mesh_rod(mesh_size: float) -> FEMinterface:
    """Return the rod along x in quadratic tetrahedra."""
    occ, ngsolve = import_ngsolve()
    rod = occ.Cylinder(occ.Pnt(0, 0, 0), occ.X, r=RADIUS, h=LENGTH)
    shape = rod - occ.Cylinder(occ.Pnt(LENGTH / 3, -RADIUS, 0), occ.Y, r=HOLE, h=2 * RADIUS)
    fem = FEMinterface()
    fem.ImportMeshFromNGsolve(
        ngsolve.Mesh(occ.OCCGeometry(shape).GenerateMesh(maxh=mesh_size, curvaturesafety=0.7)), meshOrder=2, **STEEL
    )
    return fem


def main(mesh_size: float = 0.03, t_end: float = 0.01) -> romerr.BoundReport:
    """Clamp the left face, shake the right one, print and return the bounds."""
    fem = mesh_rod(mesh_size)
    left, right = (fem.GetNodesInPlane([x, 0, 0], [1, 0, 0]) for x in (0, LENGTH))
    # the first interface is the held one; RBE2 keeps it rigid, so all its nodes stand still
    fem.ComputeHurtyCraigBamptonModes([left, right], 8, computationMode=HCBstaticModeSelection.RBE2)
    held = (3 * np.array(left)[:, None] + np.arange(3)).ravel()
    body = romerr.ElasticBody.from_fem(fem, rayleigh=(2.0, 1e-6), fixed=held)

    pull = np.zeros((fem.NumberOfNodes(), 3))
    pull[right, 2] = fem.GetNodeWeightsFromSurfaceAreas(right)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    flex = romerr.add_reduced_body(
        mbs,
        body,
        romerr.Basis(fem.modeBasis["matrix"]),
        inputs=pull.reshape(-1, 1),
        input_function=lambda t: 500 * np.sin(1000 * t),  # N
    )
    where = fem.GetNodePositionsAsArray()
    hole = int(np.argmin(np.linalg.norm(where - [LENGTH / 3, -RADIUS, HOLE], axis=1)))
    steel = KirchhoffMaterial(STEEL["youngsModulus"], STEEL["poissonsRatio"])
    outputs = [
        romerr.mean_displacement("right face z", nodes=right, component="z", unit="m"),
        romerr.node_stress("stress at the hole", node=hole, fem=fem, material=steel, component="xx", unit="Pa"),
    ]
    monitor = romerr.attach(mbs, flex, outputs=outputs, auxiliary_modes=100)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = t_end, round(t_end / 2e-5)
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    mbs.SolveDynamic(settings)
    print(f"{body.N} coordinates, {body.total_mass:.3f} kg, {fem.modeBasis['matrix'].shape[1]} modes")
    print(monitor.report())
    return monitor.report()


if __name__ == "__main__":
    main()
