"""The README's code runs and prints what the README says."""

import re
from pathlib import Path

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
NUMBER = re.compile(r"\d+\.?\d*(?:e[-+]\d+)?")


def test_script_prints_the_lines_that_the_readme_shows(capsys, tmp_path, monkeypatch):
    """Same words; numbers within 1 % of one another, for other processors round differently."""
    monkeypatch.chdir(tmp_path)  # Exudyn writes its solution file beside
    exec(BLOCKS[0], {})
    printed = capsys.readouterr().out
    shown = [
        line.strip() for line in re.findall(r"^ {4}(tip z.*|  \d+ % of.*|  the corrected.*)$", README, re.MULTILINE)
    ]
    assert len(shown) == 3
    for line in shown:
        (found,) = [other for other in printed.splitlines() if NUMBER.sub("", other.strip()) == NUMBER.sub("", line)]
        pairs = zip(NUMBER.findall(line), NUMBER.findall(found), strict=True)
        assert all(abs(float(a) - float(b)) <= 0.01 * abs(float(a)) for a, b in pairs)


def test_own_body_can_be_bounded():
    """The second block defines all that attach needs."""
    import exudyn as exu

    import exudyn_romerr as romerr

    names = {}
    exec(BLOCKS[1], names)
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
