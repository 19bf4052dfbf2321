"""The user's PreStep function, called on copies: what it sets for a step, by the state at the begin of that step.

Exudyn calls it at the begin of every step with the time of the step's end. What it sets holds until the next call.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

import numpy as np

from ...errors import AssumptionError
from ...mechanism.rows import Rows
from ..access.detached import Detached, OnlyReads
from ..access.mbs_items import FFRF, Items

SETS = {f"Set{kind}Parameter": kind for kind in ("Load", "Object", "Marker", "Node")}
NUMBER = {name: f"{kind.lower()}Number" for name, kind in SETS.items()}  # as Exudyn calls that parameter
ACTS_OUTSIDE = {"open", "input", "sleep"}  # names of what no function is called away from the run with
VARIABLES, NUMERIC = ("variables", 0), (bool, int, float, np.ndarray)
FAILS = "the PreStep function cannot be called away from the run: {}"
Parameters = dict[tuple[str, int], dict[str, Any]]  # of items, by their kind and number


def pre_step_function(mbs: Any) -> Callable | None:
    """Return the Python function that an mbs calls before every step, or None."""
    slot = mbs.GetPreStepUserFunction()
    function = slot["function"] if slot else None
    return function if callable(function) else None


def parameters(mbs: Any) -> Parameters:
    """Return what a PreStep function may set; nothing where there is none."""
    if pre_step_function(mbs) is None:
        return {}
    of = Items(mbs)
    variables = {key: np.copy(x) for key, x in mbs.variables.items() if isinstance(x, NUMERIC)}
    found = {VARIABLES: variables} | {("Load", i): item for i, item in enumerate(of.loads)}
    return found | {("Object", i): item for i, item in enumerate(of.objects) if item["objectType"] != FFRF}


class _Sets(OnlyReads):
    """A copy as the function sees it: its parameters can be set, and which of them were is noted."""

    def __init__(self, of: Any, noted: set[tuple[str, int, str]]):
        super().__init__(of)
        object.__setattr__(self, "_noted", noted)

    def __getattr__(self, name: str) -> Any:
        """Return what it has; what sets parameters, too."""
        if name not in SETS:
            return super().__getattr__(name)

        def set_parameter(*given: Any, **named: Any) -> Any:
            number, parameter, *_ = (*given, *named.values())
            self._noted.add((SETS[name], int(named.get(NUMBER[name], number)), named.get("parameterName", parameter)))
            return getattr(self._of, name)(*given, **named)

        return set_parameter


class PreStep:
    """A copy of the function, along the rows of a run.

    begun : parameters before its first call.
    """

    def __init__(self, mbs: Any, function: Callable, rows: Rows, begun: Parameters):
        self._mbs, self._function, self._rows, self._begun = mbs, function, rows, begun
        self._noted: set[tuple[str, int, str]] = set()

    def before(self, t: float) -> tuple | None:
        """Return the row in which the step begins that t is in; None: t is where the run begins."""
        i = int(np.searchsorted(self._rows.t, t))
        return self._rows.row(i - 1) if i else None

    def __call__(self, copy: Any, t: float) -> None:
        """Let it set parameters of a copy, in the copy's state, for a step that ends at t.

        Where it looks at the main system that a global or a closure has, it sees the copy.
        """
        seen = _Sets(copy, self._noted)
        OnlyReads.instead[id(self._mbs)] = seen
        try:
            with redirect_stdout(StringIO()):
                self._function(seen, t)
        except Exception as error:  # whatever a script may do
            raise AssumptionError(FAILS.format(f"{type(error).__name__} {error}")) from error

    def set_back(self, copy: Any) -> None:
        """Give parameters of a copy that it has set the values which they had before its first call."""
        for kind, number, name in self._noted:
            if name in self._begun.get((kind, number), {}):
                getattr(copy, f"Set{kind}Parameter")(number, name, self._begun[kind, number][name])
        for name, value in self._begun.get(VARIABLES, {}).items():
            copy.variables[name] = value[()]


def detached_with(
    mbs: Any, functions: Sequence[Callable], rows: Rows, begun: Parameters
) -> tuple[Detached, PreStep | None]:
    """Return copies of user functions, and what a PreStep function does along a run.

    None: there is none, or it can do nothing to the equations, or it cannot be called away from the run; what it does
    then shows at the rows.
    """
    function = pre_step_function(mbs) if len(rows) > 1 else None
    if function is not None:
        found = Detached(mbs, [*functions, function])
        acts = functions or found.names & SETS.keys()
        if acts and not found.lost and not found.names & ACTS_OUTSIDE:
            return found, PreStep(mbs, found.of(function), rows, begun)
    return Detached(mbs, functions), None
