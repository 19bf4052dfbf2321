"""The linearised mechanism, in arrays only: bodies and what joins them, along a run. mbs/mirror reads it."""
