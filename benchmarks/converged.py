"""Random mechanisms with all modes: what all sensors show, and what is left of errors beside Newton's tolerances."""

import numpy as np

from benchmarks.mechanism_builder import built

TOLERANCES = (1.0, 10.0, 100.0, 1000.0)
TIGHTER = (1e-3, 1e-2, 0.1)
ELSEWHERE = (0.31, -0.47, 0.23)  # m


class NotSolvedError(Exception):
    """Newton reaches none of the tolerances."""


def truths(mechanism, build=built):
    """Return the factor of the tolerances, values of all sensors with all modes, and what is left of errors."""
    for factor in TOLERANCES:
        few = motion(mechanism, build(mechanism, False, factor))
        cases = ((True, ()), (True, (ELSEWHERE,)), (False, (ELSEWHERE,))) if few is not None else ()
        others = [tightest(mechanism, build, factor, *case) for case in cases]
        if others and None not in others:
            full, full_again, few_again = others
            left = {y: np.abs(few[y] - few_again[y]) + np.abs(full[y] - full_again[y]) for y in full}
            return factor, full, {y: float(x.max()) for y, x in left.items()}
    raise NotSolvedError("Newton's iteration reaches none of the tolerances")


def tightest(mechanism, build, factor, complete, at):
    """Return what all sensors show with the tightest tolerances that Newton reaches, or None if it reaches none."""
    found = (motion(mechanism, build(mechanism, complete, factor * x, *at)) for x in TIGHTER)
    return next((values for values in found if values is not None), None)


def motion(mechanism, scene):
    """Return what all sensors of a scene of the mechanism show, or None if Newton does not reach its tolerance."""
    try:
        scene.solve()
    except Exception as error:
        if "SolveDynamic" not in str(error):
            raise
        return None
    values = scene.motion()
    finite = all(len(y) == mechanism.steps + 1 and np.isfinite(y).all() for y in values.values())
    return values if finite else None
