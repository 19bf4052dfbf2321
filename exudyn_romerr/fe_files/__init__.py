"""Finite-element models from files of other programs: matrices, nodes, elements, sets."""
