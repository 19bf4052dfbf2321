"""Monitors beside the solves of an mbs."""
