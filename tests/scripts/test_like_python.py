"""A script cannot tell `romerr run` from `python`: what it prints, finds in its process, leaves behind."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
PYTHON, RUN = (), ("-m", "exudyn_romerr", "run", "--quiet")
LOOKS = """
import os, sys, warnings
print(sorted({"numpy", "scipy", "matplotlib", "exudyn", "threadpoolctl"} & set(sys.modules)))
print(sorted((key, str(value)) for key, value in globals().items() if key not in ("__builtins__", "__loader__")))
print(type(__loader__), __builtins__)
print(sys.argv, sys.path[0], os.getcwd(), os.environ, warnings.filters, sys.stdout.errors, sys.flags)
print(sys.stdin.read())
print(sys.modules["__main__"].__dict__ is globals(), __name__)
"""
ENDS = {
    "well": "print('done')",
    "with a status": "import sys; sys.exit(7)",
    "with a large status": "import sys; sys.exit(256 + 5)",
    "with none": "import sys; sys.exit()",
    "with a text": "import sys; sys.exit('it is over')",
    "with an error": "def f():\n    raise ValueError('boo')\nf()",
    "with a cause": "try:\n    {}['a']\nexcept KeyError as e:\n    raise ValueError('boo') from e",
    "with a context": "try:\n    {}['a']\nexcept KeyError:\n    1 / 0",
    "with wrong syntax": "def f(:\n",
    "with a hook of its own": "import sys\nsys.excepthook = lambda *e: print('mine', e[0])\n1 / 0",
    "at exit": "import atexit; atexit.register(print, 'bye')",
    "in a thread": "import threading\nthreading.Timer(0.2, print, ['late']).start()",
}


def ended(how, script, *arguments, folder, **options):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, *how, script, *arguments]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, input="typed", timeout=300, **options
    )


def same(script, *arguments, folder):
    """What a script prints and how it ends, the same under both."""
    found = [ended(how, script, *arguments, folder=folder) for how in (PYTHON, RUN)]
    one, other = ((done.stdout, done.stderr, done.returncode) for done in found)
    assert one == other
    return found[0]


def test_the_process_looks_the_same(tmp_path):
    """In a folder below, through a link, with options after the script that look like ours."""
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "looks.py").write_text(LOOKS)
    (tmp_path / "link.py").symlink_to(tmp_path / "below" / "looks.py")
    for script in ("below/looks.py", "link.py", str(tmp_path / "below" / "looks.py")):
        done = same(script, "--tolerance", "1%", "-x", "", folder=tmp_path)
        assert done.stdout.startswith("[]\n")  # nothing that a script may configure was imported


@pytest.mark.parametrize("how", ENDS)
def test_scripts_end_the_same(how, tmp_path):
    (tmp_path / "ends.py").write_text(ENDS[how])
    same("ends.py", folder=tmp_path)


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_ctrl_c_ends_it_by_the_signal(tmp_path):
    text = "import os, signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's jobs ignore it\n"
    (tmp_path / "ends.py").write_text(text + "os.kill(os.getpid(), signal.SIGINT)\n")
    assert same("ends.py", folder=tmp_path).returncode == -signal.SIGINT


def test_modules_beside_the_script_are_found_and_workers_too(tmp_path):
    """A spawned process imports the script by its path."""
    (tmp_path / "beside.py").write_text("VALUE = 3\n")
    text = """
import multiprocessing, beside
def work(x):
    return x * beside.VALUE
if __name__ == "__main__":
    for method in ("spawn", "fork"):
        with multiprocessing.get_context(method).Pool(2) as pool:
            print(pool.map(work, [1, 2]))
"""
    (tmp_path / "work.py").write_text(text)
    assert same("work.py", folder=tmp_path).stdout == "[3, 6]\n[3, 6]\n"


SCENE = f"""
import sys
sys.path.insert(1, {str(ROOT)!r})
import numpy as np
import scipy.sparse.linalg as sla
eigsh = sla.eigsh  # begins with random numbers of its own
sla.eigsh = lambda A, *a, **o: eigsh(A, *a, **{{"v0": np.ones(A.shape[0]), **o}})
from models import floating, mechanisms
for scene in (floating.pendulum(4, t_end=0.05), mechanisms.double_pendulum(2, t_end=0.02)):
    mbs = scene.mbs
    mbs.AddSensor(floating.itemInterface.SensorNode(nodeNumber=0, fileName="node.txt", writeToFile=True,
        outputVariableType=floating.exu.OutputVariableType.Position))
    mbs.Assemble()
    scene.settings.solution.file.write = True
    scene.settings.solution.file.name = "solution.txt"
    for repeat in range(2):
        mbs.SolveDynamic(scene.settings)
        states = [mbs.systemData.GetODE2Coordinates(), mbs.systemData.GetODE2Coordinates_t(),
                  mbs.systemData.GetODE2Coordinates_tt(), mbs.systemData.GetAECoordinates()]
        stored = [mbs.GetSensorStoredData(i) for i in range(mbs.systemData.NumberOfSensors())
                  if mbs.GetSensor(i)["storeInternal"]]
        np.savez(f"{{type(scene).__name__}}{{repeat}}.npz", *states, *stored)
        print(sorted(mbs.sys), mbs.variables)
"""


def test_states_sensors_and_files_are_the_same_bit_by_bit(tmp_path):
    folders = [tmp_path / name for name in ("bare", "watched")]
    for folder, how in zip(folders, (PYTHON, RUN), strict=True):
        folder.mkdir()
        (folder / "scene.py").write_text(SCENE)
        done = ended(how, "scene.py", folder=folder, check=False)
        assert done.returncode == 0, done.stderr
        (folder / "out.txt").write_text(done.stdout + done.stderr)
    for name in sorted(path.name for path in folders[0].glob("*.npz")):
        one, other = (np.load(folder / name) for folder in folders)
        assert len(one.files) > 6
        assert one.files == other.files
        for key in one.files:
            np.testing.assert_array_equal(one[key], other[key])
    assert sorted(path.name for path in folders[0].iterdir()) == sorted(path.name for path in folders[1].iterdir())
    for name in ("solution.txt", "node.txt"):
        texts = [(folder / name).read_text().split("\n") for folder in folders]
        rows = [[line for line in text if not line.startswith("#")] for text in texts]  # comments have the date
        assert rows[0] == rows[1]
        assert len(rows[0]) > 2
