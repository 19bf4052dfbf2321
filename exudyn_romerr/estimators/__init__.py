"""Estimators: offline constants in, blocks of steps in, bounds out (contract: estimator.py)."""

from .auxiliary_modes import Auxiliary
from .energy import Energy
from .output_kernel import OutputConvolution
from .paper import Convolution, Fast, StateSpace

ESTIMATORS = {
    estimator.name: estimator for estimator in (StateSpace, Fast, Convolution, OutputConvolution, Energy, Auxiliary)
}
