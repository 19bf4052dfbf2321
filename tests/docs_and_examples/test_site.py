"""The docs as a site: built without a warning, with every page, every public name, and search."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import exudyn_romerr

ROOT = Path(__file__).resolve().parents[2]
PAGES = {path.stem for path in (ROOT / "docs").glob("*.md")}


@pytest.mark.slow
def test_site_is_built_without_a_warning(tmp_path):
    for name in ("sphinx", "myst_parser", "furo"):
        pytest.importorskip(name, reason="pip install -e '.[docs]'")
    command = ["-m", "sphinx", "-q", "-W", "--keep-going", "-c", "docs/site", "docs", str(tmp_path)]
    done = subprocess.run([sys.executable, *command], cwd=ROOT, capture_output=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    site = tmp_path / "site"
    first, names = ((site / f"{page}.html").read_text(encoding="utf-8") for page in ("index", "reference"))
    assert set(re.findall(r'href="\.\./(\w+)\.html"', first)) >= PAGES
    assert {f"exudyn_romerr.{name}" for name in exudyn_romerr.__all__} <= set(re.findall(r'id="([\w.]+)"', names))
    assert "exudyn_romerr.attach" in (tmp_path / "searchindex.js").read_text(encoding="utf-8")
