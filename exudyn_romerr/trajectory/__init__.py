"""A reduced trajectory: samples, inputs between them, segments; bounds along it."""
