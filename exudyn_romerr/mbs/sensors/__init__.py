"""Sensors of an mbs on none of its flexible bodies: what they show, and what errors make of it."""
