"""Notes the times at which functions of other modules are called; what is kept here is nobody's memory."""

TIMES: list = []


def note(t):
    """Note a time, or many."""
    TIMES.append(t)
