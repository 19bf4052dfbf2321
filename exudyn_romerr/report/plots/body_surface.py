"""Picture of a body: its deformed mesh, coloured by the displacement's error at every node, or the bound of it."""

from __future__ import annotations

import os
from collections.abc import Callable
from itertools import combinations
from textwrap import fill
from typing import Any

import numpy as np

from ...checks import check_array, check_choice, check_nodes
from ...errors import InputError
from ..data import ReportData
from ..scope import NOT_CERTIFIED
from ..wording import axis_label, digits, error_kind, instant, not_certified, rounded_up, sharpest_at_nodes, under
from .style import COLOURS, THIN, WIDE, largest_finite, picture

SHOWN = 0.05  # of the body's size: how large the largest displacement is drawn
TICKS = 5  # along the longest edge
LABELPAD = 8  # points, from the ticks
TITLE = 80  # letters in a line of a title
ZOOM = 1.05  # matplotlib leaves room around the box: parts are not clipped where they need it
THINNEST = 0.05  # of the longest edge: how thin the box around a flat or straight body may be
TETRAHEDRA = (4, 10)  # nodes
EDGE = (0.0, 0.0, 0.0, 0.3)  # of faces: without light it is the mesh that shows the shape
FINE = 20_000  # faces: of more one would see their edges only
MAP = "viridis"  # even in lightness: as good in grey print and for the colour-blind


def plot_body(report: ReportData, mesh: Any, path: str | os.PathLike | None = None, **options: Any) -> Any:
    """Draw draw_body's picture with its options; save it to path if given, return the figure."""
    return picture(draw_body, path, report, mesh, projection="3d", **options)


def draw_body(
    ax: Any,
    report: ReportData,
    mesh: Any,
    displacement: Callable[[int], Any] | None = None,
    estimator: str | None = None,
    unit: str = "",
) -> None:
    """Draw the body, coloured by the bound of the displacement's error at every node, at the worst instant.

    In a mechanism, which has no such bounds, by the estimated error of modes and interfaces, seen from the frame.

    Parameters
    ----------
    ax : mpl_toolkits.mplot3d.axes3d.Axes3D
    report : BoundReport
    mesh : FEMinterface, or (positions, elements)
        Exudyn's fem, whose surface triangles are drawn; or positions (nodes, 3) with elements (e, 2), lines of beams,
        (e, 3), triangles of a surface, (e, 4 or 10), tetrahedra, or None: nodes alone.
    displacement : callable, optional
        Number of an instant of the report -> displacements (nodes, 3) there. Default: the mesh as it is; in a
        mechanism as the error deforms it.
    estimator : str, optional
        Default: of those whose scope covers most the one whose largest bound is smallest.
    unit : str
        Of lengths; "": not known.

    Raises
    ------
    InputError
        A report that knows nothing at nodes, an unknown estimator, a mesh of another number of nodes, or without
        surface.

    Notes
    -----
    A face or line has the colour of its worst node, orange if the bound there is infinite. Beams that are drawn
    deformed have the undeformed ones beside them, dashed.
    """
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    e = estimator or sharpest_at_nodes(report)
    nodes = report.at_nodes()
    is_bound = bool(nodes.bound)
    check_choice("estimator", e, nodes.bound if is_bound else nodes.estimate)
    bound = nodes.bound[e] if is_bound else np.linalg.norm(nodes.estimate[e], axis=1)
    at = int(np.argmax(report.position_bound[e]) if is_bound else np.abs(report.t - nodes.instant[e]).argmin())
    positions, cells = _mesh(mesh, len(bound))
    by_error = None if is_bound else nodes.estimate[e]
    moved, scale = _moved(positions, by_error if displacement is None else displacement(at))
    if scale is not None and cells.shape[1] == 2:
        ax.add_collection3d(Line3DCollection(positions[cells], colors="#999999", linewidths=THIN, linestyles="--"))
    parts = _coloured(ax, moved, cells, bound[cells].max(axis=1))
    _frame(ax, moved, unit)
    bar = ax.figure.colorbar(parts, ax=ax, shrink=0.7, pad=0.08)
    doubt, what = f" ({NOT_CERTIFIED})" if report.uncertified else "", error_kind(report.time)
    shown = f"bound{doubt} of the {what}\nby '{e}'" if is_bound else f"estimate{doubt} of the {what}"
    bar.set_label(axis_label(f"{shown}{under(report.scope, e)}", unit))
    bar.formatter.set_powerlimits((-3, 4))
    worst = f"at node {int(np.argmax(bound))}:"
    if is_bound:
        what += f" {worst} {'bounded by' if report.uncertified else 'at most'} {rounded_up(bound.max())}"
    else:
        what += f" {worst} about {digits(bound.max(), 2)}"
    drawn = "not deformed" if scale is None else f"displacements × {scale:g}"
    if displacement is None and not is_bound:
        drawn = f"as the error deforms it, × {scale:g}"
    ax.set_title(_title(report, f"{what}{unit and f' {unit}'}{under(report.scope, e)}", bound, at, drawn))


