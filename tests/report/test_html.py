"""The HTML page: strictly well formed, nothing from outside, names escaped, one sheet of A4, words of the report."""

import base64
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.image import imread

from exudyn_romerr import Output, load_report
from exudyn_romerr.report.answers import Tolerances
from exudyn_romerr.report.assessment import rows_of
from exudyn_romerr.report.causes import ESTIMATE_PARTS
from exudyn_romerr.report.formats import html_page as page
from exudyn_romerr.report.judgement import judged, messages
from exudyn_romerr.report.scope import NOT_CERTIFIED, Doubt, with_doubts
from exudyn_romerr.report.verdict_text import summary
from exudyn_romerr.report.wording import SAMPLED, assumed_lines, digits, rounded_up
from tests.helpers.theorem import random_case

VOID = {"meta", "link", "img", "br", "hr"}
KNOWN = VOID | set(
    "html head title style body h1 h2 p div ul li figure figcaption table caption thead tbody tr th td span pre "
    "svg g path rect defs use clippath text tspan".split()
)
HEADINGS = ["What was assumed, and what to know", "How to repeat it"]
NASTY = """<script>alert("1")</script> & 'Größe' </td>"""
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)


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

    def handle_startendtag(self, tag, attributes):
        """<path/> in a picture."""
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.handle_endtag(tag)

    def check_attribute(self, name, value):
        assert not name.startswith("on")
        if name == "id":
            self.ids.append(value)
        elif name == "src":
            assert value.startswith("data:image/")
            self.images.append(value)
        elif name in ("href", "xlink:href"):
            assert value == "data:," or value.startswith("#")
            self.targets += [value[1:]] if value.startswith("#") else []
        elif not name.startswith("xmlns"):
            assert not re.search(r"\w+://|url\((?!#)", value)

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
    monkeypatch.setattr(page, "_drawn", lambda *_: "")


def read(report, tolerances=None):
    return Strict(page.page(report, tolerances))


def estimated(report, size):
    """Give all outputs an estimate of that share of their values, a tenth of it by each cause but the first."""
    for out in report.outputs.values():
        parts = [(0.1 if cause != "basis" else 1.0) * size * out.value for cause in ESTIMATE_PARTS]
        out.estimate_parts = dict(zip(ESTIMATE_PARTS, parts, strict=True))
        out.estimate, out.uncertainty = sum(parts), 0.1 * size * np.abs(out.value)
        out.uncertainty_parts = {"vectors": out.uncertainty}
    return report


def test_the_page_is_well_formed_and_complete(report, tmp_path):
    """With its picture, as written to a file."""
    report.to_html(tmp_path / "run.html")
    text = (tmp_path / "run.html").read_bytes().decode("utf-8")
    found = Strict(text)
    assert text.startswith('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">')
    assert found.of("h2") == HEADINGS
    assert text.count("<svg ") == 1
    assert {"reduced model", "tolerance"} < set(found.of("text"))


def test_the_picture_has_the_colours_of_the_page(report):
    """Letters and axes are those of a light and of a dark page; error, estimate and bound keep theirs apart."""
    estimated(report, 0.1)
    for out in report.outputs.values():
        out.error = 0.5 * out.estimate
    text = page.page(report)
    picture, css = text.partition("<svg ")[2].partition("</svg>")[0], Strict(text).of("style")[0]
    used = set(re.findall(r"var\(--(\w+)\)", picture))
    assert {"text", "estimate", "error", "quiet"} <= used
    assert not re.search("#000000|#1a1a1a", picture)
    light, dark = (
        dict(re.findall(r"--(\w+): (#\w+)", rule)) for rule in re.findall(r":root \{(.*?)\}", css, re.DOTALL)
    )
    assert light.keys() == dark.keys() > used
    assert all(len({of[name] for name in used}) == len(used) for of in (light, dark))


def test_the_style_asks_for_nothing(report, quick):
    (style,) = read(report).of("style")
    assert not re.search(r"url\(|@import|expression", style)
    assert style.count("{") == style.count("}")


def test_long_runs_have_pictures_of_pixels(report, monkeypatch):
    """As vectors they would make the page large and slow."""
    monkeypatch.setattr(page, "RASTER_FROM", len(report.t) - 1)
    (image,) = read(report).images
    kind, _, data = image.partition(",")
    assert kind == "data:image/png;base64"
    assert base64.b64decode(data, validate=True).startswith(b"\x89PNG")


def cells(text, caption):
    """Rows of the table with that caption, cell by cell."""
    table = text.partition(f"<caption>{caption}")[2].partition("</table>")[0]
    plain = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in re.findall("<tr>(.*?)</tr>", table)]
    return [[re.sub("<[^>]*>", "", cell) for cell in row] for row in plain]


