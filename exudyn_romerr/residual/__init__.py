"""The residual R = L z, its norms, and all full-size constants that estimators are made of."""