def surface_triangles(elements: Any) -> np.ndarray:
    """Return the triangles (f, 3) that one tetrahedron alone has, of elements (e, 4 or 10): corner nodes."""
    faces = np.concatenate([np.asarray(elements)[:, face] for face in combinations(range(4), 3)])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    return faces[first[count == 1]]


def _mesh(mesh: Any, nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (nodes, 3) and what is drawn: nodes (e, 1), lines (e, 2) or triangles (e, 3)."""
    if hasattr(mesh, "GetNodePositionsAsArray"):
        positions, elements = mesh.GetNodePositionsAsArray(), mesh.GetSurfaceTriangles()
        if not len(elements):
            raise InputError(
                "fem has no surface; call fem.VolumeToSurfaceElements() first, or pass (positions, elements)"
            )
    elif isinstance(mesh, tuple | list) and len(mesh) == 2:
        positions, elements = mesh
    else:
        raise InputError(f"mesh is a {type(mesh).__name__}; needed: a FEMinterface, or (positions, elements)")
    positions = check_array("positions of mesh", positions, (nodes, 3))
    if elements is None:
        return positions, np.arange(nodes)[:, None]
    elements = np.atleast_2d(elements)
    columns = elements.shape[1]
    if columns not in (2, 3, *TETRAHEDRA):
        raise InputError(
            f"elements of mesh has {columns} columns; needed: 2 (lines), 3 (triangles), 4 or 10 (tetrahedra)"
        )
    elements = check_nodes(elements.ravel(), nodes).reshape(elements.shape)
    return positions, surface_triangles(elements) if columns in TETRAHEDRA else elements


def _moved(positions: np.ndarray, displacement: Any) -> tuple[np.ndarray, float | None]:
    """Positions of the deformed mesh, and how many times too large it is drawn; None: as it is."""
    if displacement is None:
        return positions, None
    displacement = check_array("displacement", displacement, positions.shape)
    size = np.max(np.ptp(positions, axis=0), initial=0.0)
    largest = np.max(np.linalg.norm(displacement, axis=1), initial=0.0)
    if largest == 0:
        return positions, 1.0
    exact = SHOWN * size / largest
    power = 10.0 ** np.floor(np.log10(exact))  # the scale is 1, 2 or 5 times a power of ten
    scale = float(max(step for step in (1.0, 2.0, 5.0) if step * power <= exact * (1 + 1e-12)) * power)
    return positions + scale * displacement, scale


def _coloured(ax: Any, places: np.ndarray, cells: np.ndarray, bound: np.ndarray) -> Any:
    """Draw nodes, lines or triangles (e, 1, 2 or 3) in the colours of their bounds (e,)."""
    from matplotlib import colormaps
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    norm = Normalize(0.0, largest_finite(bound) or 1.0)
    style = {"cmap": colormaps[MAP].with_extremes(bad=COLOURS["error"]), "norm": norm}
    colours = np.ma.masked_invalid(bound)
    if cells.shape[1] == 1:
        return ax.scatter(*places.T, c=colours, plotnonfinite=True, depthshade=False, clip_on=False, **style)
    if cells.shape[1] == 2:
        parts = Line3DCollection(places[cells], linewidths=2 * WIDE, capstyle="round", clip_on=False, **style)
    else:
        style["edgecolor"] = EDGE if len(cells) <= FINE else "face"
        parts = Poly3DCollection(places[cells], linewidth=0.2, clip_on=False, **style)
    parts.set_array(colours)
    return ax.add_collection3d(parts)


def _frame(ax: Any, places: np.ndarray, unit: str) -> None:
    """Equal scales along all axes, with as many ticks as have room."""
    from matplotlib.ticker import MaxNLocator, NullLocator

    low, high = places.min(axis=0), places.max(axis=0)
    half = np.maximum((high - low) / 2, THINNEST * np.max(high - low)) if np.any(high > low) else np.full(3, 0.5)
    middle = (low + high) / 2
    for axis, m, d in zip("xyz", middle, half, strict=True):
        count = int(TICKS * d / np.max(half))
        ax.set(**{f"{axis}lim": (m - d, m + d)})
        getattr(ax, f"set_{axis}label")(axis_label(axis, unit), labelpad=LABELPAD if count else -LABELPAD)
        getattr(ax, f"{axis}axis").set_major_locator(MaxNLocator(count) if count else NullLocator())
    ax.set_box_aspect(half, zoom=ZOOM)


def _title(report: ReportData, what: str, bound: np.ndarray, at: int, drawn: str) -> str:
    infinite = ", orange: infinite" if np.isinf(bound).any() else ""
    why = fill(not_certified(report.uncertified), TITLE)
    when = instant(report.time, report.t[at])
    return f"{what[0].upper()}{what[1:]}{why and f'{chr(10)}({why})'}\n{when}, {drawn}{infinite}"
