"""Types of sensors that show no state of the mbs, and so have no estimate of their error."""

NO_STATE = {
    "Load": "it shows a load, not the motion",
    "UserFunction": "a user function is not called away from the run",
}
