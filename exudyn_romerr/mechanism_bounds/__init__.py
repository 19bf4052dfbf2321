"""What the modes' error of a mechanism is at most: the residual under the estimate, and sums of how it varies."""
