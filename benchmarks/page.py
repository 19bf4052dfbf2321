"""Tables of the benchmarks in docs/speed.md: each stands in the code block after its own mark."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "speed.md"
FIGURES = ROOT / "docs" / "figures"


def put(name: str, table: str, page: Path = PAGE) -> None:
    """Replace the code block after <!-- name --> by a table; ValueError if the page has no such mark."""
    begin, end = f"<!-- {name} -->\n```text\n", "\n```"
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    text = page.read_text(encoding="utf-8")
    if len(pattern.findall(text)) != 1:
        raise ValueError(f"{page} has no code block marked {name!r}, or more than one")
    page.write_text(pattern.sub(lambda _: begin + table + end, text), encoding="utf-8")


def put_between(name: str, text: str, page: Path) -> None:
    """Replace what stands between <!-- name --> and <!-- end of name -->; ValueError without such marks."""
    begin, end = f"<!-- {name} -->\n", f"\n<!-- end of {name} -->"
    head, found, rest = page.read_text(encoding="utf-8").partition(begin)
    _, closed, tail = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"{page} has no part between marks {name!r}")
    page.write_text(head + begin + text + end + tail, encoding="utf-8")
