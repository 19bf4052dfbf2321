"""Evaluation of mechanisms as version 0.2 has it, all attached bodies together; issues 48 and 49 replace it."""
