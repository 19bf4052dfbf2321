"""All that touches Exudyn: reduced bodies in an mbs, and monitors beside its solves."""

from .access.fem_modes import hold_modes, keep_modes
from .access.reduced_body import ReducedBody, add_reduced_body
from .floating.floating_body import FloatingBody, floating_body
from .monitoring.attach import attach
from .monitoring.monitor import MechanismMonitor, Monitor
from .studies.choose_modes import choose_modes
from .studies.modal_damping import set_modal_damping
from .studies.solution_file import evaluate_file
from .studies.two_level import LevelOutput, TwoLevel, two_level

__all__ = [
    "FloatingBody",
    "LevelOutput",
    "MechanismMonitor",
    "Monitor",
    "ReducedBody",
    "TwoLevel",
    "add_reduced_body",
    "attach",
    "choose_modes",
    "evaluate_file",
    "floating_body",
    "hold_modes",
    "keep_modes",
    "set_modal_damping",
    "two_level",
]
