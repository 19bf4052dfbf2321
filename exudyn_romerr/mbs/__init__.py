"""All that touches Exudyn: reduced bodies in an mbs, and monitors beside its solves."""

from .bodies import ReducedBody, add_reduced_body
from .floating import FloatingBody, floating_body
from .monitor import Monitor, attach

__all__ = ["FloatingBody", "Monitor", "ReducedBody", "add_reduced_body", "attach", "floating_body"]
