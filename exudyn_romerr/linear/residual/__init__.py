"""The residual R = L z, its norms, kernels, decay rates: all full-size constants that estimators are made of."""
