"""BoundReport: the bounds of one run, printed, saved, loaded, compared with a truth and plotted."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..checks import check_array, check_choice, real_array
from ..errors import InputError
from ..linear.residual.samples import instants_in
from .answers import Tolerances, tolerances_of
from .assessment import Assessment, assess, limit_of, rows_of_output
from .data import OutputReport, ReportData
from .derived import features_of
from .formats.csv_table import columns, write_csv
from .formats.npz_file import write_npz
from .judgement import details, summary
from .scope import with_doubts
from .verdict_text import worst_by_cause
from .wording import widest_scope


@dataclass(repr=False)
class BoundReport(ReportData):
    """The bounds of one run.

    t : (T,) instants in s. position_bound[e], velocity_bound[e] : (T,) bounds of |e|_M and |e'|_M.
    scope[e] : "complete" (loads and supports do not depend on the body's deformation), "coupled (linearised)" (they
    do, and the bound covers it to first order) or "inputs frozen" (they do; the bound holds for the full body under
    those of this simulation). time : "reconstructed", "sampled" or "static". remainder[e] : in a mechanism, size of
    what linear equations leave out over that of the deformation that auxiliary vectors predict, as measured; empty
    where it was not. messages : what the reader must know first. made : when, by which script and versions the run
    was bounded. planned_end : where the solver was to go to, if the run ends before; None: it does not, or that is
    not known; ended_by, on_purpose : by what, in words, and whether that
    was meant. origin : the file it was saved to, or read from, last. uncertified : why no bound
    of it is certified, a message each, with .cause and .cure in few words; empty: nothing speaks against them but
    their scope. modes : what mode_table asks; None: a mechanism has not told it, or it was not saved. bodies : of a
    mechanism, see MechanismReport.
    """

    outputs: dict[str, OutputReport]

    def output(self, name: str) -> OutputReport:
        """Return the output of that name, with verdicts, peak, rms, end; InputError lists the known ones."""
        out = super().output(name)
        out.verdict = worst_by_cause(rows_of_output(self, out, limit_of(out)))
        out.peak, out.rms, out.end = features_of(self, out).values()
        return out

    def reason(self, e: str) -> str:
        """Return in words what estimator e assumes, why its bound is inf where it is, and why it has its scope."""
        check_choice("estimator", e, self.reasons)
        is_widest = self.scope[e] == widest_scope(self.scope)
        why = self.scope_reason if is_widest else with_doubts("", self.uncertified)
        return "; ".join(filter(None, [self.reasons[e], why]))

    def compare(self, name: str, t: Any, y: Any) -> OutputReport:
        """Compare an output with a truth.

        Parameters
        ----------
        name : str
        t : (T,), y : (T,) or (T, r)
            The truth at least at every instant of the report (s, unit of the output).

        Returns
        -------
        OutputReport
            The output, now with `.error` = y - value, `.effectivity` and, if it has an estimate, `.estimate_off`.

        Raises
        ------
        InputError
            Unknown output, wrong shapes, or an instant of the report that t lacks.
        """
        out = self.output(name)
        t, y = check_array("t", t, (None,)), real_array("y", y)
        if not t.size:
            raise InputError("t is empty; give the truth at report.t")
        y = check_array("y", y[:, None] if y.ndim == 1 else y, (len(t), out.value.shape[1]))
        out.error = y[instants_in(t, self.t)] - out.value
        truth = np.max(np.abs(out.error), axis=0)
        out.effectivity = {e: _ratio(np.max(bound, axis=0), truth) for e, bound in out.bound.items()}
        if out.estimate is not None:
            out.estimate_off = _ratio(np.max(np.abs(out.error - out.estimate), axis=0), truth, both_zero=0.0)
        return out

    def assess(self, name: str, tolerance: float, relative: bool = False, cause: str | None = None) -> Assessment:
        """Say whether the error of an output is within a tolerance at all instants, as far as that is known.

        "proven", "disproven": by bounds of scope complete with the time steps, rounding included. "likely",
        "unlikely": by the estimate with its half width. "unknown": else. Printed are "enough", "too large" and "not
        known". Table in docs/reading_the_answer.md.

        Parameters
        ----------
        name : str
            Of the output. Of several rows that counts of which the answer is worst.
        tolerance : float
            In the unit of the output, or with relative=True as a share of the largest |value| that its rows show
            together; of a position of how far it moves.
        cause : {"modes", "interfaces", "step", "start"}, optional
            Of that part of the error alone; nothing is proved of parts.

        Returns
        -------
        Assessment
            `.answer` as above; `.text`, one sentence with numbers and what to do next.

        Raises
        ------
        InputError
            Unknown output or cause; a tolerance that is not a positive finite number.
        """
        return assess(self, name, tolerance, relative, cause)

    def __repr__(self) -> str:
        axis, unit = ("load factor", "") if self.time == "static" else ("t", " s")
        span = f"{len(self.t)} instants, {axis} = {self.t[0]:g} .. {self.t[-1]:g}{unit}"
        return f"<BoundReport: {len(self.outputs)} output{'s' * (len(self.outputs) != 1)}, {span}>"

    def __str__(self) -> str:
        return self.summary()

    def summary(self, tolerance: Sequence[str] | str | float | None = None) -> str:
        """Return what print(report) shows, beside other tolerances than those that attach was given.

        Parameters
        ----------
        tolerance : number, text or several texts, optional
            As of romerr.run: 0.001, "1%" of what each output shows, "tip=0.001" of one output.

        Raises
        ------
        InputError
            A tolerance that is none, or of an output that there is not.
        """
        return summary(self, self._tolerances(tolerance))

    def _tolerances(self, given: Sequence[str] | str | float | None) -> Tolerances | None:
        if given is None:
            return None
        tolerances = tolerances_of(given)
        if wrong := tolerances.misspelt(self.outputs):
            raise InputError("; ".join(wrong))
        return tolerances

    @property
    def details(self) -> str:
        """Every component of every output, bounds by all estimators, corrected outputs, what is assumed."""
        return details(self)

    def save(self, path: str | os.PathLike) -> None:
        """Write everything to one .npz file (no pickle; readable without Exudyn).

        A file that is there already is replaced when all is written, and not before.

        Raises
        ------
        InputError
            The file cannot be written (disk full, no such folder); the report itself is as it was.
        """
        write_npz(self, path)
        self.origin = os.fspath(path)

    def plot(self, path: str | os.PathLike | None = None, outputs: list[str] | None = None) -> Any:
        """Draw signal with band, and bound (and true error) over time; save to path if given, return the figure."""
        from .plots.panels import plot_report

        return plot_report(self, path, outputs)

    def plot_causes(self, path: str | os.PathLike | None = None, outputs: list[str] | None = None) -> Any:
        """Draw what the bounds come from, in %, over time; save to path if given, return the figure."""
        from .plots.panels import plot_causes

        return plot_causes(self, path, outputs)

    def plot_body(self, mesh: Any, path: str | os.PathLike | None = None, **options: Any) -> Any:
        """Draw the body, coloured by errors at nodes; mesh, options: see surface.draw_body. Return the figure."""
        from .plots.body_surface import plot_body

        return plot_body(self, mesh, path, **options)

    def to_dict(self) -> dict[str, np.ndarray]:
        """Return everything over time as {name of a column: (T,)}, for pandas.DataFrame; see formats.columns."""
        return columns(self)

    def to_csv(self, path: str | os.PathLike) -> None:
        """Write the columns of to_dict to a CSV file; InputError if it cannot be written."""
        write_csv(self, path)

    def to_vtu(self, path: str | os.PathLike, mesh: Any = None, estimator: str | None = None) -> None:
        """Write mesh, displacement, node bound or estimate at the worst instant; see formats.vtu_file.write_vtu."""
        from .formats.vtu_file import write_vtu

        write_vtu(self, path, mesh, estimator)

    def to_html(self, path: str | os.PathLike, tolerance: Sequence[str] | str | float | None = None) -> None:
        """Write a page for others, one sheet of A4 in print, that needs no other file; InputError if it cannot.

        tolerance : as of summary().
        """
        from .formats.html_page import write_page

        write_page(self, path, self._tolerances(tolerance))


def _ratio(x: np.ndarray, truth: np.ndarray, both_zero: float = 1.0) -> np.ndarray:
    """Quotient of largest values; inf where only the truth is zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((x == 0) & (truth == 0), both_zero, x / truth)
