"""The compiled part; all else is in pyproject.toml. Where there is no compiler, installing leaves it out."""

from setuptools import Extension, setup

C = "exudyn_romerr/compiled/"
HEADERS = [
    C + name
    for name in ("curve_calls.h", "curves.h", "march.h", "norms.h", "oscillators.h", "products.h", "recorder.h")
]

setup(ext_modules=[Extension("exudyn_romerr.compiled._loops", [C + "loops.c"], depends=HEADERS, optional=True)])
