"""Reduced flexible bodies of a script, found as it adds them to an mbs, and the FE models behind them."""

from __future__ import annotations

import gc
import sys
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import FrameType, ModuleType

    from ...mode_selection.modal_content import FurtherModes

TYPES = ("FFRFreducedOrder", "ObjectFFRFreducedOrder")  # in Exudyn's dictionaries, of its Python classes
DYNAMIC, STATIC = ("MainSolverImplicitSecondOrder", "MainSolverExplicit"), "MainSolverStatic"  # Exudyn's solvers
PACKAGE = __name__.split(".")[0] + "."
SAME_MESH = 1e-9  # of the largest coordinate: positions are copied, not computed
NO_FEM = (
    "no FEMinterface with its mesh and modes is there any more (a body loaded from a file of its modes has none), so "
    "what its modes leave out is not known"
)


@dataclass(frozen=True, eq=False)
class FoundBody:
    """A reduced flexible body as a script adds it: its number among all that the script adds, its object in the mbs.

    fem : the FEMinterface whose modes it has; None: there is none, see NO_FEM. modes : how many. further : that it
    might have, where that is asked.
    """

    order: int
    number: int
    fem: Any
    modes: int
    further: FurtherModes | None = None

    def items(self, mbs: Any) -> dict[str, int]:
        """Return what Exudyn returned of the body when it was made, as floating_body wants it."""
        frame, modal = map(int, mbs.GetObject(self.number)["nodeNumbers"])
        return {"nRigidBody": frame, "nGenericODE2": modal, "oFFRFreducedOrder": self.number}


class StandIn:
    """Stands in front of functions of classes and modules; what was replaced can be put back."""

    def __init__(self) -> None:
        self._replaced: list[tuple[Any, str, Any]] = []

    def replace(self, owner: Any, name: str, stand_in: Callable) -> None:
        """Let stand_in(call, *arguments) be called in place of call(*arguments), which an owner has by that name."""
        call = getattr(owner, name)

        @wraps(call)
        def standing(*arguments: Any, **options: Any) -> Any:
            return stand_in(call, *arguments, **options)

        self._replaced.append((owner, name, call))
        setattr(owner, name, standing)

    def uninstall(self) -> None:
        """Put back all that was replaced, the last first."""
        while self._replaced:
            setattr(*self._replaced.pop())


def settings_of(arguments: tuple, options: dict[str, Any]) -> Any:
    """Return the simulation settings that a function of a solver is called with, beside the mbs."""
    return arguments[0] if arguments else options.get("simulationSettings")


class FoundBodies(StandIn):
    """Bodies of each mbs, which they do not keep; `install` puts it in front of Exudyn's functions."""

    def __init__(self) -> None:
        super().__init__()
        self._bodies: WeakKeyDictionary[Any, list[FoundBody]] = WeakKeyDictionary()
        self.count, self.modes = 0, []  # of all mbs, in their order
        self.further: WeakKeyDictionary[Any, FurtherModes] = WeakKeyDictionary()  # of each fem, where that is asked

    def of(self, mbs: Any) -> list[FoundBody]:
        """Return the bodies of an mbs in the order in which they were added."""
        return list(self._bodies.get(mbs, ()))

    def install(self, exudyn: ModuleType) -> None:
        """Stand in front of AddObject and Reset of every mbs; what they do and return stays the same."""
        self.replace(exudyn.MainSystem, "AddObject", self._add)
        self.replace(exudyn.MainSystem, "Reset", self._reset)

    def _add(self, add_object: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
        number = add_object(mbs, *arguments, **options)
        item = arguments[0] if arguments else next(iter(options.values()), None)
        if _is_reduced(item) and not _is_ours(sys._getframe(2)):
            bodies = self._bodies.setdefault(mbs, [])
            modes, fem = dict(item)["modeBasis"], fem_of(item)
            further = self.further.get(fem) if fem is not None and _has_modes(fem, modes) else None
            bodies.append(FoundBody(self.count, int(number), fem, np.shape(modes)[1], further))
            self.modes.append(np.shape(modes)[1])
            self.count += 1
        return number

    def _reset(self, reset: Any, mbs: Any, *arguments: Any, **options: Any) -> Any:
        self._bodies.pop(mbs, None)
        return reset(mbs, *arguments, **options)


def _is_ours(frame: FrameType) -> bool:
    """Whether a call comes from this package, whose copies of an mbs are no bodies of the script."""
    return frame.f_globals.get("__name__", "").startswith(PACKAGE)


def _is_reduced(item: Any) -> bool:
    return (item.get("objectType") if isinstance(item, dict) else type(item).__name__) in TYPES


def fem_of(item: Any) -> Any:
    """Return the FEMinterface alive whose mesh, and best whose modes, an object to be added has; None: there is none.

    Parameters
    ----------
    item : ObjectFFRFreducedOrder or dict
        As passed to mbs.AddObject.

    Notes
    -----
    Exudyn keeps no way from a body to its FE model, so all objects of the process are looked through, once a body.
    Does not cover: two fems of one mesh and other materials, whose modes are both gone: the first is returned, and
    floating_body refuses it if its matrices do not fit.
    """
    item = dict(item)
    positions = np.asarray(item["referencePositions"], dtype=float).reshape(-1, 3)
    modes = item["modeBasis"]
    found = [x for x in gc.get_objects() if type(x).__name__ == "FEMinterface" and _has_mesh(x, positions)]
    by_modes = [fem for fem in found if _has_modes(fem, modes)]
    return next(iter(by_modes or found), None)


def _has_mesh(fem: Any, positions: np.ndarray) -> bool:
    if len(fem.nodes) != 1:  # of several kinds of nodes; or none yet
        return False
    own = np.asarray(fem.GetNodePositionsAsArray(), dtype=float)
    return own.shape == positions.shape and np.max(np.abs(own - positions)) <= SAME_MESH * np.max(np.abs(positions))


def _has_modes(fem: Any, modes: Any) -> bool:
    own = fem.modeBasis.get("matrix") if isinstance(fem.modeBasis, dict) else None
    return own is modes or (own is not None and np.array_equal(own, modes))
