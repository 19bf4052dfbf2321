"""mode_table: which coordinate of a reduced body is which, what it is worth, and what it does in a run."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...basis.basis import Basis
from ...checks import check_type
from ...errors import InputError, RomErrError
from ...mode_selection.mode_table import (
    MORE,
    Frequencies,
    ModeTable,
    coordinates_of,
    frequencies_of,
    missed_modes,
    residual_share,
)
from ...mode_selection.without_modes import InRun
from ...model.body import ElasticBody
from ..access.reduced_body import ReducedBody
from ..floating.floating_body import FloatingBody
from ..floating.mode_kinds import kinds
from ..floating.reference_search import find_reference, held_body

if TYPE_CHECKING:
    from ...report.report import BoundReport

NOT_HELD = "Not compared with the full model: {}."
NO_DAMPING = "Damping is not known: the body was not read from its mbs, as a solve does that is watched."
NO_RUN = (
    "What modes do in the run is not known: the report was loaded, or is of a body alone in a frame that it does not "
    "move; romerr modes tells it."
)
EIGENMODE = 1e-6  # of K x - omega^2 M x: what solvers leave of an eigenmode is less


def mode_table(
    flex: FloatingBody | ReducedBody | ElasticBody, report: BoundReport | None = None, *, basis: Basis | None = None
) -> ModeTable:
    """Tell of each coordinate of a reduced body what it is: static mode of which interface and direction, eigenmode.

    Beside it: frequency, damping ratio and effective mass; frequencies of the reduced body with how far they are off
    those of the full one at most; modes that the basis lacks.

    Parameters
    ----------
    flex : FloatingBody, ReducedBody or ElasticBody
        As made by floating_body or add_reduced_body; or a full body, with basis=.
    report : BoundReport, optional
        Of a run of this body in a mechanism: adds shares of the strain energy, and what the error of each sensor
        would grow by without a mode.
    basis : Basis
        Of an ElasticBody.

    Returns
    -------
    ModeTable

    Raises
    ------
    InputError
        No body; a basis that is missing or does not fit; a fem without modes; a report of other bodies.

    Notes
    -----
    Effective mass: of the part of a mode that those before it do not span, so that the sum over a complete basis is
    the body's mass less what its supports carry; free eigenmodes have none. Does not cover: floating bodies whose
    frame follows the modes (excludeRigidBodyMotion=False), which are not compared with the full model.
    """
    if isinstance(flex, FloatingBody):
        return _of_floating(flex, report)
    if isinstance(flex, ReducedBody):
        flex, basis = flex.body, flex.basis
    check_type("flex", flex, ElasticBody)
    check_type("basis", basis, Basis)
    if report is not None:
        raise InputError("report= is for floating bodies; reports of linear ones keep no coordinates of the run")
    return _of_linear(flex, basis)


def _of_linear(body: ElasticBody, basis: Basis) -> ModeTable:
    V, W = basis.restricted_to(body)
    damping = [np.zeros((basis.n, basis.n)) if body.D is None else X.T @ (body.D @ V) for X in (V, W)]
    directions = None
    if body.positions is not None:
        directions = np.tile(np.eye(body.dofs_per_node)[:, :3], (len(body.positions), 1))
    found = coordinates_of(basis.V, body.mass, body.stiffness, damping[0], directions)
    modes, left = frequencies_of(body, V, W, damping[1]), residual_share(body, V, found.omega)
    named = [f"eigenmode at {x / (2 * np.pi):.4g} Hz" for x in found.omega]
    named = [name if x < EIGENMODE else "vector" for name, x in zip(named, left, strict=True)]
    return ModeTable("linear body", named, f"{basis.n} coordinates: {basis.note}", found, modes, None, ())


def _of_floating(flex: FloatingBody, report: BoundReport | None) -> ModeTable:
    numbers, rayleigh = flex.known.get("reduction", (None, (0.0, 0.0)))
    V, D = ((flex.fem.modeBasis or {}).get("matrix"), None) if numbers is None else (numbers[0], numbers[-1])
    if np.shape(V)[:1] != (flex.mass.shape[0],):
        raise InputError(f"fem has no modes of its {flex.mass.shape[0]} coordinates; compute them before mode_table")
    run = None if report is None or report.modes is None else _in_run(flex, report, V)
    modes, notes = None, [NO_DAMPING] if D is None else []
    notes += [NO_RUN] if run is None and report is not None else []
    try:
        modes = _frequencies(flex, V, D, rayleigh, run)
    except RomErrError as error:
        notes.append(NOT_HELD.format(str(error).rstrip(".")))
    found = coordinates_of(V, flex.mass, flex.stiffness, D, np.tile(np.eye(3), (len(flex.positions), 1)))
    return ModeTable(f"body {flex.number}", *kinds(flex, V), found, modes, run, notes)


def _in_run(flex: FloatingBody, report: BoundReport, V: np.ndarray) -> InRun:
    """What the modes do in the run of a report, of the sensors that it has."""
    found = report.modes.in_run
    own = found.get(flex.number)
    if own is None or len(own.energy) != V.shape[1]:
        raise InputError(
            f"report is of bodies {', '.join(map(str, found))}, not of body {flex.number} with {V.shape[1]} modes"
        )
    return replace(own, sensors={name: x for name, x in own.sensors.items() if name in report.outputs})


def _frequencies(
    flex: FloatingBody, V: np.ndarray, D: np.ndarray | None, rayleigh: tuple[float, float], run: InRun | None
) -> Frequencies:
    """Frequencies of the body as it is held in its frame, by what was found of it in an mbs, if it was read."""
    reference = find_reference(flex, V, flex.known.get("interfaces", {}))
    held = held_body(flex, rayleigh, reference)
    own = held.space.coordinates("V", V if reference.held is None else reference.held)
    found = frequencies_of(held, own, own, D)
    if run is None or not np.any(run.squares):
        return found
    vectors = held.space.coordinates("vectors", run.vectors)
    return replace(found, missed=missed_modes(held, V.shape[1] + MORE, vectors, run.squares))
