"""evaluate: bounds of a stored trajectory, without Exudyn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...basis.basis import Basis
from ...basis.second_order_model import from_pymor, is_of_pymor
from ...checks import check_array, check_type, real_array
from ...errors import InputError
from ...model.body import ElasticBody
from ...model.matrix_checks import precision
from ...model.outputs import Output
from ...process.blas_threads import one_thread
from ...report.report import BoundReport
from ..residual.samples import check_increasing
from .prepare import BoundOptions, prepare
from .run import BLOCK, Run


@dataclass
class Trajectory:
    """A reduced trajectory: t (T,), q, q_t, q_tt (T, n) and inputs u (T, p) (None: no inputs).

    In single precision it is computed with in double; `precision` is the relative spacing of its numbers.

    Raises
    ------
    InputError
        Shapes that differ, nan or inf, time that does not increase, fewer than one sample.
    """

    t: Any
    q: Any
    q_t: Any
    q_tt: Any
    u: Any = None

    def __post_init__(self) -> None:
        self.precision = max(map(precision, (self.q, self.q_t, self.q_tt, self.u)))
        self.t = check_array("t", self.t, (None,))
        if self.t.size == 0:
            raise InputError("t is empty; a trajectory has at least one sample")
        check_increasing(self.t)
        self.q = check_array("q", self.q, (len(self.t), None))
        self.q_t, self.q_tt = (
            check_array(name, x, self.q.shape) for name, x in (("q_t", self.q_t), ("q_tt", self.q_tt))
        )
        u = np.zeros((len(self.t), 0)) if self.u is None else real_array("u", self.u)
        self.u = check_array("u", u[:, None] if u.ndim == 1 else u, (len(self.t), None))


@one_thread()
def evaluate(
    body: ElasticBody | Any,
    basis: Basis | Any,
    traj: Trajectory,
    *,
    inputs: Any = None,
    outputs: Sequence[Output] = (),
    input_function: Callable | None = None,
    initial: Any = None,
    jumps: ArrayLike = (),
    estimators: Any = "auto",
    residual: str = "orthonormal",
    kernels: str = "certified",
    time: str = "reconstructed",
    auxiliary_modes: int | str = "auto",
) -> BoundReport:
    """Bound the error of a stored reduced trajectory: |q - V qr|_M and |C q - C V qr| at every sample.

    Parameters
    ----------
    body, basis
        Or a SecondOrderModel of pyMOR and what reduced it, see from_pymor; inputs and outputs are then the model's
        where none are given.
    traj : Trajectory
        Reduced coordinates and inputs at the samples.
    inputs : ndarray, (N, p), optional
        Input matrix B; the inputs themselves are traj.u.
    outputs : sequence of Output
    input_function : callable, optional
        f(t) -> (p,), or a float if p = 1: the inputs between the samples; replaces traj.u. Needed with jumps. Without
        it the inputs are taken as linear between samples, and the report says so.
    initial : None, (q0, q0_t) or "equilibrium"
        State the full body starts in: the span of V, two (N,) arrays, or its own static equilibrium.
    jumps : sequence of float
        Times in s at which the inputs jump.
    estimators : "auto" or sequence of str
        Some of "state-space", "fast", "convolution", "energy", "auxiliary". "auto": "energy", and
        "auxiliary" if damping is Rayleigh or none.
    residual : {"orthonormal", "direct", "expanded"}
    kernels : {"certified", "spectrum", "envelope"}
    time : {"reconstructed", "sampled"}
        "reconstructed": a twice differentiable trajectory through the samples is bounded, the error of the time
        integration included. "sampled": the residual at the samples, piecewise linear between them; the error of the
        time integration is not covered.
    auxiliary_modes : int or "auto"
        Modes of the full body carried by "auxiliary". "auto": as many as leave 5 % of |C|_{K^-1} above them, at most
        60, or as the reduced body rings in, at most 200.

    Returns
    -------
    BoundReport

    Raises
    ------
    InputError
        Wrong shapes, names or values.
    AssumptionError
        An assumption of the estimator or kernel asked for does not hold for this body.

    Notes
    -----
    Source: docs/theory.md; paper (11), (25)-(30). Does not cover: loads that are not in inputs.
    """
    if is_of_pymor(body):
        body, basis, B, shown = from_pymor(body, basis)
        inputs, outputs = B if inputs is None else inputs, outputs or shown
    options = BoundOptions.of(locals())
    check_type("traj", traj, Trajectory)
    offline = prepare(body, basis, options, sampled_inputs=True, samples_precision=traj.precision)
    run = Run(offline)
    u = [traj.u] if offline.signal is None else [None]
    run.start(traj.t[0], traj.q[0], traj.q_t[0], traj.q_tt[0], *(x if x is None else x[0] for x in u))
    for first in range(1, len(traj.t), BLOCK):
        part = slice(first, first + BLOCK)
        run.extend(*(x if x is None else x[part] for x in (traj.t, traj.q, traj.q_t, traj.q_tt, *u)))
    return run.report()
