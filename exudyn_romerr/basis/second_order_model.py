"""from_pymor: body, basis, inputs and outputs of a SecondOrderModel of pyMOR and what reduced it.

pyMOR is imported once its objects come in, never before.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from ..checks import check_type, real_array
from ..errors import AssumptionError, InputError
from ..model.body import ElasticBody
from ..model.outputs import Output
from .basis import Basis

ROUNDED = 1e-12  # of sqrt(E_ii E_jj), in entry ij: above what alpha M + beta K in double precision leaves


class SecondOrder(NamedTuple):
    """What `evaluate` and `frequency_response` take of a SecondOrderModel.

    inputs (N, p) : B. outputs : "y" with the rows of Cp, "y_t" with those of Cv; their labels count rows of the
    model's output from 0.
    """

    body: ElasticBody
    basis: Basis
    inputs: np.ndarray
    outputs: tuple[Output, ...]


def is_of_pymor(model: Any) -> bool:
    """Whether an object is of a class of pyMOR, or of one that inherits from it."""
    return any(kind.__module__.partition(".")[0] == "pymor" for kind in type(model).__mro__)


def from_pymor(model: Any, reduced_by: Any) -> SecondOrder:
    """Return body, basis, inputs and outputs of M x'' + E x' + K x = B u, y = Cp x + Cv x', and of its reduction.

    Parameters
    ----------
    model : pymor.models.iosys.SecondOrderModel
        E zero, Rayleigh's alpha M + beta K (to 1e-12), or any dissipative damping.
    reduced_by : reductor, VectorArray or Basis
        A reductor of pyMOR after its reduce(), such as SOBTpReductor, SOBTfvReductor, SOBHIReductor or
        SOLTIPGReductor, with W = V or not; or V alone, with W = V.

    Raises
    ------
    InputError
        What is no SecondOrderModel, or no bases V and W of it; a reductor of another model; matrices that are not
        symmetric.
    AssumptionError
        Discrete time, parameters, a feedthrough D, outputs that mix displacements and velocities in a row, bases of
        the first-order form; a singular K, or damping that feeds energy in.

    Notes
    -----
    Does not cover: SOBTReductor, which has bases of its own for displacements and velocities; bases that a reductor
    holds but its reduced model was cut from; initial data.
    """
    from pymor.algorithms.to_matrix import to_matrix
    from pymor.models.iosys import SecondOrderModel

    check_type("model", model, SecondOrderModel)
    if model.sampling_time > 0:
        raise AssumptionError(f"model has sampling_time={model.sampling_time:g}; needed: 0, continuous time")
    if model.parametric:
        raise AssumptionError("model has parameters; needed: one of a fixed mu, its operators assembled")
    M, E, K, B, Cp, Cv = (to_matrix(getattr(model, name)) for name in ("M", "E", "K", "B", "Cp", "Cv"))
    if abs(to_matrix(model.D)).max():
        raise AssumptionError("model has a feedthrough D; its error is zero: take it out, and add D u to y")
    body = ElasticBody(M, K, **damping(M, E, K))
    return SecondOrder(body, basis_of(model, reduced_by), real_array("B", B), outputs_of(Cp, Cv))


def damping(M: Any, E: Any, K: Any) -> dict[str, Any]:
    """Return E as ElasticBody takes it: alpha and beta where it is Rayleigh's, to ROUNDED."""
    E = sp.csc_matrix(E)
    if not abs(E).max():
        return {}
    if E.diagonal().min() > 0:
        scale = sp.diags(E.diagonal() ** -0.5)  # no coordinate counts more than another, whatever its unit
        terms, of_E = [(scale @ sp.csc_matrix(x) @ scale) for x in (M, K)], scale @ E @ scale
        for kept in ([0], [1], [0, 1]):
            ratios = np.zeros(2)
            ratios[kept] = fitted([terms[i] for i in kept], of_E)
            left = of_E - ratios[0] * terms[0] - ratios[1] * terms[1]
            if min(ratios) >= 0 and abs(left).max() <= ROUNDED:
                return {"rayleigh": tuple(ratios.tolist())}
    return {"damping": E}


def fitted(terms: list[sp.csc_matrix], total: sp.csc_matrix) -> np.ndarray:
    """Return factors of the terms whose sum is closest to the total, in Frobenius' norm."""
    gram = np.array([[a.multiply(b).sum() for b in terms] for a in terms])
    size = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))  # a matrix of zeros is refused later
    seen = np.array([a.multiply(total).sum() for a in terms])
    return np.linalg.lstsq(gram / np.outer(size, size), seen / size, rcond=None)[0] / size


def basis_of(model: Any, reduced_by: Any) -> Basis:
    """Return the projection."""
    from pymor.vectorarrays.interface import VectorArray

    if isinstance(reduced_by, Basis):
        return reduced_by
    note = type(reduced_by).__name__
    bases = getattr(reduced_by, "bases", None) or {name: getattr(reduced_by, name, None) for name in "VW"}
    V, W = (reduced_by, reduced_by) if isinstance(reduced_by, VectorArray) else (bases.get(name) for name in "VW")
    if not isinstance(V, VectorArray) or not isinstance(W, VectorArray):
        raise InputError(
            f"reduced_by is a {note} without bases V and W; needed: a reductor of a SecondOrderModel that has them, "
            "after its reduce(), or V itself. A reduced model does not keep them; SOBTReductor has two of each"
        )
    if getattr(reduced_by, "fom", model) is not model:
        raise InputError(f"{note} reduced another model; pass the one that it was made with, {note}.fom")
    if V not in model.solution_space or W not in model.solution_space:
        raise AssumptionError(f"V has {V.dim} rows, the model {model.order}; needed: bases of its second-order form")
    return Basis(V.to_numpy(), None if W is V else W.to_numpy(), note=f"pyMOR, {note}, {len(V)} columns")


def outputs_of(Cp: Any, Cv: Any) -> tuple[Output, ...]:
    """Return outputs "y" of displacements and "y_t" of velocities; rows of zeros are displacements."""
    Cp, Cv = real_array("Cp", Cp), real_array("Cv", Cv)
    is_velocity = Cv.any(axis=1)
    mixed = np.flatnonzero(is_velocity & Cp.any(axis=1))
    if mixed.size:
        raise AssumptionError(
            f"row {mixed[0]} of the output has entries in Cp and Cv; needed: displacements or velocities in a row"
        )
    found = []
    for name, of, C, rows in (("y", "displacement", Cp, ~is_velocity), ("y_t", "velocity", Cv, is_velocity)):
        if rows.any():
            labels = tuple(f"row {i}" for i in np.flatnonzero(rows))
            found.append(Output(name, C[rows], of=of, labels=labels))
    return tuple(found)
