"""All that touches Exudyn: reduced bodies in an mbs, and monitors beside its solves."""

from .bodies import ReducedBody, add_reduced_body
from .choose import choose_modes
from .fem_modes import hold_modes, keep_modes
from .floating import FloatingBody, floating_body
from .monitor import Monitor, attach
from .solution import evaluate_file
from .two_level import LevelOutput, TwoLevel, two_level

__all__ = [
    "FloatingBody",
    "LevelOutput",
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
    "two_level",
]
