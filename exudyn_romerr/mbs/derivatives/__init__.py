"""Tangents of a mechanism: derivatives of its equations, read beside a run."""
