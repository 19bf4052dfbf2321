"""The code in README.md, docs/floating.md and docs/mechanisms.md runs; it prints what the README says."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)
BLOCKS = BLOCK.findall(README)
FLOATING, LINEAR, OWN_BODY = range(3)
NUMBER = re.compile(r"\d+\.?\d*(?:e[-+]\d+)?")


def shown_below(page, block):
    """Lines that a page shows as printed by a block of code."""
    text = page.partition(block)[2]
    return [line.strip() for line in re.match(r"```\n\n((?: {4}.*\n)+)", text)[1].splitlines()]


def assert_printed(shown, printed):
    """Same words; numbers within 1 % of one another, for other processors round differently."""
    for line in shown:
        (found,) = [other for other in printed.splitlines() if NUMBER.sub("", other.strip()) == NUMBER.sub("", line)]
        pairs = zip(NUMBER.findall(line), NUMBER.findall(found), strict=True)
        assert all(abs(float(a) - float(b)) <= 0.01 * abs(float(a)) for a, b in pairs)


@pytest.mark.parametrize("block", [FLOATING, LINEAR])
def test_script_prints_the_lines_that_the_readme_shows(block, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # Exudyn writes its solution file beside
    exec(BLOCKS[block], {})
    shown = shown_below(README, BLOCKS[block])
    assert len(shown) == 3
    assert_printed(shown, capsys.readouterr().out)


def test_page_on_floating_bodies_runs(capsys, tmp_path, monkeypatch):
    """Its blocks are one script."""
    monkeypatch.chdir(tmp_path)
    names = {}
    for block in BLOCK.findall((ROOT / "docs" / "floating.md").read_text(encoding="utf-8")):
        exec(block, names)
    assert set(names["report"].outputs) >= {"tip speed", "right face"}
    assert "scope complete" in capsys.readouterr().out


def test_page_on_mechanisms_runs_and_prints_what_it_shows(capsys):
    """Its blocks are one script."""
    page, names = (ROOT / "docs" / "mechanisms.md").read_text(encoding="utf-8"), {}
    for block in BLOCK.findall(page):
        exec(block, names)
        if block.startswith(("bound = ", "def build")):
            assert_printed(shown_below(page, block), capsys.readouterr().out)
    assert [set(report.scope.values()) for report in names["reports"]] == [{"coupled (linearised)"}] * 2


def test_page_on_the_number_of_modes_runs_and_prints_what_it_shows(capsys):
    """Its blocks are one script."""
    page, names = (ROOT / "docs" / "how_many_modes.md").read_text(encoding="utf-8"), {}
    for block in BLOCK.findall(page):
        exec(block, names)
        assert_printed(shown_below(page, block), capsys.readouterr().out)
    assert (names["choice"].n, names["choice"].limit) == (5, None)


def test_own_body_can_be_bounded():
    """The last block defines all that attach needs."""
    import exudyn as exu

    import exudyn_romerr as romerr

    names = {}
    exec(BLOCKS[OWN_BODY], names)
    SC = exu.SystemContainer()
    mbs = SC.AddSystem()
    flex = romerr.add_reduced_body(
        mbs, names["body"], names["basis"], inputs=names["B"], input_function=names["force"]
    )
    monitor = romerr.attach(mbs, flex, outputs=[names["last"]])
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = 50
    settings.timeIntegration.endTime = 0.05
    settings.solution.file.write = False
    mbs.SolveDynamic(settings)
    out = monitor.report().output("last mass")
    assert 0 < out.bound["best"].max() < 0.05 * abs(out.value).max()
