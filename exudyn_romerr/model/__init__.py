"""The full body: matrices, held motions, floating frame, outputs."""
