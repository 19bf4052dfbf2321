"""Error bounds of reduced flexible bodies, beside the Exudyn simulation.

Public names; those that need Exudyn are loaded when first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ._version import __version__ as __version__
from .basis.basis import Basis, modal_basis
from .basis.gramian import gramian_basis
from .basis.krylov import krylov_basis
from .errors import AssumptionError, InputError, RomErrError, RunError
from .fe_files.fe_model import FEModel
from .fe_files.read_body import read_body
from .mode_selection.mode_choice import ModeChoice
from .model.admissible_space import MassOrthogonal, MeanMotion, mass_orthogonal, mean_motion
from .model.body import Constants, ElasticBody
from .model.outputs import (
    Output,
    mean_displacement,
    mean_rotation,
    node_displacement,
    node_rotation,
    node_velocity,
    relative_displacement,
)
from .model.stress_outputs import node_strain, node_stress
from .online.evaluate import Trajectory, evaluate
from .report.assessment import Assessment
from .report.formats.load import load_report
from .report.plots.overlay import add_bands
from .report.plots.run_comparison import plot_convergence, plot_run_time
from .report.report import BoundReport, OutputReport
from .report.von_mises import VonMises, von_mises
from .residual.residual import initial_coordinates, initial_error

if TYPE_CHECKING:  # editors and type checkers see what __getattr__ loads
    from .mbs import (
        add_reduced_body,
        attach,
        choose_modes,
        evaluate_file,
        floating_body,
        hold_modes,
        keep_modes,
        set_modal_damping,
        two_level,
    )
    from .mbs.studies.parameter_sweep import sweep

_NEEDS_EXUDYN = dict.fromkeys(
    (
        "add_reduced_body",
        "attach",
        "choose_modes",
        "evaluate_file",
        "floating_body",
        "hold_modes",
        "keep_modes",
        "set_modal_damping",
        "two_level",
    ),
    "mbs",
) | {"sweep": "mbs.studies.parameter_sweep"}

__all__ = [
    "Assessment",
    "AssumptionError",
    "Basis",
    "BoundReport",
    "Constants",
    "ElasticBody",
    "FEModel",
    "InputError",
    "MassOrthogonal",
    "MeanMotion",
    "ModeChoice",
    "Output",
    "OutputReport",
    "RomErrError",
    "RunError",
    "Trajectory",
    "VonMises",
    "add_bands",
    "add_reduced_body",
    "attach",
    "choose_modes",
    "evaluate",
    "evaluate_file",
    "floating_body",
    "gramian_basis",
    "hold_modes",
    "initial_coordinates",
    "initial_error",
    "keep_modes",
    "krylov_basis",
    "load_report",
    "mass_orthogonal",
    "mean_displacement",
    "mean_motion",
    "mean_rotation",
    "modal_basis",
    "node_displacement",
    "node_rotation",
    "node_strain",
    "node_stress",
    "node_velocity",
    "plot_convergence",
    "plot_run_time",
    "read_body",
    "relative_displacement",
    "set_modal_damping",
    "sweep",
    "two_level",
    "von_mises",
]


if not TYPE_CHECKING:  # to a type checker an unknown name is an error

    def __getattr__(name: str) -> Any:
        if name not in _NEEDS_EXUDYN:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(f".{_NEEDS_EXUDYN[name]}", __name__), name)


def __dir__() -> list[str]:
    return __all__
