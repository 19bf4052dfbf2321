"""Error bounds of reduced flexible bodies, beside the Exudyn simulation.

Public names, each loaded when first used: importing this package imports nothing else, so that `romerr run` has
imported nothing that a script may configure.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ._version import __version__ as __version__

if TYPE_CHECKING:  # editors and type checkers see what __getattr__ loads
    from .basis.basis import Basis, gramian_basis, krylov_basis, modal_basis
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
    from .report.formats.load import load_report
    from .report.plots.comparisons import plot_convergence, plot_run_time
    from .report.plots.overlay import add_bands
    from .report.report import BoundReport, OutputReport
    from .scripts.run import Run, run
    from .scripts.tune import Tuning, tune
    from .scripts.verify import Verification, verify

_MODULES = {
    "Assessment": "report.assessment",
    "AssumptionError": "errors",
    "Basis": "basis.basis",
    "BoundReport": "report.report",
    "Constants": "model.body",
    "ElasticBody": "model.body",
    "FrequencyResponse": "linear.run.frequency_response",
    "FEModel": "fe_files.fe_model",
    "InputError": "errors",
    "MassOrthogonal": "model.admissible_space",
    "MeanMotion": "model.admissible_space",
    "ModeChoice": "mode_selection.mode_choice",
    "ModeTable": "mode_selection.mode_table",
    "Output": "model.outputs",
    "OutputReport": "report.report",
    "RomErrError": "errors",
    "Run": "scripts.run",
    "RunError": "errors",
    "Trajectory": "linear.run.evaluate",
    "Tuning": "scripts.tune",
    "Verification": "scripts.verify",
    "VonMises": "report.derived",
    "add_bands": "report.plots.overlay",
    "add_reduced_body": "mbs.access.reduced_body",
    "attach": "mbs.monitoring.attach",
    "choose_modes": "mbs.studies.choose_modes",
    "evaluate": "linear.run.evaluate",
    "evaluate_file": "mbs.studies.solution_file",
    "floating_body": "mbs.floating.floating_body",
    "frequency_response": "linear.run.frequency_response",
    "gramian_basis": "basis.basis",
    "hold_modes": "mbs.access.fem_interface",
    "initial_coordinates": "linear.residual.residual",
    "initial_error": "linear.residual.residual",
    "keep_modes": "mbs.access.fem_interface",
    "krylov_basis": "basis.basis",
    "load_report": "report.formats.load",
    "mass_orthogonal": "model.admissible_space",
    "mean_displacement": "model.outputs",
    "mean_motion": "model.admissible_space",
    "mean_rotation": "model.outputs",
    "modal_basis": "basis.basis",
    "mode_table": "mbs.studies.mode_table",
    "node_displacement": "model.outputs",
    "node_rotation": "model.outputs",
    "node_strain": "model.outputs",
    "node_stress": "model.outputs",
    "node_velocity": "model.outputs",
    "plot_convergence": "report.plots.comparisons",
    "plot_run_time": "report.plots.comparisons",
    "read_body": "fe_files.read_body",
    "relative_displacement": "model.outputs",
    "run": "scripts.run",
    "set_modal_damping": "mbs.floating.modal_damping",
    "sweep": "mbs.studies.parameter_sweep",
    "tune": "scripts.tune",
    "two_level": "mbs.studies.two_level",
    "verify": "scripts.verify",
    "von_mises": "report.derived",
}

__all__ = sorted(_MODULES)


if not TYPE_CHECKING:  # to a type checker an unknown name is an error

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f".{_MODULES[name]}", __name__), name)


def __dir__() -> list[str]:
    return __all__
