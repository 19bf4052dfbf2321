"""benchmarks/against_rival.py, shortened: what is run, and that the rival has twice the modes and half the step."""

import exudyn as exu
import pytest

from benchmarks import against_rival
from models import floating

SCALE = 0.01  # of the simulated time


def test_every_run_of_the_linkage_is_timed(capsys):
    text = against_rival.main(["--only", "linkage, 12 modes, 'auto'", "--pairs", "1", "--scale", f"{SCALE}"])
    head, row = text.split("\n")
    assert head.split()[-6:] == ["by", "solve", "rival", "imports", "s", "package"]
    assert row.startswith("linkage, 12 modes, 'auto'")
    bare, solves, *others = map(float, row.removeprefix("linkage, 12 modes, 'auto'").split())
    assert 0 < solves <= bare
    assert len(others) == 6  # differences of times of processes among them: of either sign on a busy machine
    assert text in capsys.readouterr().out


def test_the_rival_has_twice_the_modes_and_half_the_step():
    made = []
    with against_rival.twice():
        fem = floating.load_fem("bar")
        floating.reduce(fem, 3)
        scene = floating.pendulum(3, h=1e-3, t_end=5e-3)
        scene.mbs.SetPostStepUserFunction(lambda mbs, t: not made.append(t))
        scene.solve()
    own = floating.load_fem("bar")
    floating.reduce(own, 3)
    static = own.modeBasis["matrix"].shape[1] - 3
    assert fem.modeBasis["matrix"].shape[1] == static + 6
    assert len(made) == 11
    assert scene.settings.timeIntegration.numberOfSteps == 5
    assert exu.MainSolverImplicitSecondOrder.SolveSystem.__name__ != "changed"


def test_scenes_double_in_their_text():
    scene = against_rival.SCENES["pendulum, 14 modes"]
    assert "pendulum(8, h=0.0001" in scene.script("bare", 1.0)
    assert "pendulum(16, h=5e-05" in scene.script("rival", 1.0)


def test_scripts_of_exudyn_need_a_checkout(capsys):
    with pytest.raises(SystemExit):
        against_rival.main(["--only", "NGsolveCMStest"])
    assert "--exudyn CHECKOUT" in capsys.readouterr().err
