"""The compiled part; all else is in pyproject.toml. Where there is no compiler, installing leaves it out."""

from setuptools import Extension, setup

MARCHED = Extension("exudyn_romerr.estimates._marched", ["exudyn_romerr/estimates/_marched.c"], optional=True)

setup(ext_modules=[MARCHED])
