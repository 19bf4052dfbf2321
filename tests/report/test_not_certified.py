"""Runs that are not certified: no format says "at most" of them, and each says why, for every cause that there is."""

import pickle
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.linear.run.balance import Balance, SolverFacts
from exudyn_romerr.linear.run.record import doubts_in
from exudyn_romerr.mbs.monitoring.body_monitor import MonitoredBody, ToleranceCheck
from exudyn_romerr.mbs.monitoring.step_hook import live_line
from exudyn_romerr.mbs.studies.sweeps import text_of
from exudyn_romerr.mbs.studies.two_level import LevelOutput
from exudyn_romerr.mode_selection.modal_forecast import Forecast
from exudyn_romerr.mode_selection.mode_choice import ModeChoice, TriedRun
from exudyn_romerr.report.assessment import of_estimates
from exudyn_romerr.report.data import NodeFields
from exudyn_romerr.report.formats import html_page
from exudyn_romerr.report.mechanism_report import joined
from exudyn_romerr.report.plots.body_surface import draw_body
from exudyn_romerr.report.plots.over_time import draw_bounds, draw_causes, draw_signal
from exudyn_romerr.report.plots.panels import plot_causes, plot_report
from exudyn_romerr.report.plots.style import new_figure, picture
from exudyn_romerr.report.scope import COUPLED, FROZEN, NOT_CERTIFIED, SCOPES, Doubt, Reason, with_doubts
from tests.helpers.report_outputs import output
from tests.helpers.theorem import random_case
from tests.report.saved_files import rewritten

MISSED = Balance(SimpleNamespace(scene=SimpleNamespace(checked=True), samples_precision=0.0))
MISSED.measure(np.diag([0.0, 0.0, 0.01, 1.0]), np.array([[1.0, 1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1e-9]]), 0.0)
DOUBTS = {
    "goes on": Reason.GOES_ON.doubt(),
    "begins late": Reason.NO_ACCELERATIONS.doubt(0.1),
    "nothing to check": Reason.UNCHECKED.doubt(),
    "not balanced": MISSED.doubts(SolverFacts())[0],
}
CLAIM = re.compile(r"at most|bounded by|<= \d|within \d|error bound|\bbound \d")
PROMISES = re.compile(r"at most")
SHOWN = dict.fromkeys(("energy", "auxiliary"), np.array([1.0, 2.0, 0.5, 3.0]))
POSITIONS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


@pytest.fixture(scope="module")
def plain():
    """Of a chain with two displacement rows and two velocity rows; a tolerance, a truth and bounds at nodes."""
    case = random_case(1, steps=40)
    report = case.report(estimators=("energy", "auxiliary"), auxiliary_modes=2)
    moved = {e: np.zeros((4, 3)) for e in SHOWN}
    report.nodes = NodeFields(SHOWN, {}, moved, dict.fromkeys(SHOWN, 0.0), POSITIONS)
    report.compare("y", report.t, case.full[0] @ case.C.T)
    return report


def test_there_is_one_of_every_reason():
    assert sorted(doubt.reason for doubt in DOUBTS.values()) == sorted(reason.name for reason in Reason)
    assert [Doubt(*doubt.__getnewargs__()) for doubt in DOUBTS.values()] == [*DOUBTS.values()]


TABLE = (Path(__file__).parents[2] / "docs/limits.md").read_text(encoding="utf-8").partition("## Not certified")[2]


def test_the_table_of_limits_has_every_reason():
    assert all(f"`{reason.name}`" in TABLE for reason in Reason)


@pytest.mark.parametrize("name", DOUBTS)
def test_the_page_has_every_cause(name):
    """By its first words: some go on with numbers."""
    assert f"\n| {' '.join(DOUBTS[name].cause.split()[:6])}" in TABLE


def doubted(report, *doubts, scope=None):
    """The same, not certified."""
    scope = dict.fromkeys(report.scope, scope or "complete")
    covers = {"uncertified": doubts, "estimate_scope": ""}  # an estimate covers what bounds do
    outputs = {name: replace(out, **covers) for name, out in report.outputs.items()}
    return replace(
        report,
        outputs=outputs,
        uncertified=doubts,
        scope=scope,
        scope_reason=with_doubts("", doubts),
        messages=[*doubts],
    )


