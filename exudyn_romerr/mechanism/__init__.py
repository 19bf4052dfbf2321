"""The linearised mechanism: all bodies and what joins them, from rows of a run to the error of its modes and steps.

Arrays only; exudyn_romerr.mbs reads them of Exudyn. docs/theory.md has the equations.
"""
