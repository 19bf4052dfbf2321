"""A lumped beam as Nastran writes it, rotations without mass: what the message offers is right."""

import numpy as np
import pytest

import exudyn_romerr as romerr

E_MODULUS, DENSITY, SIDE, ELEMENTS = 2.1e11, 7850.0, 0.02, 10  # steel, a cantilever of 1 m
# of the same beam without dimension, 1.8751^2 sqrt(E I / rho A); ten lumped masses are 0.5 % below it
EXACT = 1.875104**2 * np.sqrt(E_MODULUS * SIDE**2 / 12 / DENSITY)
LUMPED = 0.01


def lumped_beam():
    """Mass and stiffness of bending in a plane; deflection and slope of each node."""
    h, bending = 1 / ELEMENTS, E_MODULUS * SIDE**4 / 12
    K, m = np.zeros((2 * ELEMENTS + 2,) * 2), np.zeros(2 * ELEMENTS + 2)
    of = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]]
    of += [[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
    for e in range(ELEMENTS):
        at = range(2 * e, 2 * e + 4)
        K[np.ix_(at, at)] += bending / h**3 * np.array(of)
        m[[2 * e, 2 * e + 2]] += DENSITY * SIDE**2 * h / 2
    return np.diag(m), K


def test_what_is_offered_for_massless_coordinates_is_exact():
    M, K = lumped_beam()
    c, i = np.arange(2, len(M), 2), np.arange(3, len(M), 2)
    with pytest.raises(romerr.InputError, match="mass has no positive diagonal entry") as error:
        romerr.ElasticBody(M, K, fixed=[0, 1])
    formula = "K[c, c] - K[c, i] @ solve(K[i, i], K[i, c])"
    assert formula in str(error.value)
    blocks = {"K[c, c]": "K[np.ix_(c, c)]", "K[c, i]": "K[np.ix_(c, i)]", "K[i, i]": "K[np.ix_(i, i)]"}
    blocks |= {"K[i, c]": "K[np.ix_(i, c)]", "solve": "np.linalg.solve"}
    for written, meant in blocks.items():
        formula = formula.replace(written, meant)
    condensed = eval(formula)  # as it is printed
    omega = romerr.ElasticBody(M[np.ix_(c, c)], (condensed + condensed.T) / 2).modes(1).omega[0]
    assert abs(omega - EXACT) < LUMPED * EXACT
    # what the message offered before
    assert romerr.ElasticBody(M, K, fixed=[0, 1, *i]).modes(1).omega[0] > 10 * EXACT
    assert "or fix" not in str(error.value)
    assert "Fixing would make the model stiffer" in str(error.value)
