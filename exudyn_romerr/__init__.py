"""Error bounds of reduced flexible bodies, beside the Exudyn simulation.

Public names, each loaded when first used: importing this package imports nothing else, so that `romerr run` has
imported nothing that a script may configure.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ._version import __version__ as __version__

if TYPE_CHECKING:  # editors and type checkers see what __getattr__ loads; `as` tells them that it is public
    from .basis.basis import (
        Basis as Basis,
        gramian_basis as gramian_basis,
        krylov_basis as krylov_basis,
        modal_basis as modal_basis,
    )
    from .basis.second_order_model import SecondOrder as SecondOrder, from_pymor as from_pymor
    from .errors import (
        AssumptionError as AssumptionError,
        InputError as InputError,
        RomErrError as RomErrError,
        RunError as RunError,
    )
    from .fe_files.fe_model import FEModel as FEModel
    from .fe_files.read_body import read_body as read_body
    from .linear.residual.residual import initial_coordinates as initial_coordinates, initial_error as initial_error
    from .linear.run.evaluate import Trajectory as Trajectory, evaluate as evaluate
    from .linear.run.frequency_response import (
        FrequencyResponse as FrequencyResponse,
        frequency_response as frequency_response,
    )
    from .mbs.access.fem_interface import hold_modes as hold_modes, keep_modes as keep_modes
    from .mbs.access.reduced_body import add_reduced_body as add_reduced_body
    from .mbs.floating.floating_body import floating_body as floating_body
    from .mbs.floating.modal_damping import set_modal_damping as set_modal_damping
    from .mbs.monitoring.attach import attach as attach
    from .mbs.studies.choose_modes import choose_modes as choose_modes
    from .mbs.studies.mode_table import mode_table as mode_table
    from .mbs.studies.parameter_sweep import sweep as sweep
    from .mbs.studies.solution_file import evaluate_file as evaluate_file
    from .mbs.studies.two_level import two_level as two_level
    from .mode_selection.mode_choice import ModeChoice as ModeChoice
    from .mode_selection.mode_table import ModeTable as ModeTable
    from .model.admissible_space import (
        MassOrthogonal as MassOrthogonal,
        MeanMotion as MeanMotion,
        mass_orthogonal as mass_orthogonal,
        mean_motion as mean_motion,
    )
    from .model.body import Constants as Constants, ElasticBody as ElasticBody
    from .model.outputs import (
        Output as Output,
        mean_displacement as mean_displacement,
        mean_rotation as mean_rotation,
        node_displacement as node_displacement,
        node_rotation as node_rotation,
        node_strain as node_strain,
        node_stress as node_stress,
        node_velocity as node_velocity,
        relative_displacement as relative_displacement,
    )
    from .report.assessment import Assessment as Assessment
    from .report.derived import VonMises as VonMises, von_mises as von_mises
    from .report.mechanism_report import load_report as load_report
    from .report.plots.comparisons import plot_convergence as plot_convergence, plot_run_time as plot_run_time
    from .report.plots.over_time import add_bands as add_bands
    from .report.report import BoundReport as BoundReport, OutputReport as OutputReport
    from .scripts.run import Run as Run, run as run
    from .scripts.tune import Tuning as Tuning, tune as tune
    from .scripts.verify import Verification as Verification, verify as verify

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