@pytest.mark.usefixtures("quick")
def test_the_answer_comes_first_then_each_cause_with_its_numbers(report):
    """Of each cause the component with the largest share; half widths apart, or in what is not resolved."""
    text = page.page(estimated(report, 0.1))
    rows = rows_of(report)
    assert text.index(summary(rows, "output", "")[:30]) < text.index("Answer by cause")
    head, *lines = cells(text, "Answer by cause")
    assert head == ["cause", "answer", "about", "+- half width", "at most", "worst at", "what to do"]
    assert [line[0] for line in lines] == ["modes", "rigid interfaces", "step", "start", "whole error"]
    for cause, line in (("modes", lines[0]), ("sum", lines[-1])):
        (row,) = (row for row in rows if row.label == line[5])
        verdict = row.of[cause]
        assert row.share(cause) == max(other.share(cause) for other in rows)
        assert line[1].endswith("too large")
        assert line[2].startswith(f"{digits(verdict.size, 2)} m (")
        assert line[3] == f"{rounded_up(float(f'{verdict.half_width:.3g}'), 2)} m"
    # energy and fast are bounds of this body's whole error, steps left out: of modes, then
    assert lines[-1][4] == "\N{EN DASH}"
    assert lines[0][4].endswith("(modes)")
    for out in report.outputs.values():
        out.uncertainty = out.uncertainty_parts["vectors"] = np.abs(out.estimate)
    modes = cells(page.page(report), "Answer by cause")[1]
    assert "or less" in modes[2]
    assert modes[3] == "included"


@pytest.mark.usefixtures("quick")
def test_a_bound_of_the_whole_error_stands_with_the_whole_error(case):
    report = case.report(outputs=[Output("tip", case.C[0])], estimators="energy", time="reconstructed")
    (line,) = cells(page.page(report), "Answer by cause")[1:]
    assert line[0] == "whole error"
    out = report.output("tip")
    assert line[2] == rounded_up(np.max(out.bound["best"] + out.round_off), 2)


@pytest.mark.usefixtures("quick")
def test_outputs_have_a_line_each_the_worst_first(report):
    """Of many the worst, by their worst component; how many there are is said. Names that are cut differ still."""
    out = report.output("corner")
    out.round_off = 0.0 * out.round_off
    size = np.array([1.0, 0.0])  # of components
    names = [f"output {'of a body ' * 5}number {k}" for k in range(10)]
    report.outputs = {
        name: replace(out, name=name, value=out.value * size[:: 1 - 2 * (k % 2)], tolerance=10.0**-k)
        for k, name in enumerate(names)
    }
    text = page.page(estimated(report, 0.1))
    lines = cells(text, f"Outputs, the {page.ROWS} worst of 10")[1:]
    worst = range(9, 9 - page.ROWS, -1)
    assert [line[0].split()[-2:] for line in lines] == [[str(k), "xy"[k % 2]] for k in worst]
    assert [float(line[2].split()[0]) for line in lines] == [10.0**-k for k in worst]
    assert "None was given" not in text


@pytest.mark.usefixtures("quick")
def test_what_a_tolerance_names_is_asked_for(report):
    """Though it stands beside another output alone: as it is printed. How to repeat it has the tolerance."""
    beside = replace(report.output("corner"), name="tip z in the frame")
    report.outputs = {"tip z": report.output("tip z"), beside.name: beside}
    asked = ["tip z=1e9", "tip z in the frame=1e-30"]
    report.origin = "run.npz"
    first = report.summary(asked).splitlines()[1]
    assert "tip z in the frame" in first
    found = read(report, Tolerances(asked))
    assert first in found.words
    assert 'romerr report --tolerance "tip z=1e9" --tolerance "tip z in the frame=1e-30" run.npz' in found.words


@pytest.mark.usefixtures("quick")
def test_a_truth_outside_the_bound_is_said(report):
    out = report.output("tip z")
    truth = out.value + 0.5 * out.bound["best"]
    truth[5:8] = out.value[5:8] + 1.5 * out.bound["best"][5:8]
    report.compare("tip z", report.t, truth)
    found = read(report).words
    assert f"tip z: true error up to {np.abs(out.error).max():.3g} m; bound / error: fast " in found
    assert "at 3 instants the true error of" in found
    out.round_off = out.bound["best"]  # no more is known than that the truth is within both
    assert "above the bound" not in read(report).words


def test_names_and_messages_are_escaped(report):
    """As text they are whole, as elements they do not exist: the parser knows no <script>."""
    out = report.outputs["tip z"]
    report.outputs = {NASTY: replace(out, name=NASTY, unit="<m>")}
    report.messages, report.origin = [NASTY], "<i>&.npz"
    report.made = {**report.made, "script": f"{NASTY}.py", "arguments": NASTY}
    found = read(report)
    assert NASTY in found.of("li")
    assert found.of("h1") == [f"Accuracy of {NASTY.rpartition('/')[2]}.py"]
    assert f"{NASTY}.py {NASTY}" in found.of("pre")[0]
    assert "'<i>&.npz'" in found.of("pre")[0]


