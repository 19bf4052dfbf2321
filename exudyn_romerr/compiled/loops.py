"""Loops in C, where the package was installed with a compiler: `loops`, else None; NumPy does the same elsewhere."""

try:
    from . import _loops as loops
except ImportError:
    loops = None
