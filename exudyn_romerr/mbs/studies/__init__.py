"""Several simulations of one scene: choice of modes, two levels, sweeps."""
