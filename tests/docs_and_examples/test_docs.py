"""Docs: every block of Python runs and prints what the page shows; commands, pictures, links and names exist."""

import importlib
import re
import runpy
import shutil
from functools import cache
from pathlib import Path

import pytest
from matplotlib import rc_context

import exudyn_romerr
from tests.helpers.pages import BLOCK, assert_printed, shown_below

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = {path.relative_to(ROOT).as_posix(): path for path in (ROOT / "README.md", *sorted(DOCS.glob("*.md")))}
TEXT = {name: path.read_text(encoding="utf-8") for name, path in PAGES.items()}
FIGURE = re.compile(r"!\[[^\]]*\]\((?:docs/)?figures/([^)]+)\)")
WRITTEN = re.compile(r'"(\w+\.(?:png|svg|pdf|vtu|npz|sol))"')
SCRIPT = re.compile(r"python3? ((?:examples|benchmarks|docs)/\w+\.py)([^`\n]*)")
LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)#\s]*)(?:#([^)\s]*))?\)")
# Where what a page's blocks need, or leave, is checked too
RUN_ELSEWHERE = {"docs/fe_input.md": "model/test_fe_input.py", "docs/stress.md": "model/test_stress.py"}
RUN_HERE = sorted({name for name, text in TEXT.items() if BLOCK.search(text)} - set(RUN_ELSEWHERE))


def test_printed_lines_are_compared():
    """Otherwise the tests below would pass on anything."""
    assert_printed(["tip: at most 1.22e-06 m (4.9 %)"], "x\n  tip: at most 1.221e-06 m (4.9 %)\n")
    for other in ("tip: at most 1.3e-06 m (4.9 %)", "top: at most 1.22e-06 m (4.9 %)", ""):
        with pytest.raises(AssertionError):
            assert_printed(["tip: at most 1.22e-06 m (4.9 %)"], other)


@pytest.mark.parametrize("name", RUN_HERE)
def test_page_runs_as_one_script_and_prints_what_it_shows(name, capsys, tmp_path, monkeypatch):
    """In a folder of its own, beside the data of models/; other files are read from there in no page."""
    shutil.copytree(ROOT / "models" / "data", tmp_path / "models" / "data")
    (tmp_path / "examples").symlink_to(ROOT / "examples")  # scripts that a page runs find models/ by their own place
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    with rc_context():  # Exudyn's PlotSensor enlarges all fonts of the process
        for block in BLOCK.findall(TEXT[name]):
            exec(compile(block, name, "exec"), names)
            assert_printed(shown_below(TEXT[name], block), capsys.readouterr().out)
    assert any(module is exudyn_romerr for module in names.values())
    missing = [
        file for file in WRITTEN.findall("".join(BLOCK.findall(TEXT[name]))) if not (tmp_path / file).is_file()
    ]
    assert missing == []


@pytest.mark.parametrize(("name", "test"), RUN_ELSEWHERE.items())
def test_page_is_run_by_another_test(name, test):
    source = (ROOT / "tests" / test).read_text(encoding="utf-8")
    assert f'"{Path(name).name}"' in source
    assert "exec(" in source


def test_every_block_is_of_a_known_kind():
    """What is neither Python nor shell is text: no code that nothing runs."""
    for name, text in TEXT.items():
        kinds = set(re.findall(r"(?m)^ *```(.+)$", text))
        assert kinds <= {"python", "bash", "text"}, name


@cache
def source_of(script):
    """A script with the modules of the checkout that it imports."""
    text = (ROOT / script).read_text(encoding="utf-8")
    near = re.findall(r"(?m)^from (examples|benchmarks)(?:\.(\w+))? import (.*)$", text)
    modules = {f"{folder}/{name}.py" for folder, inner, names in near for name in (inner or names).split(", ")}
    return text + "".join((ROOT / path).read_text(encoding="utf-8") for path in modules if (ROOT / path).is_file())


