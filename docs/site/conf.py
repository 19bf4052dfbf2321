"""The docs as a site with search: pip install -e '.[docs]' && sphinx-build -W -c docs/site docs OUT."""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

import exudyn_romerr

project, author, version = "exudyn_romerr", "the exudyn_romerr developers", exudyn_romerr.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
root_doc, html_theme, html_title = "site/index", "furo", f"exudyn_romerr {version}"
exclude_patterns = ["paper"]
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
napoleon_google_docstring = napoleon_use_param = napoleon_use_rtype = False  # types are words, and no links
napoleon_use_ivar, suppress_warnings = True, ["ref.python"]  # n of a shape (n,) is no name
autodoc_typehints = "none"
# pages of the repository that are no pages of docs/, and the pages here that begin with them
OUTSIDE = {"README.md": "site/index", "CONTRIBUTING.md": "site/contributing"}


def with_outside(app: Any, page: str, source: list[str]) -> None:
    """Put README and CONTRIBUTING before what stands in their pages here; links lead to these."""
    for name, of in OUTSIDE.items():
        if page == of:
            source[0] = (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](/") + source[0]
        source[0] = re.sub(rf"\]\((\.\./)?{name}", f"](/{of}.md", source[0])


def plain(lines: list[str]) -> list[str]:
    """Return lines of a docstring as plain text: |e| and V_ are no links."""
    return [re.sub(r"[\\|*`]|_(?!\w)", r"\\\g<0>", line) for line in lines]


def before_napoleon(app: Any, what: str, name: str, of: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are plain text."""
    lines[:] = plain(lines)


def after_napoleon(app: Any, what: str, name: str, of: Any, options: Any, lines: list[str]) -> None:
    """What stands before a colon is no type of a property."""
    if what == "property":
        lines[:] = plain((inspect.getdoc(of) or "").splitlines())


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("source-read", with_outside)
    app.connect("autodoc-process-docstring", before_napoleon, priority=1)
    app.connect("autodoc-process-docstring", after_napoleon, priority=900)
