"""The compiled part; all else is in pyproject.toml. Where there is no compiler, installing leaves it out."""

from setuptools import Extension, setup

C = "exudyn_romerr/compiled/"
NAMES = "buffers closed_form closed_form_calls closed_tangent curve_calls curves flow inertia inverses march"
NAMES += " mechanism_calls mechanism_march norms oscillators product_calls products recorder small_products"
HEADERS = [f"{C}{name}.h" for name in NAMES.split()]

setup(ext_modules=[Extension("exudyn_romerr.compiled._loops", [C + "loops.c"], depends=HEADERS, optional=True)])
