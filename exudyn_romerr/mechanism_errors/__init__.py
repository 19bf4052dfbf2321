"""Errors of the linearised mechanism: by its modes, by rigid interfaces, by the time integration."""