def printed(report, folder):
    return str(report)


def in_detail(report, folder):
    return report.details


def loaded(report, folder):
    report.save(folder / "run.npz")
    return str(romerr.load_report(folder / "run.npz"))


def unpickled(report, folder):
    return str(pickle.loads(pickle.dumps(report)))


def in_html(report, folder):
    page = re.sub(r'src="[^"]*"', "", html_page.page(report))
    return re.sub(r"<[^>]*>", "", page.replace("</p>\n<p", "</p> <p")).replace("&#x27;", "'").replace("&lt;", "<")


def told(report, folder):
    """Reasons that a user's script asks for."""
    return "\n".join(map(report.reason, report.scope))


def chosen(report, folder, allowed=2.0):
    out = report.output("y")
    size = float(np.max(out.bound["best"]))
    forecast = Forecast((0, 1), np.full((1, 1), size), np.zeros((1, 1)), np.zeros((2, 1, 1)))
    run = TriedRun((0, 1), None, {"y": allowed * size}, (report,), {"y": forecast}, False)
    return str(ModeChoice(run, (run,), None, None))


def of_two_levels(report, folder):
    out, kinds = report.output("y"), ("error", "error")
    known = ("y", "m", out.value, out.value, out.bound["best"], next(iter(report.scope.values())))
    return str(LevelOutput(*known, out.estimate, out.uncertainty, "bound", kinds, out.uncertified))


TEXTS = [printed, in_detail, loaded, unpickled, in_html, told, of_two_levels]


@pytest.mark.parametrize("scope", SCOPES)
@pytest.mark.parametrize("cause", DOUBTS)
@pytest.mark.parametrize("text", TEXTS, ids=lambda f: f.__name__)
def test_every_text_says_why_and_nothing_is_promised(plain, text, cause, scope, tmp_path, monkeypatch):
    monkeypatch.setattr(html_page, "_drawn", lambda *given: "")
    said = text(doubted(plain, DOUBTS[cause], scope=scope), tmp_path)
    assert not PROMISES.search(said)
    assert DOUBTS[cause].cause in said
    claims = [line for line in said.splitlines() if CLAIM.search(line)]
    assert all(NOT_CERTIFIED in line or "certified: " in line for line in claims)
    certain = text(doubted(plain, scope=scope), tmp_path)
    assert NOT_CERTIFIED not in certain
    tells_none = text is told or (text is in_html and scope == FROZEN)  # a customer takes no bound of a part for one
    assert tells_none or CLAIM.search(certain)


@pytest.mark.parametrize("cause", DOUBTS)
def test_assessments_prove_nothing(plain, cause):
    """What concerns estimates, too, is said with its cure; of other runs "likely" is left in place of "proven"."""
    doubt = DOUBTS[cause]
    found = doubted(replace(plain, time="reconstructed"), doubt).assess("y", 1e9)
    assert replace(plain, time="reconstructed").assess("y", 1e9).answer == "proven"
    if of_estimates([doubt]):
        assert found.answer == "unknown"
        assert f"({doubt.cause}): {doubt.cure} (other rows: y row 1 not known)." in found.text
    else:
        assert found.answer == "likely"


@pytest.mark.parametrize("cause", DOUBTS)
def test_messages_are_made_of_doubts(cause):
    doubt = DOUBTS[cause]
    assert doubt == f"{doubt.said}. No bound of this run is certified: {doubt.cure}"
    assert doubt.cause != doubt.cure
    assert len(doubt.cause) < 80  # it stands in the sentence of every row


def test_tables_have_no_bound_that_is_not_certified(plain):
    """Which is below them with its condition; cause and cure are in a line of their own."""
    doubt = DOUBTS["not balanced"]
    report = doubted(plain, doubt, scope=COUPLED)
    assert " at most " in str(doubted(plain, scope=COUPLED))
    said = str(report)
    assert not PROMISES.search(said)
    assert f"  {NOT_CERTIFIED}: {doubt.cause}: {doubt.cure}" in said
    assert report.details.count(", to first order, not certified") >= len(report.outputs)


