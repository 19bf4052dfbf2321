"""Estimators: offline constants in, blocks of steps in, bounds out (contract: base.py)."""

from .paper import Convolution, Fast, StateSpace

ESTIMATORS = {estimator.name: estimator for estimator in (StateSpace, Fast, Convolution)}
