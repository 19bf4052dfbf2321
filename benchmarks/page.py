"""Tables of the benchmarks in docs/speed.md: each stands in the code block after its own mark."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "speed.md"
FIGURES = ROOT / "docs" / "figures"


def put(name: str, table: str, page: Path = PAGE) -> None:
    """Replace the code block after <!-- name --> by a table; ValueError if the page has no such mark."""
    _replace(page, f"code block marked {name!r}", f"<!-- {name} -->\n```text\n", "\n```", table)


def put_between(name: str, text: str, page: Path) -> None:
    """Replace what stands between <!-- name --> and <!-- end of name -->; ValueError without such marks."""
    _replace(page, f"part between marks {name!r}", f"<!-- {name} -->\n", f"\n<!-- end of {name} -->", text)


def _replace(page: Path, what: str, begin: str, end: str, text: str) -> None:
    head, *rest = page.read_text(encoding="utf-8").split(begin)
    if len(rest) != 1 or end not in rest[0]:
        raise ValueError(f"{page} has no {what}, or more than one")
    tail = rest[0].partition(end)[2]
    page.write_text(head + begin + text + end + tail, encoding="utf-8")
