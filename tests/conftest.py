"""Settings of all tests."""

import os

# Small matrices: a second BLAS thread only waits for the first, and on a busy machine it waits eight times as long.
# Read when numpy is imported, which pytest does after this file.
for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")
