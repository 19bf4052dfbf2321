"""Units are printed where the user gave them: behind an output, or one of length for a whole report."""

import re

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.report.data import name_units, units_of_length
from exudyn_romerr.report.formats.html_page import page
from exudyn_romerr.report.plots.over_time import draw_bounds, draw_causes, draw_signal
from exudyn_romerr.report.plots.style import picture
from tests.helpers.mbs_scenes import INPUTS, N, chain_body, force, new_mbs, random_basis, settings

UNIT = re.compile(r"\d (m|N|Nm|Pa|mm)(/s)?\b(?! and)|[/\[] ?(m|N|Pa)\b|\[\]|/ *$", re.MULTILINE)


def report_of(**units):
    """Of a chain of masses: a position along, a velocity, and what nobody says anything about."""
    row = np.eye(N)[7]
    outputs = [
        romerr.Output("tip", row, quantity="displacement", **units),
        romerr.Output("speed", row, of="velocity", quantity="velocity", **units),
        romerr.Output("strain", row),
    ]
    mbs = new_mbs()
    flex = romerr.add_reduced_body(mbs, chain_body(), random_basis(), inputs=INPUTS, input_function=force)
    monitor = romerr.attach(mbs, flex, outputs=outputs)
    mbs.Assemble()
    mbs.SolveDynamic(settings())
    report = monitor.report()
    report.compare("tip", report.t, report.output("tip").value + 1e-3)
    return report


def texts(report):
    """All that is written of a report, by what it is."""
    labels = []
    for draw in (draw_signal, draw_bounds, draw_causes):
        ax = picture(draw, None, report, "tip", 0).axes[0]
        labels += [ax.get_ylabel(), ax.get_title(), *(text.get_text() for text in ax.get_legend().get_texts())]
    return {
        "printed": str(report),
        "details": report.details,
        "plan": str(report.plan),
        "columns": "\n".join(report.to_dict()),
        "html": re.sub(r"<svg.*?</svg>|<style.*?</style>", "", page(report), flags=re.DOTALL),
        "line": repr(report.output("tip")),
        "pictures": "\n".join(labels),
    }


def test_nothing_is_said_of_units_that_nobody_gave():
    for kind, text in texts(report_of()).items():
        assert not UNIT.search(text), (kind, UNIT.search(text))


def test_units_that_were_given_are_everywhere():
    found = texts(report_of(unit="inch"))
    assert all("inch" in text for text in found.values()), found


def test_a_unit_of_length_is_that_of_a_whole_report(tmp_path):
    report = report_of()
    report.save(tmp_path / "run.npz")
    for one in (report, romerr.load_report(tmp_path / "run.npz")):
        name_units(one.outputs.values(), "mm")
        assert {name: out.unit for name, out in one.outputs.items()} == {"tip": "mm", "speed": "mm/s", "strain": ""}
    given = report_of(unit="inch")
    name_units(given.outputs.values(), "mm")
    assert given.output("tip").unit == "inch"


@pytest.mark.parametrize(("length", "rates"), [("mm", ("mm/s", "mm/s^2")), ("", ("", ""))])
def test_units_that_follow_from_one_of_length(length, rates):
    units = units_of_length(length)
    assert {units[quantity] for quantity in ("displacement", "position", "distance")} == {length}
    assert (units["velocity"], units["acceleration"]) == rates


@pytest.mark.parametrize(
    "made",
    [
        romerr.node_displacement("o", node=0),
        romerr.node_velocity("o", node=0),
        romerr.mean_displacement("o", nodes=[0, 1]),
        romerr.relative_displacement("o", node=0, other=1),
        romerr.Output("o", np.ones(3)),
    ],
    ids=lambda out: out.quantity,
)
def test_makers_of_outputs_know_no_unit(made):
    assert made.unit == ""


def test_radians_are_the_same_in_all_systems():
    assert romerr.node_rotation("o", node=0).unit == romerr.mean_rotation("o", nodes=[0, 1, 2]).unit == "rad"
