"""A report over the mesh as a .vtu file, for ParaView, pyvista and meshio: VTK's XML, arrays in base64."""

from __future__ import annotations

import base64
import os
from collections.abc import Iterator
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from ...checks import check_choice
from ...errors import InputError
from ...model.solid_elements import VERTEX, cells_of
from ..data import NodeFields, ReportData
from ..wording import sharpest_at_nodes, under
from .atomic_write import write_whole

HEAD = (
    '<?xml version="1.0"?>\n'
    '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">'
)
TYPES = {"f": ("Float64", "<f8"), "i": ("Int64", "<i8"), "u": ("UInt8", "u1")}
# VTK's numbers of types of cells
CELLS = {
    VERTEX: 1,
    "Line2": 3,
    "Trig3": 5,
    "Quad4": 9,
    "Tet4": 10,
    "Hex8": 12,
    "Wedge6": 13,
    "Pyramid5": 14,
    "Trig6": 22,
    "Quad8": 23,
    "Tet10": 24,
    "Hex20": 25,
    "Wedge15": 26,
    "Pyramid13": 27,
}


def write_vtu(report: ReportData, path: str | os.PathLike, mesh: Any = None, estimator: str | None = None) -> None:
    """Write the mesh without load, and at its nodes what is known at the instant with the largest bound of |e|_M.

    "displacement" (nodes, 3) of the reduced model, in the body's frame; "error bound" (nodes,), of the length of its
    error; "error estimate" (nodes, 3), u_full - u_reduced, signed, if the estimator knows it: displacement + estimate
    is the best guess of the full model's. In a mechanism there is no bound, and the estimate is of modes and
    interfaces. Where the scope is not complete, or bounds are not certified, the names say so: "error bound, inputs
    frozen", "error bound, not certified". Field data: "TimeValue".

    Parameters
    ----------
    report : BoundReport
        Of a body with node positions; of a mechanism with several one of report.bodies.
    path : path
        Ending in .vtu.
    mesh : FEMinterface, result of read_body, or (positions, elements); optional
        For elements; (e, k) of nodes, k = 2 lines, 3 triangles, 4 or 10 tetrahedra, 8 or 20 hexahedra, or None.
        Default: nodes alone.
    estimator : str, optional
        Default: of those whose scope covers most the one whose largest bound is smallest.

    Raises
    ------
    InputError
        A report without fields at the nodes (saved before they were asked for, or by 0.1), an unknown estimator, a
        mesh with other positions, a file that cannot be written.

    Notes
    -----
    Bounds that are infinite are written as such. Does not cover: other instants, velocities, stress.
    """
    if not str(path).lower().endswith(".vtu"):
        raise InputError(f"path={str(path)!r}: ParaView knows the kind of file by its ending; pass one with .vtu")
    nodes = report.at_nodes()
    e = estimator or sharpest_at_nodes(report)
    check_choice("estimator", e, nodes.bound or nodes.estimate)
    if nodes.positions is None:
        raise InputError("this report was saved by version 0.1, which kept no positions; make it again")
    cells = cells_of(mesh, nodes.positions)
    text = "\n".join(_file(report, nodes, e, cells)).encode()
    write_whole(path, lambda stream: stream.write(text))


def _file(report: ReportData, nodes: NodeFields, e: str, cells: list[tuple[str, np.ndarray]]) -> Iterator[str]:
    condition = under(report.scope, e)
    bound = f"error bound{under(report.scope, e, report.uncertified)}"
    fields = {"displacement": nodes.displacement[e]} | ({bound: nodes.bound[e]} if nodes.bound else {})
    if e in nodes.estimate:
        fields[f"error estimate{condition}"] = nodes.estimate[e]
    count = sum(len(elements) for _, elements in cells)
    yield f"{HEAD}\n<UnstructuredGrid>\n<FieldData>"
    yield _array("TimeValue", np.array([nodes.instant[e]]), ' NumberOfTuples="1"')
    yield f'</FieldData>\n<Piece NumberOfPoints="{len(nodes.positions)}" NumberOfCells="{count}">\n<PointData>'
    yield from (_array(name, x) for name, x in fields.items())
    yield f"</PointData>\n<Points>\n{_array('Points', nodes.positions)}\n</Points>\n<Cells>"
    yield _array("connectivity", np.concatenate([elements.ravel() for _, elements in cells]).astype(int))
    lengths = np.concatenate([np.full(len(elements), elements.shape[1]) for _, elements in cells])
    yield _array("offsets", np.cumsum(lengths))
    kinds = np.concatenate([np.full(len(elements), CELLS[kind], dtype=np.uint8) for kind, elements in cells])
    yield f"{_array('types', kinds)}\n</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"


def _array(name: str, x: np.ndarray, more: str = "") -> str:
    kind, dtype = TYPES[x.dtype.kind]
    columns = f' NumberOfComponents="{x.shape[1]}"' if x.ndim == 2 else ""
    raw = np.ascontiguousarray(x, dtype=dtype).tobytes()
    text = base64.b64encode(np.array([len(raw)], dtype="<u8").tobytes() + raw).decode()
    return f'<DataArray type="{kind}" Name={quoteattr(name)}{columns}{more} format="binary">{text}</DataArray>'
