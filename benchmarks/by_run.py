"""What `romerr run` tells of a scene of this process, whose bodies need not be those of a script."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import Any

from exudyn_romerr.mbs.access.solvers import scheme_from
from exudyn_romerr.mbs.mirror.recorder import Recorder
from exudyn_romerr.mbs.mirror.told_solve import Asked, told_solve


def told_by_run(mbs: Any, flexes: Sequence[Any], solve: Callable[[], Any]) -> tuple[Any, Any]:
    """Return what solve() returns, and the report of the last run that it makes of the mbs.

    Does not cover: a PostStep function of the scene's own.
    """
    recorder = Recorder(mbs, None)
    mbs.SetPostStepUserFunction(recorder)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        result = solve()
    mbs.SetPostStepUserFunction(0)
    asked = Asked(flexes, [()] * len(flexes), scheme_from(mbs.sys["dynamicSolver"]), False)
    told, _ = told_solve(mbs, asked, recorder.runs()[-1])
    return result, told.report(told.sensors)