@pytest.mark.usefixtures("quick")
def test_messages_and_what_was_assumed_are_there(report):
    report.messages = ["first message", "second message"]
    report.uncertified = (Doubt("sudden start", "let loads begin smoothly"),)
    report.scope_reason = with_doubts("loads follow", report.uncertified)
    for out in report.outputs.values():
        out.uncertified = report.uncertified
    found = read(report)
    assert found.of("li")[:2] == ["first message", "second message"]
    assert f"{NOT_CERTIFIED}: sudden start: let loads begin smoothly" in found.of("li")
    assert SAMPLED in found.of("li")
    assert not re.search(r"at most\W+[\d.]", found.words)
    assert page.NEVER in found.words


@pytest.mark.usefixtures("quick")
def test_what_there_is_no_room_for_is_counted(report):
    """The first messages stay; the number of the others stands last."""
    report.messages = [f"message {k}: {'word ' * 200}" for k in range(9)]
    *told, last = read(report).of("li")
    assert told[0].startswith("message 0: ")
    assert len(told[0]) <= page.TEXT
    left = int(last.split()[0])
    assert last == page.MORE.format(left)
    assert len(told) + left == len([*messages(report), *judged(report, None)[2], *assumed_lines(report)])


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("time", ["static", "reconstructed"])
def test_a_clean_run(report, time):
    found = read(replace(report, time=time, messages=[]))
    assert NOT_CERTIFIED not in found.words
    assert SAMPLED not in found.words
    assert ("Static solve" in found.words) == ("load factor" in found.words) == (time == "static")


def test_a_run_without_outputs_has_a_page(report):
    found = read(replace(report, outputs={}))
    assert "only the error of the whole body is bounded" in found.words
    assert found.of("figcaption") == []


@pytest.mark.usefixtures("quick")
def test_a_page_says_how_to_repeat_it_and_by_what_it_was_made(report, tmp_path):
    """A loaded report has the same page."""
    report.made = {**report.made, "script": "some/model.py", "arguments": "--speed 3"}
    assert read(report).of("pre") == ["python some/model.py --speed 3"]
    path = tmp_path / "run.npz"
    report.save(path)
    found, again = read(report), read(load_report(path))
    assert found.of("pre") == [f"python some/model.py --speed 3\nromerr report {path}"]
    assert found.of("h1") == found.of("title") == ["Accuracy of model.py"]
    assert f"numpy {report.made['numpy']}" in found.words
    assert report.made["date"] in found.words
    assert again.texts == found.texts
    report.made["options"] = "--interfaces rigid"  # romerr run has made it
    assert read(report).of("pre") == ["romerr run --html page.html --interfaces rigid some/model.py --speed 3"]


# --- as a browser shows it ---


def fullest(report):
    """A page with all that it can have: five causes, many outputs of long names, long messages, a deep folder."""
    out = report.output("corner")
    names = [f"sensor of the body {'x' * 30} with a long name {k}" for k in range(20)]
    report.outputs = {name: replace(out, name=name) for name in names}
    report.messages = [f"message {k}: {'word ' * 90}" for k in range(9)]
    report.origin = f"/home/{'folder/' * 40}run.npz"
    report.made = {**report.made, "script": f"{'folder/' * 40}model.py", "arguments": "--speed " * 40}
    return estimated(report, 0.1)


@pytest.mark.skipif(BROWSER is None, reason="needs Chromium or Chrome")
def test_it_is_one_sheet_in_print_and_light_or_dark_on_screen(report, tmp_path):
    """The fullest page fits; nothing of it is cut."""
    (tmp_path / "run.html").write_text(page.page(fullest(report)), encoding="utf-8")

    def shown(*options):
        own = ("--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}")
        command = [BROWSER, *own, *options, (tmp_path / "run.html").as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=60)

    shown(f"--print-to-pdf={tmp_path / 'run.pdf'}", "--no-pdf-header-footer")
    printed = (tmp_path / "run.pdf").read_bytes()
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 1
    (box,) = re.findall(rb"/MediaBox\s*\[\s*0 0 ([\d.]+) ([\d.]+)", printed)
    assert np.allclose([float(x) / 72 * 25.4 for x in box], [210, 297], atol=0.5)  # mm
    for options, is_dark in ([], False), (["--force-dark-mode"], True):
        shown(*options, "--window-size=800,600", f"--screenshot={tmp_path / 'run.png'}")
        pixels = imread(tmp_path / "run.png")[:, :, :3].mean(axis=2)
        assert (np.median(pixels) < 0.3) == is_dark
        assert 0.02 < np.mean(np.abs(pixels - np.median(pixels)) > 0.4) < 0.5  # there is something to be read
