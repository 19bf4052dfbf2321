"""The HTML page: strictly well formed, nothing from outside, names escaped, the report's own numbers and words."""

import base64
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from exudyn_romerr import Output, load_report
from exudyn_romerr.report.answers import Tolerances
from exudyn_romerr.report.assessment import rows_of
from exudyn_romerr.report.formats import html_page as page
from exudyn_romerr.report.scope import NOT_CERTIFIED, Doubt, with_doubts
from exudyn_romerr.report.verdict_text import ASSESS, by_sensor, summary, table
from exudyn_romerr.report.wording import SAMPLED, rounded_up
from tests.helpers.theorem import random_case

VOID = {"meta", "link", "img", "br", "hr"}
KNOWN = VOID | set(
    "html head title style body h1 h2 p a b section div ul li figure figcaption table caption thead tbody tr th td "
    "span pre".split()
)
HEADINGS = [
    "Messages",
    "What the bounds cover",
    "Figures",
    "Tables",
    "Plan",
    "Versions",
    "Make it again",
]
NASTY = """<script>alert("1")</script> & 'Größe' </td>"""
PICTURE = "data:image/png;base64,AAAA"


class Strict(HTMLParser):
    """Refuses what a browser would silently repair or fetch; keeps text by element."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.ids, self.targets, self.images, self.texts = [], [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []
        assert len(set(self.ids)) == len(self.ids)
        assert set(self.targets) <= set(self.ids)

    def handle_starttag(self, tag, attributes):
        assert tag in KNOWN
        assert len({name for name, _ in attributes}) == len(attributes)
        for name, value in attributes:
            self.check_attribute(name, value)
        if tag not in VOID:
            self.open.append(tag)

    def check_attribute(self, name, value):
        assert not name.startswith("on")
        if name == "id":
            self.ids.append(value)
        elif name == "src":
            assert value.startswith("data:image/")
            self.images.append(value)
        elif name == "href":
            assert value == "data:," or value.startswith("#")
            self.targets += [value[1:]] if value.startswith("#") else []
        else:
            assert not re.search(r"\w+://", value)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append((self.open[-1] if self.open else "", data))

    def of(self, *tags):
        """Text of the given elements."""
        return [text for tag, text in self.texts if tag in tags]

    @property
    def words(self):
        """All text, white space made single."""
        return re.sub(r"\s+", " ", "".join(text for tag, text in self.texts if tag != "style"))


@pytest.fixture
def case():
    return random_case(1, steps=20)


@pytest.fixture
def report(case):
    """Outputs "tip z" and "corner" (x, y)."""
    outputs = [Output("tip z", case.C[0], unit="m"), Output("corner", case.C, unit="m", labels=("x", "y"))]
    return case.report(outputs=outputs, estimators=("fast", "energy"))


@pytest.fixture
def quick(monkeypatch):
    """Pages without drawing."""
    monkeypatch.setattr(page, "_picture", lambda *_: PICTURE)


def read(report):
    return Strict(page.page(report))


def test_the_page_is_well_formed_and_complete(report, tmp_path):
    """With real pictures, as written to a file: each is an SVG that needs nothing else."""
    report.to_html(tmp_path / "run.html")
    text = (tmp_path / "run.html").read_bytes().decode("utf-8")
    found = Strict(text)
    assert text.startswith('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">')
    assert found.of("h2") == HEADINGS
    assert len(found.images) == 3
    for image in found.images:
        kind, _, data = image.partition(",")
        assert kind == "data:image/svg+xml;base64"
        for element in ElementTree.fromstring(base64.b64decode(data, validate=True)).iter():
            links = [value for name, value in element.attrib.items() if name.endswith("href")]
            assert all(value.startswith("#") for value in links)


def test_the_style_asks_for_nothing_and_for_print(report, quick):
    (style,) = read(report).of("style")
    assert not re.search(r"url\(|@import|expression", style)
    assert style.count("{") == style.count("}")
    assert "@media print" in style


def test_long_runs_have_pictures_of_pixels(report, monkeypatch):
    """As vectors they would make the page large and slow."""
    monkeypatch.setattr(page, "RASTER_FROM", len(report.t) - 1)
    del report.outputs["corner"]
    (image,) = read(report).images
    kind, _, data = image.partition(",")
    assert kind == "data:image/png;base64"
    assert base64.b64decode(data, validate=True).startswith(b"\x89PNG")


@pytest.mark.usefixtures("quick")
def test_pages_of_many_rows_have_figures_of_the_worst(case):
    """Of three outputs of three rows six: the worst of each, and the next; the others are named."""
    C = np.vstack([case.C[0] * size for size in (1.0, 1e-6, 0.5)])
    outputs = [Output(name, C, labels=("x", "y", "z")) for name in ("one", "two", "three")]
    report = case.report(outputs=outputs, estimators=("fast", "energy"))
    found = read(report)
    assert len(found.images) == page.MOST == 6
    (left,) = [text for text in found.of("p") if "Not drawn" in text]
    assert "one y, two y, three y. report.plot(" in left
    del report.outputs["three"]
    assert len(read(report).images) == 6
    assert not any("Not drawn" in text for text in read(report).of("p"))


@pytest.mark.usefixtures("quick")
def test_every_output_has_a_figure_before_one_has_two(case):
    rows = {"small": 1.0, "large": 1.0, "still": 0.0}
    outputs = [Output(name, np.vstack([size * case.C[0]] * 5), labels=tuple("abcde")) for name, size in rows.items()]
    report = case.report(outputs=outputs, estimators=("fast", "energy"))
    drawn = {image for image in read(report).of("figcaption")}
    assert {text.split()[0] for text in drawn} == set(rows)


@pytest.mark.usefixtures("quick")
def test_answers_come_first_then_tables_of_outputs_and_components(report):
    """The words that are printed."""
    found, rows = read(report), rows_of(report)
    assert found.words.index(summary(rows, "output", ASSESS)) < found.words.index("All outputs")
    assert found.of("caption")[:2] == ["All outputs", "All components"]
    for made in (by_sensor(rows), rows):
        for line in table(made, "output")[1:]:
            assert "".join(line) in found.words.replace("  ", " ")  # cells have nothing between them
    assert found.words.index("All components") < found.words.index("Messages")


@pytest.mark.usefixtures("quick")
def test_what_a_tolerance_names_is_asked_for(report):
    """Though it stands beside another output alone: as it is printed."""
    beside = replace(report.output("corner"), name="tip z in the frame")
    report.outputs = {"tip z": report.output("tip z"), beside.name: beside}
    asked = ["tip z=1e9", "tip z in the frame=1e-30"]
    first = report.summary(asked).splitlines()[1]
    assert "tip z in the frame" in first
    assert first in Strict(page.page(report, Tolerances(asked))).words


@pytest.mark.usefixtures("quick")
def test_tables_have_the_largest_values_and_when(report, case):
    """Of everything over time: bounds of every estimator, estimates with their parts; what a truth says beside."""
    out = report.output("tip z")
    assert page.ABOUT not in read(report).words
    for bounds, e in ((out.bound, "energy"), (report.position_bound, "fast"), (report.velocity_bound, "energy")):
        bounds[e] = bounds[e].copy()
        bounds[e][7] *= 1e6  # the worst instant is not always the last one
    out.estimate, out.uncertainty = 0.1 * out.value, 0.01 * np.abs(out.value)
    out.estimate_parts, out.uncertainty_parts = {"basis": out.estimate}, {"vectors": out.uncertainty}
    report.compare("tip z", report.t, case.full[0] @ case.C[0])
    found = read(report)
    of_body = (*report.position_bound.values(), *report.velocity_bound.values())
    for x, unit in [*((out.bound[e], " m") for e in ("fast", "energy")), *((x, "") for x in of_body)]:
        assert f"{rounded_up(np.max(x))}{unit} at t = {report.t[np.argmax(x)]:.4g} s" in found.words
    largest, at = np.max(np.abs(out.value)), report.t[np.argmax(np.abs(out.value))]
    sizes = (f"{0.1 * largest:.3g}", f"{rounded_up(0.01 * largest)}")
    for kind, size in zip(
        ("estimate", "uncertainty", "estimate basis", "uncertainty vectors"), 2 * sizes, strict=True
    ):
        assert f"{kind}{size} m at t = {at:.4g} s" in found.words
    assert page.ABOUT in found.words
    assert f"tip z: true error up to {np.abs(out.error).max():.3g} m; bound / error: fast " in found.words
    ratio = np.max(out.bound["energy"]) / np.abs(out.error).max()
    assert f"energy {ratio:.3g}; the estimate is off by up to " in found.words
    assert "above the bound" not in found.words


@pytest.mark.usefixtures("quick")
def test_a_truth_outside_the_bound_is_said(report):
    out = report.output("tip z")
    truth = out.value + 0.5 * out.bound["best"]
    truth[5:8] = out.value[5:8] + 1.5 * out.bound["best"][5:8]
    report.compare("tip z", report.t, truth)
    assert "at 3 instants the true error of" in read(report).words
    out.round_off = out.bound["best"]  # no more is known than that the truth is within both
    assert "above the bound" not in read(report).words


@pytest.mark.usefixtures("quick")
def test_names_and_messages_are_escaped(report):
    """As text they are whole, as elements they do not exist: the parser knows no <script>."""
    out = report.outputs.pop("tip z")
    report.outputs = {NASTY: replace(out, name=NASTY, unit="<m>"), **report.outputs}
    report.messages, report.scope_reason, report.origin = [NASTY], NASTY, "<i>&.npz"
    report.made = {**report.made, "script": NASTY}
    found = read(report)
    assert NASTY in found.of("td")
    assert NASTY in found.of("li")
    assert found.of("h1", "title") == ["Error bounds of <i>&.npz"] * 2
    assert f"Why: {NASTY}." in found.words


@pytest.mark.usefixtures("quick")
def test_messages_scope_plan_and_what_was_left_out_are_there(report):
    report.messages = ["first message", "second message"]
    report.uncertified = (Doubt("sudden start", "let loads begin smoothly"),)
    report.scope_reason = with_doubts("loads follow", report.uncertified)
    for out in report.outputs.values():
        out.uncertified = report.uncertified
    found = read(report)
    assert found.targets == ["messages"]
    assert {"first message", "second message", *report.plan.computed} <= set(found.of("li"))
    assert all(what in found.words and why in found.words for what, why in report.plan.left_out)
    assert f"Why: loads follow; sudden start: {NOT_CERTIFIED}." in found.words
    assert "at most" not in found.words
    assert f"{NOT_CERTIFIED}: sudden start: let loads begin smoothly" in found.of("li")
    assert SAMPLED in found.of("li")


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("time", ["static", "reconstructed"])
def test_a_clean_run_refers_to_no_messages(report, time):
    found = read(replace(report, time=time, messages=[]))
    assert found.targets == []
    assert NOT_CERTIFIED not in found.words
    assert SAMPLED not in found.words
    assert ("load factor" in found.words) == (time == "static")


@pytest.mark.usefixtures("quick")
def test_a_run_without_outputs_has_a_page(report):
    found = read(replace(report, outputs={}))
    assert "only the error of the whole body is bounded" in found.words
    assert found.images == []


@pytest.mark.usefixtures("quick")
def test_a_saved_page_says_how_to_make_it_again_and_by_what_it_was_made(report, tmp_path):
    """A loaded report has the same page."""
    assert "This report was not saved" in read(report).words
    path = tmp_path / "run.npz"
    report.save(path)
    found, again = read(report), read(load_report(path))
    assert f'romerr report "{path}"' in found.of("pre")[0]
    assert f"romerr.load_report({str(path)!r})" in found.of("pre")[1]
    assert found.of("h1") == ["Error bounds of run.npz"]
    assert report.made["numpy"] in found.of("td")
    assert report.made["date"] in found.of("td")
    assert [text for text in again.texts if report.made["date"] not in text[1]] == [
        text for text in found.texts if report.made["date"] not in text[1]
    ]
