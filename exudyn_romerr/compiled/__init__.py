"""What takes long in Python, in C."""
