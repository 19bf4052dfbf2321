"""evaluate_file: bounds of a finished run, from its solution file."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from exudyn.utilities import LoadSolutionFile
from numpy.typing import ArrayLike

from ...errors import InputError, RunError
from ...linear.run.prepare import BoundOptions
from ..floating.moving_subject import OF_A_FILE
from ..monitoring.attach import make_subject
from ..monitoring.body_monitor import MonitoredBody
from ..monitoring.step_hook import block_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...model.outputs import Output
    from ...report.report import BoundReport
    from ..access.reduced_body import ReducedBody
    from ..floating.floating_body import FloatingBody

DIGITS = 15  # significant ones of a text file; fewer are too few for the differences of accelerations
PROBED = 20  # rows of a text file looked at for their digits


def evaluate_file(
    mbs: Any,
    flex: ReducedBody | FloatingBody,
    path: str | os.PathLike,
    *,
    outputs: Sequence[Output | int] | None = None,
    initial: Any = None,
    jumps: ArrayLike = (),
    estimators: Any = "auto",
    residual: str = "orthonormal",
    kernels: str = "certified",
    time: str = "reconstructed",
    auxiliary_modes: int | str = "auto",
) -> BoundReport:
    """Bound the error of a finished dynamic run from its solution file: the bounds that attach gives alongside.

    Parameters
    ----------
    mbs : exudyn MainSystem
        The assembled model that the file was written with: joints and loads are read from it.
    flex : ReducedBody or FloatingBody
    path : str
        Written with simulationSettings.solution.file.writePeriod = 0 (every step), velocities and accelerations
        exported (the default), and file.binary = True, or solution.precision = 17 for a text file.
    outputs, initial, jumps, estimators, residual, kernels, time, auxiliary_modes
        As in attach.

    Returns
    -------
    BoundReport

    Raises
    ------
    InputError
        No such file, one of another model, without accelerations, or of too few digits; wrong options.
    AssumptionError
        As in attach.
    RunError
        mbs.Assemble() was not called.

    Notes
    -----
    Does not cover: steps that were not written. A file of every second step is a trajectory of twice the step size.
    """
    options = BoundOptions.of(locals())
    if not getattr(mbs, "systemIsConsistent", True):
        raise RunError("evaluate_file was called before mbs.Assemble(); call it first")
    watch = MonitoredBody(make_subject(mbs, flex, options, OF_A_FILE, alone=False), {})
    rows = read_solution(path, mbs.systemData.ODE2Size())
    watch.begin(mbs, static=False)
    length = block_rows(mbs.systemData.ODE2Size())
    for first, end in [(0, 1), *((i, i + length) for i in range(1, len(rows[0]), length))]:
        watch.take(*(x[first:end] for x in rows))
    if watch.error is not None:
        raise watch.error
    return watch.runs[-1].report()


def read_solution(path: str | os.PathLike, size: int) -> tuple[np.ndarray, ...]:
    """Return t (S,) and q, q_t, q_tt (S, size) of a solution file; InputError if they are not all there."""
    if not os.path.isfile(path):
        raise InputError(
            f"{path} is no file; pass the name in simulationSettings.solution.file.name, with its ending"
        )
    try:
        solution = LoadSolutionFile(os.fspath(path), verbose=False)
        data, exported = np.atleast_2d(solution["data"]), [int(n) for n in solution["columnsExported"][:3]]
    except Exception as error:  # whatever Exudyn's reader meets in a file that is none of its own
        raise InputError(f"{path} is no solution file of Exudyn, or it is truncated: {error}") from error
    if exported[0] != size:
        raise InputError(f"{path} has {exported[0]} ODE2 coordinates, the mbs {size}: it is of another model")
    if exported != [size] * 3:
        raise InputError(
            f"{path} lacks velocities or accelerations (columns {exported}); set "
            "simulationSettings.solution.file.export.velocities and .accelerations to True and run again"
        )
    _check_digits(path)
    return data[:, 0], *(data[:, 1 + i * size : 1 + (i + 1) * size] for i in range(3))


def _check_digits(path: str | os.PathLike) -> None:
    """Refuse text files whose longest numbers show that digits were cut off."""
    with open(path, "rb") as stream:
        lines = [line for line in stream.read(200_000).split(b"\n") if not line.startswith(b"#")][:PROBED]
    if b"\0" in b"".join(lines):  # binary: all digits
        return
    longest = max(
        (
            len(number.split(b"e")[0].lstrip(b"-0.").replace(b".", b""))
            for line in lines
            for number in line.split(b",")
        ),
        default=DIGITS,
    )
    if longest < DIGITS:
        raise InputError(
            f"{path} has numbers of {longest} digits, too few for a residual; write it with "
            "simulationSettings.solution.precision = 17, or file.binary = True"
        )
