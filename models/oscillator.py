"""The one-mass oscillator m q'' + d q' + k q = u, (16) of Ruiner, Fehr, Haasdonk, Eberhard (2012)."""

import numpy as np

import exudyn_romerr as romerr


def build(m: float, k: float = 10.0, d: float = 0.2) -> romerr.ElasticBody:
    """Elastic body with one degree of freedom.

    Parameters
    ----------
    m : float
        Mass in kg.
    k : float, optional
        Stiffness in N/m.
    d : float, optional
        Damping in N s/m.

    Returns
    -------
    ElasticBody
        One degree of freedom, nothing fixed.
    """
    # A body given damping=[[d]] counts as non-modally damped and loses the closed forms of modal damping,
    # which a single mode always has. The same d as Rayleigh damping, alpha m = d, keeps them.
    return romerr.ElasticBody(np.array([[m]]), np.array([[k]]), rayleigh=(d / m, 0.0))
