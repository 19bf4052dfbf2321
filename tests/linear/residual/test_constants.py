"""The four constants that the paper prints, from closed forms on the fitted linkage."""

import numpy as np
import pytest
import scipy.linalg as la

from exudyn_romerr import Output
from exudyn_romerr.linear.residual.kernels import CertifiedKernel, SpectrumKernel
from models import linkage
from tests.helpers import tolerances as tol
from tests.helpers.bodies import model


@pytest.fixture(scope="module")
def built():
    """Body, inputs and output of the linkage."""
    return linkage.build()


def test_the_papers_constants_to_the_printed_digits(built):
    """C1 = 4.3492e4, C11 = 1.0000, C12 = 0.0196 and C2 = 6.9151."""
    body, _, tip = built
    k = body.constants()
    assert (f"{k.C1:.4e}", f"{k.C11:.4f}", f"{k.C12:.4f}") == ("4.3492e+04", "1.0000", "0.0196")
    assert [f"{c:.4f}" for c in tip.constant(body)] == ["6.9151"]


def test_constants_are_python_floats(built):
    """The contract: k.C1, k.C11, k.C12 are floats; C2 an array (r,); the joint constant a float."""
    body, _, tip = built
    k = body.constants()
    assert all(isinstance(c, float) for c in (k.C1, k.C11, k.C12, tip.constant(body, joint=True)))
    assert tip.constant(body).shape == (1,)


def test_kernels_have_the_same_constants(built):
    """C12 of the spectrum is the paper's; the certified kernel's is above it by less than 19 %; C11 = 1."""
    body = built[0]
    C12 = body.constants().C12
    assert SpectrumKernel(body).C12 == pytest.approx(C12, rel=tol.CLOSED_FORM)
    assert C12 <= CertifiedKernel(body).C12 < 1.19 * C12
    assert CertifiedKernel(body).C11 == SpectrumKernel(body).C11 == 1.0


@pytest.mark.parametrize("seed", range(5))
def test_joint_output_constant_is_attained(seed):
    """(28): |C e|_2 <= C2 |e|_M for all e, with equality for one; rows' constants are its parts."""
    rng = np.random.default_rng(seed)
    full = model("chain", "under", seed)
    rows = rng.standard_normal((3, full.N))
    out = Output("y", rows)
    joint, single = out.constant(full.body, joint=True), out.constant(full.body)
    e = rng.standard_normal((full.N, 500))
    sizes = np.sqrt(np.einsum("ij,ij->j", e, full.M @ e))
    assert np.all(la.norm(rows @ e, axis=0) <= joint * sizes)
    assert np.all(np.abs(rows @ e) <= single[:, None] * sizes)
    L = la.cholesky(full.M, lower=True)
    worst = la.solve(L.T, la.svd(la.solve(L, rows.T).T)[2][0])
    assert la.norm(rows @ worst) / np.sqrt(worst @ full.M @ worst) == pytest.approx(joint, rel=tol.SUMS * 100)
    assert single == pytest.approx([la.norm(la.solve(L, row)) for row in rows], rel=tol.SUMS * 100)
