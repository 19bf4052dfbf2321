"""The border of the linearised mechanism to Exudyn: rows, a hollow copy of the mbs, vectors of bodies, sensors."""
