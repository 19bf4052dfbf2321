"""An mbs of our own beside that of a run, with auxiliary vectors as modes, and what is measured by it."""
