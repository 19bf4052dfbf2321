"""The machinery that runs Exudyn's own scripts, on a script of our own: Exudyn's checkout is not needed here."""

import pytest

from benchmarks import exudyn_examples

SCRIPT = """
import exudyn as exu
from exudyn.utilities import *
from exudyn.FEM import ObjectFFRFreducedOrderInterface
from models import floating

mbs = exu.SystemContainer().AddSystem()
fem = floating.load_fem("bar")
floating.reduce(fem, 2)
objFFRF = ObjectFFRFreducedOrderInterface(fem).AddObjectFFRFreducedOrder(mbs, massProportionalDamping=2.0)
faces = [floating.interface(fem, side) for side in ("left", "right")]
mLeft, mRight = (mbs.AddMarker(MarkerSuperElementRigid(bodyNumber=objFFRF["oFFRFreducedOrder"], meshNodeNumbers=nodes,
                                                       weightingFactors=w)) for nodes, w in faces)
oGround = mbs.AddObject(ObjectGround(referencePosition=faces[0][1] @ fem.GetNodePositionsAsArray()[faces[0][0]]))
mbs.AddObject(GenericJoint(markerNumbers=[mbs.AddMarker(MarkerBodyRigid(bodyNumber=oGround)), mLeft]))
mbs.AddLoad(LoadForceVector(markerNumber=mRight, loadVectorUserFunction=lambda mbs, t, v: [0, 1e4 * t * cos(0), 0]))
sTip = mbs.AddSensor(SensorMarker(markerNumber=mRight, name="tip", fileName="solution/tip.txt",
                                  outputVariableType=exu.OutputVariableType.Displacement))
mbs.Assemble()
simulationSettings = exu.SimulationSettings()
simulationSettings.timeIntegration.endTime = 0.01
simulationSettings.timeIntegration.numberOfSteps = 20
mbs.SolveDynamic(simulationSettings)
VSub([1], [2])
"""


@pytest.fixture
def checkout(tmp_path):
    """A work tree with one script that makes a reduced body, and one that makes none."""
    folder = tmp_path / "main/pythonDev/Examples"
    folder.mkdir(parents=True)
    (folder / "tiny.py").write_text(SCRIPT)
    (folder / "rigid.py").write_text("import exudyn\n")
    return tmp_path


def test_a_script_is_run_bare_and_watched(checkout, monkeypatch, capsys):
    """Old names are there, states are compared, each sensor has its row."""
    put = {}
    monkeypatch.setattr(exudyn_examples.page, "put", put.__setitem__)
    text = exudyn_examples.main([str(checkout), "--docs"])
    of_scripts, of_sensors = text.split("\n\n")
    (row,) = [line.strip("| ").split(" | ") for line in of_scripts.split("\n")[2:]]
    assert row[:4] == ["Examples/tiny", "well", "1", "1 of 1 estimated"]
    assert row[-1] == "all 7 arrays equal"  # five kinds of coordinates, the sensor, the number of solves
    assert float(row[5]) > 0
    (sensor,) = [line.strip("| ").split(" | ") for line in of_sensors.split("\n")[2:]]
    assert sensor[1] == "tip"
    assert float(sensor[3].split(" +- ")[0]) > 0
    _, short = put["examples"].split("\n")
    assert short.split()[:2] == ["tiny", "well"]
    assert short.split()[-1] == "equal"
    assert "tiny" in capsys.readouterr().out


def test_a_run_that_we_change_is_found_out(checkout, tmp_path):
    script = checkout / "main/pythonDev/Examples/tiny.py"
    bare = exudyn_examples.ran(script, "bare", tmp_path / "one" / "bare", 60)
    script.write_text(SCRIPT.replace("1e4", "2e4"))
    other = exudyn_examples.ran(script, "bare", tmp_path / "other" / "bare", 60)
    assert exudyn_examples.equality(bare, bare).endswith("equal")
    assert "differ" in exudyn_examples.equality(bare, other)
    assert exudyn_examples.equality(bare._replace(states={}), other) == "none kept"
