"""Write the linear bar of models/floating.py as Abaqus would: models/data/abaqus_bar.inp, _MASS1.mtx, _STIF1.mtx.

The .inp is one that Abaqus reads; its last lines are those that let Abaqus write the two matrices, text with a line
"row column value" for each entry, counted from 1. Here the matrices come from models/data/floating_bar.npz instead.

    python models/make_abaqus_files.py [FOLDER]     (default: models/data)
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

os.environ.setdefault("EXUDYN_SUPPRESS_UI_WINDOW_OPEN", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from scipy import sparse

from models import floating
from models.beam3d import STEEL

NAME = "abaqus_bar"
HEAD = "*Heading\nbar of models/floating.py, m, kg, s\n*Part, name=bar\n*Node\n"
TAIL = """*Elset, elset=all, generate
 1, {count}, 1
*Solid Section, elset=all, material=steel
,
*End Part
*Assembly, name=assembly
*Instance, name=bar-1, part=bar
*End Instance
*End Assembly
*Material, name=steel
*Density
{density:g},
*Elastic
{modulus:g}, {ratio:g}
*Step, name=matrices
*Matrix Generate, stiffness, mass
*Matrix Output, stiffness, mass, format=coordinate
*End Step
"""


def input_file(nodes: np.ndarray, tets: np.ndarray) -> str:
    """Return the text of the .inp; tets (e, 4) count nodes from 0."""
    # netgen's first three corners turn clockwise seen from the fourth, Abaqus wants them the other way round
    clockwise = np.linalg.det(nodes[tets[:, 1:]] - nodes[tets[:, :1]]) < 0
    tets = np.where(clockwise[:, None], tets[:, [0, 2, 1, 3]], tets)
    lines = [f"{i:7d}, " + ", ".join(repr(float(x)) for x in node) for i, node in enumerate(nodes, start=1)]
    lines += ["*Element, type=C3D4"]
    lines += [", ".join(map(str, [i, *corners])) for i, corners in enumerate(tets + 1, start=1)]
    steel = {"density": STEEL.density, "modulus": STEEL.youngs_modulus, "ratio": STEEL.poisson_ratio}
    return HEAD + "\n".join(lines) + "\n" + TAIL.format(count=len(tets), **steel)


def coordinates(matrix: sparse.spmatrix) -> str:
    """Return the text of a .mtx: both triangles, as Abaqus writes them."""
    entries = sparse.coo_matrix(matrix)
    rows = zip(entries.row + 1, entries.col + 1, entries.data, strict=True)
    return "".join(f"{i} {j}  {value:.15e}\n" for i, j, value in rows)


def main(folder: str | Path = floating.DATA) -> None:
    """Write the three files and print their sizes."""
    fem = floating.load_fem("bar")
    texts = {
        ".inp": input_file(fem.GetNodePositionsAsArray(), fem.elements[0]["Tet4"]),
        "_MASS1.mtx": coordinates(fem.massMatrix),
        "_STIF1.mtx": coordinates(fem.stiffnessMatrix),
    }
    for end, text in texts.items():
        path = Path(folder) / (NAME + end)
        path.write_text(text, encoding="ascii")
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(*sys.argv[1:2])
