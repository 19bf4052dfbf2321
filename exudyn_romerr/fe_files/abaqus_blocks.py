"""Input files of Abaqus and CalculiX as blocks: keyword, parameters, data lines; *Include and input= are followed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from ..errors import InputError


class Block(NamedTuple):
    """A keyword, its parameters (names in capitals, values as they are), its data lines, and where it stands."""

    keyword: str
    given: dict[str, str]
    lines: list[str]
    where: str


def blocks_of(path: Path) -> Iterator[Block]:
    """Return the blocks of a file and of those that it includes."""
    text, lines, at = "", [], 0
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        if line.startswith("**") or not line.strip():
            continue
        if text.endswith(",") and not lines:  # a keyword goes on
            text += line.strip()
        elif line.lstrip().startswith("*"):
            if text:
                yield from _whole(_block(text, lines, path, at), path)
            text, lines, at = line.strip(), [], number
        else:
            lines.append(line)
    if text:
        yield from _whole(_block(text, lines, path, at), path)


def _block(text: str, lines: list[str], path: Path, number: int) -> Block:
    name, *given = (part.strip() for part in text.lstrip("*").split(","))
    pairs = (part.partition("=") for part in given if part)
    parameters = {a.strip().upper(): b.strip().strip('"') for a, _, b in pairs}
    return Block(" ".join(name.upper().split()), parameters, lines, f"{path.name}, line {number}, {text}")


def _whole(block: Block, path: Path) -> Iterator[Block]:
    """The block, its lines from the file that it names; of *Include the blocks there."""
    if "INPUT" not in block.given:
        yield block
        return
    other = path.parent / block.given["INPUT"]
    if not other.is_file():
        raise InputError(f"{block.where}: {other} is no file; put it beside {path.name}")
    if block.keyword == "INCLUDE":
        yield from blocks_of(other)
    else:
        text = other.read_text(encoding="utf-8", errors="replace").splitlines()
        yield block._replace(lines=[line for line in text if line.strip() and not line.startswith("*")])


def fields(line: str) -> list[str]:
    """Return what stands between the commas of a line."""
    return [part.strip() for part in line.split(",")]
