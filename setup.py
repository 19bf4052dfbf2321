"""The compiled part; all else is in pyproject.toml. Where there is no compiler, installing leaves it out."""

from setuptools import Extension, setup

C = "exudyn_romerr/compiled/"
NAMES = (
    "buffers",
    "curve_calls",
    "curves",
    "flow",
    "inertia",
    "inverses",
    "march",
    "mechanism_calls",
    "mechanism_march",
)
NAMES += ("norms", "oscillators", "product_calls", "products", "recorder", "small_products")
HEADERS = [f"{C}{name}.h" for name in NAMES]

setup(ext_modules=[Extension("exudyn_romerr.compiled._loops", [C + "loops.c"], depends=HEADERS, optional=True)])
