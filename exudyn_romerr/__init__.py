"""Error bounds of reduced flexible bodies, beside the Exudyn simulation.

Public names, each loaded when first used: importing this package imports nothing else, so that `romerr run` has
imported nothing that a script may configure.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ._version import __version__ as __version__

if TYPE_CHECKING:  # editors and type checkers see what __getattr__ loads
    from .basis.basis import Basis, gramian_basis, krylov_basis, modal_basis
    from .basis.second_order_model import SecondOrder, from_pymor
    from .errors import AssumptionError, InputError, RomErrError, RunError
    from .fe_files.fe_model import FEModel
    from .fe_files.read_body import read_body
    from .linear.residual.residual import initial_coordinates, initial_error
    from .linear.run.evaluate import Trajectory, evaluate
    from .linear.run.frequency_response import FrequencyResponse, frequency_response
    from .mbs.access.fem_interface import hold_modes, keep_modes
    from .mbs.access.reduced_body import add_reduced_body
    from .mbs.floating.floating_body import floating_body
    from .mbs.floating.modal_damping import set_modal_damping
    from .mbs.monitoring.attach import attach
    from .mbs.studies.choose_modes import choose_modes
    from .mbs.studies.mode_table import mode_table
    from .mbs.studies.parameter_sweep import sweep
    from .mbs.studies.solution_file import evaluate_file
    from .mbs.studies.two_level import two_level
    from .mode_selection.mode_choice import ModeChoice
    from .mode_selection.mode_table import ModeTable
    from .model.admissible_space import MassOrthogonal, MeanMotion, mass_orthogonal, mean_motion
    from .model.body import Constants, ElasticBody
    from .model.outputs import (
        Output,
        mean_displacement,
        mean_rotation,
        node_displacement,
        node_rotation,
        node_strain,
        node_stress,
        node_velocity,
        relative_displacement,
    )
    from .report.assessment import Assessment
    from .report.derived import VonMises, von_mises
    from .report.mechanism_report import load_report
    from .report.plots.comparisons import plot_convergence, plot_run_time
    from .report.plots.over_time import add_bands
    from .report.report import BoundReport, OutputReport
    from .scripts.run import Run, run
    from .scripts.tune import Tuning, tune
    from .scripts.verify import Verification, verify

_NAMES = {  # by module
    "basis.basis": "Basis gramian_basis krylov_basis modal_basis",
    "basis.second_order_model": "SecondOrder from_pymor",
    "errors": "AssumptionError InputError RomErrError RunError",
    "fe_files.fe_model": "FEModel",
    "fe_files.read_body": "read_body",
    "linear.residual.residual": "initial_coordinates initial_error",
    "linear.run.evaluate": "Trajectory evaluate",
    "linear.run.frequency_response": "FrequencyResponse frequency_response",
    "mbs.access.fem_interface": "hold_modes keep_modes",
    "mbs.access.reduced_body": "add_reduced_body",
    "mbs.floating.floating_body": "floating_body",
    "mbs.floating.modal_damping": "set_modal_damping",
    "mbs.monitoring.attach": "attach",
    "mbs.studies.choose_modes": "choose_modes",
    "mbs.studies.mode_table": "mode_table",
    "mbs.studies.parameter_sweep": "sweep",
    "mbs.studies.solution_file": "evaluate_file",
    "mbs.studies.two_level": "two_level",
    "mode_selection.mode_choice": "ModeChoice",
    "mode_selection.mode_table": "ModeTable",
    "model.admissible_space": "MassOrthogonal MeanMotion mass_orthogonal mean_motion",
    "model.body": "Constants ElasticBody",
    "model.outputs": "Output mean_displacement mean_rotation node_displacement node_rotation node_strain node_stress "
    "node_velocity relative_displacement",
    "report.assessment": "Assessment",
    "report.derived": "VonMises von_mises",
    "report.mechanism_report": "load_report",
    "report.plots.comparisons": "plot_convergence plot_run_time",
    "report.plots.over_time": "add_bands",
    "report.report": "BoundReport OutputReport",
    "scripts.run": "Run run",
    "scripts.tune": "Tuning tune",
    "scripts.verify": "Verification verify",
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_MODULES)


if not TYPE_CHECKING:  # to a type checker an unknown name is an error

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f".{_MODULES[name]}", __name__), name)


def __dir__() -> list[str]:
    return __all__
