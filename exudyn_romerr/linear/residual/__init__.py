"""The residual R = L z over time, its norms, kernels, decay rates: all that estimators are made of."""
