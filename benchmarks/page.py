"""Tables of the benchmarks in docs/measured.md: each stands in the code block after its own mark."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "measured.md"
FIGURES = ROOT / "docs" / "figures"


def show(name: str, table: str, is_kept: bool) -> str:
    """Print a table, put it on the page if it is to be kept, and return it."""
    print(table)
    if is_kept:
        put(name, table)
    return table


def put(name: str, table: str, page: Path = PAGE) -> None:
    """Replace the code block after <!-- name --> by a table; ValueError if the page has no such mark."""
    begin, end = f"<!-- {name} -->\n```text", "\n```"
    head, *rest = page.read_text(encoding="utf-8").split(begin)
    if len(rest) != 1 or end not in rest[0]:
        raise ValueError(f"{page} has no code block marked {name!r}, or more than one")
    tail = rest[0].partition(end)[2]
    page.write_text(f"{head}{begin}\n{table}{end}{tail}", encoding="utf-8")
