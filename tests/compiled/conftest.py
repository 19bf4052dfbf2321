"""The compiled part, built once for all tests of a process."""

import os
import shutil
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from exudyn_romerr.compiled.loops import loops as installed

ROOT = Path(__file__).resolve().parents[2]
# a compiler takes 5 s in place of 17, for the same sums; test_wheel.py builds it as `pip install` does
ENVIRONMENT = os.environ | {"CFLAGS": "-O1"}
NEEDED = ("setup.py", "pyproject.toml", "README.md", "LICENSE", "exudyn_romerr/compiled")


@pytest.fixture(scope="session")
def compiled(tmp_path_factory):
    """The compiled part: what is installed, else built from its source."""
    if installed is not None:
        return installed
    folder = tmp_path_factory.mktemp("compiled")
    for name in NEEDED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copy(ROOT / name, folder / name)
    command = [sys.executable, "setup.py", "build_ext", "--build-lib", "built"]
    done = subprocess.run(command, cwd=folder, env=ENVIRONMENT, capture_output=True, encoding="utf-8")
    found = [path for suffix in EXTENSION_SUFFIXES for path in (folder / "built").rglob(f"_loops{suffix}")]
    if not found:
        pytest.skip(f"the compiled part is not installed and cannot be built here: {done.stderr[-500:]}")
    module = module_from_spec(spec := spec_from_file_location("exudyn_romerr.compiled._loops", found[0]))
    spec.loader.exec_module(module)
    return module
