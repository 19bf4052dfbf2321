"""A flexible body from two matrices in files, no mesh, no FEMinterface: Matrix Market and scipy's npz.

    python examples/fe_matrices.py     writes two files into a temporary folder, reads them, prints the bounds (2 s)

The matrices are those of models/floating.py's bar; any symmetric ones do, of shells and beams too.
"""

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import exudyn as exu
import numpy as np
from scipy import sparse
from scipy.io import mmread, mmwrite

import exudyn_romerr as romerr
from models import floating


def write_matrices(mass: sparse.spmatrix, stiffness: sparse.spmatrix, folder: Path) -> None:
    """Write mass.mtx (Matrix Market) and stiffness.npz (scipy.sparse.save_npz)."""
    mmwrite(folder / "mass.mtx", sparse.coo_matrix(mass), precision=17)
    sparse.save_npz(folder / "stiffness.npz", stiffness)


def main(t_end: float = 0.02) -> romerr.BoundReport:
    """Read both matrices, hold one end, load the other, reduce to 6 vectors; print and return the bounds."""
    fem = floating.load_fem("bar")  # stands for the FE program
    with tempfile.TemporaryDirectory() as name:
        write_matrices(fem.massMatrix, fem.stiffnessMatrix, Path(name))
        M, K = mmread(Path(name) / "mass.mtx"), sparse.load_npz(Path(name) / "stiffness.npz")

    held = floating.interface(fem, "left")[0]  # node numbers; yours come from the FE program
    tip = 3 * int(floating.interface(fem, "tip")[0][0]) + 2  # coordinate: 3 a node, z is the last
    fixed = (3 * held[:, None] + np.arange(3)).ravel()
    body = romerr.ElasticBody(M, K, rayleigh=floating.RAYLEIGH, fixed=fixed)

    B = np.zeros((body.N, 1))
    B[tip] = 1.0
    basis = romerr.krylov_basis(body, B, 6)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    flex = romerr.add_reduced_body(mbs, body, basis, inputs=B, input_function=lambda t: 200 * np.sin(400 * t))
    monitor = romerr.attach(mbs, flex, outputs=[romerr.Output("tip z", B.T, unit="m")])
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = t_end, round(t_end / 5e-5)
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    mbs.SolveDynamic(settings)
    print(monitor.report())
    return monitor.report()


if __name__ == "__main__":
    main()
