"""All that touches Exudyn: reduced bodies in an mbs, and monitors beside its solves. Loaded when first used."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # editors and type checkers see what __getattr__ loads
    from .access.fem_interface import hold_modes, keep_modes
    from .access.reduced_body import ReducedBody, add_reduced_body
    from .floating.floating_body import FloatingBody, floating_body
    from .floating.modal_damping import set_modal_damping
    from .monitoring.attach import attach
    from .monitoring.monitor import MechanismMonitor, Monitor
    from .studies.choose_modes import choose_modes
    from .studies.mode_table import mode_table
    from .studies.solution_file import evaluate_file
    from .studies.two_level import LevelOutput, TwoLevel, two_level

_MODULES = {
    "FloatingBody": "floating.floating_body",
    "LevelOutput": "studies.two_level",
    "MechanismMonitor": "monitoring.monitor",
    "Monitor": "monitoring.monitor",
    "ReducedBody": "access.reduced_body",
    "TwoLevel": "studies.two_level",
    "add_reduced_body": "access.reduced_body",
    "attach": "monitoring.attach",
    "choose_modes": "studies.choose_modes",
    "evaluate_file": "studies.solution_file",
    "floating_body": "floating.floating_body",
    "hold_modes": "access.fem_interface",
    "keep_modes": "access.fem_interface",
    "mode_table": "studies.mode_table",
    "set_modal_damping": "floating.modal_damping",
    "two_level": "studies.two_level",
}

__all__ = list(_MODULES)


if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f".{_MODULES[name]}", __name__), name)
