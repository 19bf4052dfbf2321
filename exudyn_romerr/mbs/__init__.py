"""All that touches Exudyn: reduced bodies in an mbs, and monitors beside its solves."""

from .bodies import ReducedBody, add_reduced_body
from .floating import FloatingBody, floating_body
from .monitor import Monitor, attach
from .solution import evaluate_file

__all__ = ["FloatingBody", "Monitor", "ReducedBody", "add_reduced_body", "attach", "evaluate_file", "floating_body"]
