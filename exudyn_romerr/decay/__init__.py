"""How a body's free motion decays: upper bounds of its fundamental matrix, admissible decay rates."""
