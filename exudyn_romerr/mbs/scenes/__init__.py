"""Scenes of scripts: reduced bodies and solves found from outside, watched, or made finer."""
