"""One linear body whose inputs are known: bounds of its error (docs/theory.md)."""
