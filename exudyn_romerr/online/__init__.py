"""Bounds along a run, from samples in to a report out."""