COMMANDS = sorted({(name, *found) for name, text in TEXT.items() for found in SCRIPT.findall(text)})


@pytest.mark.parametrize(("name", "script", "rest"), COMMANDS)
def test_command_names_a_script_that_knows_its_options(name, script, rest):
    assert (ROOT / script).is_file()
    for option in re.findall(r"(?<!\w)--[a-z][\w-]*", rest):
        assert f'"{option}"' in source_of(script), option


def test_commands_of_the_package_exist(capsys):
    """`romerr show run.npz`: asking for the help of `romerr show` ends with 0, and each option is in it."""
    main = importlib.import_module("exudyn_romerr.__main__").main
    commands = {found for text in TEXT.values() for found in re.findall(r"(?m)(?:^|`)romerr (\w+)([^`\n]*)", text)}
    assert {command for command, _ in commands} >= {"show", "report"}
    for command, rest in commands:
        with pytest.raises(SystemExit) as stopped:
            main([command, "--help"])
        assert stopped.value.code == 0
        text = capsys.readouterr().out
        assert all(option in text for option in re.findall(r"(?<!\S)--?[a-z][\w-]*", rest)), (command, rest)


def shown_figures():
    """(picture, page) of every picture in a page."""
    return [(figure, name) for name, text in TEXT.items() for figure in FIGURE.findall(text)]


def test_every_picture_is_shown_and_every_picture_shown_is_there():
    shown = {figure for figure, _ in shown_figures()}
    assert shown == {path.name for path in (DOCS / "figures").iterdir()}


def makes(source, stem):
    """Whether a script has the name of a picture: in one piece, or as f"picture_{name}" and "signal"."""
    if re.search(rf"\b{stem}\b", source):
        return True
    first, _, last = stem.partition("_")
    return f'f"{first}_{{' in source and bool(re.search(rf"""["']{last}["']""", source))


@pytest.mark.parametrize(("figure", "name"), shown_figures())
def test_picture_is_made_by_a_script_that_its_page_names(figure, name):
    """The page has a command whose script writes a file of that name."""
    scripts = {script for script, _ in SCRIPT.findall(TEXT[name])}
    assert any(makes(source_of(script), figure.removesuffix(".png")) for script in scripts)


def anchors(path):
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"(?m)^#+ (.*)$", path.read_text(encoding="utf-8"))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", TEXT)
def test_links_lead_somewhere(name):
    for target, anchor in LINK.findall(TEXT[name]):
        if "://" in target:
            continue
        path = PAGES[name].parent / target if target else PAGES[name]
        assert path.exists(), target
        assert not anchor or anchor in anchors(path), f"{target}#{anchor}"


NAMED = [
    (path.relative_to(ROOT).as_posix(), *found)
    for path in sorted((ROOT / "exudyn_romerr").rglob("*.py"))
    for found in re.findall(r"(docs/[\w.]+\.\w+)(?:#([\w-]+))?", path.read_text(encoding="utf-8"))
]


def test_pages_that_the_package_names_are_there():
    assert any(anchor for _, _, anchor in NAMED)  # a scope's page, in every report
    for source, page, anchor in NAMED:
        assert (ROOT / page.rstrip(".")).is_file(), source
        assert not anchor or anchor in anchors(ROOT / page), source


def test_every_page_is_linked_from_the_readme():
    assert {target for target, _ in LINK.findall(TEXT["README.md"])} >= {*TEXT} - {"README.md"}


def test_reference_is_what_the_docstrings_say_now():
    """Otherwise: python docs/make_api.py."""
    page = runpy.run_path(str(DOCS / "make_api.py"))["page"]()
    assert TEXT["docs/api.md"] == page, "run python docs/make_api.py"


def test_every_public_name_is_in_the_reference():
    named = set(re.findall(r"(?m)^(?:### |\| `)(\w+)", TEXT["docs/api.md"]))
    assert named >= set(exudyn_romerr.__all__) | {"Monitor", "FloatingBody", "ReducedBody", "TwoLevel", "Sweep"}
