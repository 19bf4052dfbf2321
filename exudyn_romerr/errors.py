"""The three kinds of failure, kept apart."""


class RomErrError(Exception):
    """Base of everything that exudyn_romerr raises on purpose."""


class InputError(RomErrError, ValueError):
    """What was passed is wrong: shape, name, value, nan."""


class AssumptionError(RomErrError, ValueError):
    """The input is well formed, but an assumption of the theorem asked for does not hold."""


class RunError(RomErrError, RuntimeError):
    """What was asked for needs a run (or an assembled mbs) that is not there or not complete."""
