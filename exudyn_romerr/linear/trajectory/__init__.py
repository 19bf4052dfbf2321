"""A reduced trajectory: samples, inputs between them, segments."""
