"""Names of what errors come from, and of the checks that tell how far an estimate can be trusted."""

RESOLVED = 0.3  # half width over the largest estimate: above it no digit of the estimate is right
ESTIMATE_PARTS = ("basis", "interfaces", "time step", "initial", "jumps")
REDUCTION = ESTIMATE_PARTS[:2]  # of what a run with all modes and the same steps has
LINEAR, LINEAR_STEPS = "linearisation", "linearisation of steps"  # what linear equations miss of each
# checks of the march of a whole mechanism, which tells interfaces and modes apart: vectors that it has not, and what
# linear equations miss
FURTHER, LINEAR_MODES = "further vectors", "linearisation of modes"
FURTHER_INTERFACES, LINEAR_INTERFACES = "further vectors of interfaces", "linearisation of interfaces"
# what steps make wrong of what modes leave out: of the whole error, of neither cause alone
STEPS_OF_MODES = "steps of what modes leave out"
FEEDBACK = "sampled feedback"  # what is not linear of a PreStep function: where there is one steps are of first order
BY_STEPS = ("time step", "steps", LINEAR_STEPS, "loads", FEEDBACK)