def is_claimed(column):
    return "bound" in column or "proved" in column


@pytest.mark.parametrize("scope", SCOPES)
def test_columns_say_so(plain, scope, tmp_path):
    """CSV, pandas, and the tables of sweeps: names of bounds, and of nothing else."""
    report = doubted(plain, DOUBTS["goes on"], scope=scope)
    report.to_csv(tmp_path / "run.csv")
    with open(tmp_path / "run.csv", encoding="utf-8") as file:
        assert file.readline().count(NOT_CERTIFIED) == sum(map(is_claimed, report.to_dict()))
    assert all(is_claimed(name) == (NOT_CERTIFIED in name) for name in report.to_dict())
    assert not any(NOT_CERTIFIED in name for name in doubted(plain, scope=scope).to_dict())


def test_tables_of_sweeps_say_so(plain, tmp_path):
    doubtful, kinds = doubted(plain, DOUBTS["goes on"]), []
    for report in (doubtful, plain):
        folder = tmp_path / str(len(kinds))
        romerr.sweep(lambda p, report=report: report, {"n": [1]}, folder=folder)
        kinds.append(text_of(folder))
    assert NOT_CERTIFIED in kinds[0]
    assert NOT_CERTIFIED not in kinds[1]


def texts_of(figure):
    """Everything that a picture says."""
    figure.draw_without_rendering()
    found = [text.get_text() for ax in figure.axes for text in (ax.title, ax.xaxis.label, ax.yaxis.label)]
    legends = [ax.get_legend() for ax in figure.axes]
    found += [text.get_text() for one in legends if one is not None for text in one.get_texts()]
    return [*found, figure.get_suptitle(), figure.get_supxlabel()]


@pytest.mark.parametrize("scope", SCOPES)
@pytest.mark.parametrize("draw", [draw_signal, draw_bounds, draw_causes], ids=lambda f: f.__name__)
def test_pictures_say_so(plain, draw, scope):
    """Legend and title, where they have a bound."""
    report = doubted(plain, DOUBTS["goes on"], scope=scope)
    found = [text.replace("\n", " ") for text in texts_of(picture(draw, None, report, "y"))]
    assert not any(PROMISES.search(text) for text in found)
    bounds = [text for text in found if re.search(r"\bbounds?\b", text) and "share of the" not in text]
    assert bounds
    assert all(NOT_CERTIFIED in text for text in bounds)
    certain = texts_of(picture(draw, None, doubted(plain, scope=scope), "y"))
    assert not any(NOT_CERTIFIED in text for text in certain)


@pytest.mark.parametrize("plot", [plot_report, plot_causes])
def test_pictures_of_several_outputs_say_why(plain, plot):
    doubt = DOUBTS["goes on"]
    assert f"not certified: {doubt.cause}" in plot(doubted(plain, doubt)).get_supxlabel().replace("\n", " ")
    assert NOT_CERTIFIED not in plot(doubted(plain)).get_supxlabel()


def test_a_body_s_picture_and_file_say_so(plain, tmp_path):
    doubt = DOUBTS["goes on"]
    report = doubted(plain, doubt)
    figure = picture(draw_body, None, report, (POSITIONS, None), projection="3d")
    title, label = figure.axes[0].get_title().replace("\n", " "), figure.axes[1].get_ylabel()
    assert f"bounded by 3 (not certified: {doubt.cause})" in title
    assert "bound (not certified) of the" in label
    report.to_vtu(tmp_path / "run.vtu")
    assert 'Name="error bound, not certified"' in (tmp_path / "run.vtu").read_text(encoding="utf-8")


def test_bands_on_existing_axes_say_so(plain):
    ax = new_figure(4, 3).subplots()
    ax.plot(plain.t, plain.output("y").value[:, 0])
    (band,) = romerr.add_bands(ax, doubted(plain, DOUBTS["goes on"]), "y")
    assert re.fullmatch(r"y row 1 ± bound up to \S+ m, not certified", band.get_label())


