"""The compiled part; all else is in pyproject.toml. Where there is no compiler, installing leaves it out."""

from pathlib import Path

from setuptools import Extension, setup

C = "exudyn_romerr/compiled/"
HEADERS = sorted(map(str, Path(C).glob("*.h")))

setup(ext_modules=[Extension("exudyn_romerr.compiled._loops", [C + "loops.c"], depends=HEADERS, optional=True)])
