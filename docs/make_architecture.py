"""Draws docs/figures/architecture.png, folders and who imports whom: python docs/make_architecture.py.

ORDER is the one place that names the folders in their order; tests/test_imports.py checks the package against it.
"""

from __future__ import annotations

import ast
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "exudyn_romerr"
PICTURE = ROOT / "docs" / "figures" / "architecture.png"
# A folder imports from itself and from what stands above it, annotations and imports inside functions included.
ORDER = (
    "_version errors checks progress process compiled linalg model basis linear.residual "
    "linear.estimators report linear.run linear mechanism mechanism_errors mechanism_bounds mode_selection "
    "mbs.access mbs.floating mbs.mirror mbs.monitoring mbs.studies mbs.scenes fe_files mbs "
    "scripts __init__ __main__"
).split()
FOLDERS = [name for name in ORDER if (PACKAGE / name.replace(".", "/")).is_dir() and name not in ("mbs", "linear")]
PATHS = {".".join(path.relative_to(PACKAGE).with_suffix("").parts): path for path in PACKAGE.rglob("*.py")}
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#888888"  # Okabe and Ito


class Imports(ast.NodeVisitor):
    """(absolute name, is inside a function) of everything that a file imports."""

    def __init__(self, path: Path):
        self.package, self.depth = path.relative_to(PACKAGE.parent).parent.parts, 0
        self.found: list[tuple[str, bool]] = []
        self.visit(ast.parse(path.read_text(encoding="utf-8")))

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Go on inside a function."""
        self.depth += 1
        self.generic_visit(node)
        self.depth -= 1

    def visit_Import(self, node: ast.Import) -> None:
        """Note modules."""
        self.found += [(alias.name, self.depth > 0) for alias in node.names]

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        """Note what is imported with its module: `from ..linalg import oscillator` imports a module."""
        parent = self.package[: len(self.package) - node.level + 1] if node.level else ()
        base = ".".join([*parent, *([node.module] if node.module else [])])
        self.found += [(f"{base}.{alias.name}", self.depth > 0) for alias in node.names]


@cache
def imported(name: str) -> list[tuple[str, bool]]:
    """Everything that a module imports: (absolute name, is inside a function)."""
    return Imports(PATHS[name]).found


def own_imports(name: str) -> set[str]:
    """Modules of the package that a module imports."""
    prefix = f"{PACKAGE.name}."
    found = [full.removeprefix(prefix) for full, _ in imported(name) if full.startswith(prefix)]
    candidates = [(x, x.rpartition(".")[0], f"{x.rpartition('.')[0]}.__init__".lstrip(".")) for x in found]
    return {next(module for module in names if module in PATHS) for names in candidates}


def room(name: str) -> str | None:
    """The entry of ORDER that a module belongs to; mbs/__init__.py is above all folders of mbs, linear/ likewise."""
    module = name.removesuffix(".__init__")
    return max((x for x in ORDER if module == x or module.startswith(f"{x}.")), key=len, default=None)


def draw() -> Any:
    """Return the figure: a row for each folder, its files; right of it how many imports from each folder above."""
    count = Counter((room(name), room(other)) for name in PATHS for other in own_imports(name))
    figure = Figure(figsize=(13, 0.62 * len(FOLDERS) + 1.2), layout="constrained")
    text, matrix = figure.subplots(1, 2, width_ratios=[1.75, 1])
    for axes in (text, matrix):
        axes.set(ylim=(len(FOLDERS) - 0.5, -0.5))
        axes.spines[:].set_visible(False)
        axes.tick_params(length=0)
    text.set(xlim=(0, 1), xticks=[], yticks=[])
    for row, folder in enumerate(FOLDERS):
        colour = ORANGE if folder.startswith("mbs") else BLUE
        text.text(0, row - 0.18, folder.replace(".", "/") + "/", color=colour, weight="bold", fontsize=11)
        about = ast.get_docstring(ast.parse(PATHS[f"{folder}.__init__"].read_text(encoding="utf-8")))
        text.text(0.26, row - 0.18, about.split(" (contract")[0], fontsize=8.5)
        files = [name.removeprefix(f"{folder}.") for name in sorted(PATHS) if room(name) == folder]
        inner = (file.partition(".") for file in files if not file.endswith("__init__"))
        names = ", ".join(dict.fromkeys(f"{name}/" if more else name for name, more, _ in inner))
        text.text(0.26, row + 0.22, _folded(names), fontsize=7.5, color="#444444", va="center")
        matrix.axhline(row - 0.5, color="#dddddd", linewidth=0.6)
        text.axhline(row - 0.5, color="#dddddd", linewidth=0.6)
        for column, other in enumerate(FOLDERS[: row + 1]):
            n = count[folder, other]
            if n:
                size = 60 + 14 * n
                matrix.scatter(column, row, s=size, color=GREY if column == row else colour, alpha=0.35, linewidths=0)
                matrix.text(column, row, n, ha="center", va="center", fontsize=8)
    labels = [name.replace(".", "/") for name in FOLDERS]
    matrix.set(xlim=(-0.6, len(FOLDERS) - 0.4), yticks=[])
    matrix.set_xticks(range(len(FOLDERS)), labels, rotation=60, ha="left", fontsize=8)
    matrix.xaxis.tick_top()
    text.set_title("Folders: each imports from those above it only", loc="left", fontsize=12)
    matrix.set_title("imports from (grey: of its own)", loc="left", fontsize=9)
    return figure


def _folded(names: str, width: int = 92) -> str:
    """Two lines where one is too long."""
    if len(names) <= width:
        return names
    at = names.rfind(", ", 0, len(names) // 2 + 12) + 1
    return f"{names[:at]}\n{names[at + 1 :]}"


def main() -> None:
    """Write the picture."""
    draw().savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    main()
