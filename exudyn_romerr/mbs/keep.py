"""keep_modes: some of the eigenmodes of a FEMinterface."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..errors import InputError, check_numbers


def keep_modes(fem: Any, modes: Iterable[int]) -> None:
    """Drop all eigenmodes of fem.modeBasis but some; static modes stay.

    Parameters
    ----------
    fem : exudyn.FEM.FEMinterface
        With modes of ComputeHurtyCraigBamptonModes or ComputeEigenmodes: static modes first, if any, then the
        eigenmodes that fem.eigenValues belong to.
    modes : sequence of int
        Numbers of the eigenmodes to keep, from 0, as choose_modes(..., pick=True) passes them to build.

    Raises
    ------
    InputError
        No modes yet, numbers that are not there, or stress modes that would no longer fit.
    """
    if not isinstance(getattr(fem, "modeBasis", None), dict) or "matrix" not in fem.modeBasis:
        raise InputError("fem has no modes; compute them before keep_modes")
    if np.size(getattr(fem, "postProcessingModes", {}).get("matrix", ())):
        raise InputError("fem has post-processing modes of all modes; compute them after keep_modes")
    V, values = fem.modeBasis["matrix"], np.asarray(fem.eigenValues, dtype=float)
    kept = np.unique(check_numbers("modes", list(modes)))
    wrong = kept[~np.isin(kept, np.arange(len(values)))]
    if wrong.size:
        raise InputError(f"modes lists {wrong[0]:g}; allowed: numbers 0..{len(values) - 1} of the fem's eigenmodes")
    kept, always = kept.astype(int), V.shape[1] - len(values)
    fem.modeBasis = {**fem.modeBasis, "matrix": V[:, [*range(always), *(always + kept)]]}
    fem.eigenValues = values[kept]
