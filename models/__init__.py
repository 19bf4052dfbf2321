"""Finite element models and scenes for the tests, examples and benchmarks of exudyn_romerr."""
