"""Estimators: offline constants in, blocks of steps in, bounds out (contract: bounds.py)."""

from .auxiliary import Auxiliary
from .energy import Energy
from .paper import Convolution, Fast, StateSpace

ESTIMATORS = {estimator.name: estimator for estimator in (StateSpace, Fast, Convolution, Energy, Auxiliary)}
