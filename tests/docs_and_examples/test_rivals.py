"""The picture of rivals: its truth is that of a finer run with all modes, and each way tells what it says it does."""

from itertools import pairwise

import numpy as np
import pytest

from benchmarks import rivals, rivals_figure
from benchmarks.mode_rule_cases import Held
from models.floating import interface
from models.hex_bar import hex_bar


@pytest.fixture
def scene(monkeypatch):
    """A short bar over a short time; all runs once."""
    monkeypatch.setattr(rivals, "PERIODS", 1)
    monkeypatch.setattr(rivals, "REPEATS", 1)
    fem = hex_bar(4)
    return rivals.of_held(Held("short", fem, int(interface(fem, "tip")[0][0])), "force")


def test_claims_of_a_linear_body(scene, tmp_path):
    """Bounds are above the truth, our estimate is near it, and all ways are in the picture."""
    claims = list(scene.claims(2))
    assert {claim.way for claim in claims} == set(rivals_figure.LOOKS)
    for claim in claims:
        assert claim.cost > 0
        kind = rivals_figure.LOOKS[claim.way][0]
        if kind == rivals_figure.BOUND:
            assert claim.told >= claim.true, claim
        if claim.way == "our estimate":
            assert claim.told == pytest.approx(claim.true, rel=0.02)
    rivals_figure.draw(claims, tmp_path / "rivals.png")
    assert (tmp_path / "rivals.png").stat().st_size > 10_000
    lines = rivals.table(claims).splitlines()
    assert [line[:18].strip() for line in lines[1:]] == list(dict.fromkeys(claim.way for claim in claims))


def test_truth_is_what_all_modes_and_short_steps_tend_to(scene):
    scene.vectors = lambda n: scene.modes
    off = [np.abs(scene.run(0, finer) - scene.truth)[:, 0].max() for finer in (2, 4, 8)]
    assert off[2] < 2e-5 * np.abs(scene.truth[:, 0]).max()
    assert [3.5 < before / after < 4.5 for before, after in pairwise(off)] == [True, True]  # order 2, to the truth


def test_rules_find_nothing_wrong_with_all_modes(scene):
    omega, shapes = scene.reduced_modes(2)
    few = scene.motion(omega, shapes, scene.times)
    assert scene.lacking_mass(2) > 1e-3
    assert scene.frequencies_off(0) > 1e-4
    scene.vectors = lambda n: scene.modes
    assert abs(scene.lacking_mass(0)) < 1e-9
    assert scene.frequencies_off(0) < 1e-9
    full = scene.motion(*scene.reduced_modes(0), scene.times)
    np.testing.assert_allclose(full, scene.truth, atol=1e-9 * np.abs(scene.truth).max())
    assert np.abs(few - scene.truth).max() > 1e-6 * np.abs(scene.truth).max()


@pytest.mark.slow
def test_claims_of_a_mechanism(monkeypatch):
    monkeypatch.setattr(rivals, "REPEATS", 1)
    claims = list(rivals.of_mechanism("hinged_bar", 2))
    assert {claim.way for claim in claims} == {"2 n modes, h/2", "our estimate", "our bound"}
    assert all(claim.told >= claim.true for claim in claims if claim.way == "our bound")
