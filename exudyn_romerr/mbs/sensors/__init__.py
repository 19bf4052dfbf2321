"""Sensors of an mbs: their names, and which of them show a state."""
