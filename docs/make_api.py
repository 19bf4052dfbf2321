"""Writes docs/api.md, the reference of all public names, from signatures and docstrings: python docs/make_api.py."""

from __future__ import annotations

import inspect
import re
import sys
from math import inf
from pathlib import Path
from types import FunctionType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import exudyn_romerr as romerr
from exudyn_romerr import mbs
from exudyn_romerr.mbs.studies import parameter_sweep as study

PAGE = ROOT / "docs" / "api.md"
HEAD = """# API reference

Made by `python docs/make_api.py` from signatures and docstrings. Symbols: [notation.md](notation.md).
Shapes: T instants, N coordinates of the full model, n modes, p inputs, r rows of an output.
"""
ROW = 118


class Bare(str):
    """An annotation that is printed without quotes."""

    def __repr__(self) -> str:
        return str(self)


def bare(annotation: Any) -> Any:
    return Bare(annotation) if isinstance(annotation, str) else annotation


def signature(name: str, thing: Any, row: float = ROW) -> str:
    """Return the call, one argument a line where it is longer than a row."""
    if inspect.isclass(thing) and issubclass(thing, Exception | str):
        return name
    found = inspect.signature(thing)
    arguments = [p.replace(annotation=bare(p.annotation)) for p in found.parameters.values()]
    answer = inspect.Signature.empty if inspect.isclass(thing) else bare(found.return_annotation)
    found = found.replace(parameters=arguments, return_annotation=answer)
    line = f"{name}{found}"
    if len(line) <= row:
        return line
    inside = "".join(f"    {part},\n" for part in _parts(found))
    end = str(found.replace(parameters=[])).removeprefix("()")
    return f"{name}(\n{inside}){end}"


def _parts(found: inspect.Signature) -> list[str]:
    arguments = list(found.parameters.values())
    star = next((i for i, p in enumerate(arguments) if p.kind is p.KEYWORD_ONLY), None)
    parts = [str(p) for p in arguments]
    return parts if star is None else [*parts[:star], "*", *parts[star:]]


def markdown(doc: str) -> str:
    """Return a NumPy docstring as Markdown: headings bold, what stands under them a list."""
    lines = [re.sub(r"^(?=\S)", "- ", line) for line in doc.splitlines()]  # every flush line an entry ...
    sections = re.split(r"(?m)^- (\w+)\n- -+\n", "\n".join(lines))
    text = _flush(sections[0])
    for title, body in zip(sections[1::2], sections[2::2], strict=True):
        body = _flush(body) if title == "Notes" else re.sub(r"(?m)^- (.*)$", r"- `\1`", body)
        text += f"**{title}**\n\n{body.rstrip()}\n\n"
    return text.rstrip()


def _flush(text: str) -> str:
    return re.sub(r"(?m)^- ", "", text)  # ... but in running text


def members(cls: type) -> list[str]:
    """Return a line for every public method and property: its first sentence."""
    lines = []
    found = {
        name: member for base in reversed(cls.__mro__) if base is not object for name, member in vars(base).items()
    }
    for name, member in found.items():
        if name.startswith("_") or not isinstance(member, property | classmethod | FunctionType):
            continue
        # bound, so that self and cls are gone
        call = name if isinstance(member, property) else signature(name, member.__get__(cls), inf)
        first = " ".join((inspect.getdoc(getattr(cls, name)) or "").split("\n\n")[0].split())
        lines.append(f"- `{call}`: {first}")
    return lines


def entry(name: str, thing: Any) -> str:
    text = f"### {name}\n\n```text\n{signature(name, thing)}\n```\n\n{markdown(inspect.getdoc(thing))}"
    if inspect.isclass(thing) and members(thing):
        text += "\n\n**Members**\n\n" + "\n".join(members(thing))
    return text


def kind(thing: Any) -> str:
    if not inspect.isclass(thing):
        return "Functions"
    return "Errors" if issubclass(thing, Exception) else "Classes"


def page() -> str:
    """Return the whole page."""
    public = {name: getattr(romerr, name) for name in romerr.__all__}
    returned = {name: getattr(mbs, name) for name in mbs.__all__ if name not in public}
    returned |= {"Failure": study.Failure, "Sweep": study.Sweep}
    titles = ("Functions", "Classes", "Errors")
    groups = {title: {n: thing for n, thing in public.items() if kind(thing) == title} for title in titles}
    groups["Objects that functions return"] = returned
    text = [HEAD]
    for title, names in groups.items():
        links = ", ".join(f"[{name}](#{name.lower()})" for name in sorted(names))
        text += [f"## {title}\n\n{links}\n", *(f"{entry(*item)}\n" for item in sorted(names.items()))]
    return "\n".join(text)


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