def test_stresses_keep_it():
    out = output(1.0, {"auxiliary": 1e-3}, {"auxiliary": "complete"}, uncertified=(DOUBTS["goes on"],))
    for name in ("value", "round_off"):
        setattr(out, name, np.tile(getattr(out, name), 6))
    out.bound = {e: np.tile(x, 6) for e, x in out.bound.items()}
    report = SimpleNamespace(output=lambda name: out, scope={"auxiliary": "complete"})
    assert romerr.von_mises(report, "s").uncertified == (DOUBTS["goes on"],)


class Bounded:
    """A run with bounds that rise to 2; what may speak against them."""

    offline = SimpleNamespace(scene=SimpleNamespace(scope=FROZEN))
    times = np.array([0.0, 1.0])

    def __init__(self, *messages):
        self.messages = list(messages)

    def doubts(self):
        return tuple(doubts_in(self.messages))

    def best_of_last(self, count):
        return {"tip": np.array([[0.5], [2.0]])[-count:]}

    def assumptions(self):
        return {"energy": ""}


def test_a_tolerance_that_stops_a_run_says_so():
    (said,) = ToleranceCheck({"tip": 1.0}).exceeded(Bounded(DOUBTS["goes on"]))
    assert said.endswith(f"2 > 1 (not certified: {DOUBTS['goes on'].cause})")
    (said,) = ToleranceCheck({"tip": 1.0}).exceeded(Bounded("another message"))
    assert said.endswith("2 > 1")


def test_lines_in_the_solver_s_output_say_so():
    def line(run):
        out = SimpleNamespace(name="tip", unit="m")
        watch = MonitoredBody(SimpleNamespace(outputs=[out], item=0), {})
        watch.run, watch.succession.last = run, (1.0,)
        return live_line([watch], 1.0)

    assert line(Bounded(DOUBTS["goes on"])) == "error bounds at t = 1: tip 2 m, inputs frozen, not certified\n"
    assert line(Bounded()) == "error bounds at t = 1: tip 2 m, inputs frozen\n"


# --- where doubts come from, and where they go ------------------------------


def test_mechanisms_have_the_doubts_of_all_bodies(plain):
    bodies = [doubted(plain, DOUBTS["goes on"]), doubted(plain, DOUBTS["goes on"], DOUBTS["begins late"])]
    for i, body in enumerate(bodies):
        body.outputs = {f"{name} {i}": replace(out, name=f"{name} {i}") for name, out in body.outputs.items()}
    other = replace(plain.output("y"), name="of no body")
    report = joined(bodies, [other], [])
    assert set(report.uncertified) == {DOUBTS["goes on"], DOUBTS["begins late"]}
    assert report.output("y 0").uncertified == (DOUBTS["goes on"],)
    assert report.assess("of no body", 1e9).answer == "unknown"
    assert not PROMISES.search(str(report))


@pytest.mark.parametrize("certified", [True, False])
def test_older_files_still_load(plain, certified, tmp_path):
    """They said it in the reason of the scope only, and why in messages."""
    report = replace(plain, scope_reason="loads follow" if certified else f"loads follow; {NOT_CERTIFIED}")
    report.save(tmp_path / "old.npz")
    rewritten(tmp_path / "old.npz", without=("uncertified", "uncertified_outputs"))
    again = romerr.load_report(tmp_path / "old.npz")
    assert [bool(again.uncertified), *(bool(o.uncertified) for o in again.outputs.values())] == [not certified] * 3
    assert bool(PROMISES.search(str(again))) == certified
    assert (replace(again, time="reconstructed").assess("y", 1e9).answer == "proven") == certified


def test_choices_of_modes_say_so(plain, tmp_path):
    report = doubted(plain, DOUBTS["goes on"], scope=FROZEN)
    said = chosen(report, tmp_path)
    assert f"its bounds (not certified: {DOUBTS['goes on'].cause}) are within the tolerance" in said
    assert re.search(r" <= \S+ m, not certified, \(allowed", said)
    assert NOT_CERTIFIED not in chosen(doubted(plain), tmp_path)
    assert DOUBTS["goes on"].cure in chosen(report, tmp_path, allowed=0.5)
