"""Loops in C, where the package was installed with a compiler: `loops`, else None; NumPy does the same elsewhere."""

VERSION = 11  # as in loops.c; one more, in both, whenever functions there are added or take something else

try:
    from . import _loops as loops
except ImportError:
    loops = None
if getattr(loops, "VERSION", None) != VERSION:  # built before an update of the source, which leaves it where it is
    loops = None
