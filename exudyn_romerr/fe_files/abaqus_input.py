"""Input files of Abaqus and CalculiX: blocks of them, and the nodes, elements, sets and supports of one part."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError
from .fe_data import Mesh

TYPES = {
    r"C3D4H?|C3D4T|DC3D4": "Tet4",
    r"C3D10\w*": "Tet10",
    r"C3D8\w*": "Hex8",
    r"C3D20\w*": "Hex20",
    r"C3D6\w*": "Wedge6",
    r"C3D15\w*": "Wedge15",
    r"C3D5\w*": "Pyramid5",
    r"S3R?S?|STRI3|M3D3": "Trig3",
    r"S4R?5?S?W?|M3D4R?": "Quad4",
    r"STRI65|M3D6": "Trig6",
    r"S8R5?|M3D8R?": "Quad8",
    r"B3[13]\w*|T3D2|PIPE31H?": "Line2",
}
SUPPORTS = {
    "ENCASTRE": (1, 2, 3, 4, 5, 6),
    "PINNED": (1, 2, 3),
    "XSYMM": (1, 5, 6),
    "YSYMM": (2, 4, 6),
    "ZSYMM": (3, 4, 5),
    "XASYMM": (2, 3, 4),
    "YASYMM": (1, 3, 5),
    "ZASYMM": (1, 2, 6),
}
MAKES_NODES = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY")
COUPLES = (
    "MPC",
    "TIE",
    "COUPLING",
    "KINEMATIC COUPLING",
    "DISTRIBUTING COUPLING",
    "RIGID BODY",
    "EMBEDDED ELEMENT",
    "SHELL TO SOLID COUPLING",
    "TRANSFORM",
)


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


class Part:
    """What a part, an instance, the assembly or the file as a whole has; numbers as in the file."""

    def __init__(self) -> None:
        self.nodes: dict[int, list[float]] = {}
        self.elements: dict[int, tuple[str, list[int]]] = {}
        self.node_sets: dict[str, list[int]] = {}
        self.element_sets: dict[str, list[int]] = {}
        self.supports: list[Block] = []


def read_input(path: str | Path) -> Mesh:
    """Return the mesh of an .inp: nodes by number, elements by type, node sets, coordinates held at zero.

    Raises
    ------
    InputError
        No nodes, several instances, nodes that only Abaqus makes (*Ngen ...), constraints between nodes (*Equation of
        several terms, *Mpc, *Tie, *Coupling, ...), a support with a value, a line that cannot be read.
    """
    return _Reader(Path(path)).mesh()


class _Reader:
    """Goes through the blocks; `parts` by kind and name, the file itself is ("", "")."""

    def __init__(self, path: Path):
        self.path, self.parts, self.inside = path, {("", ""): Part()}, ("", "")
        self.instances: dict[str, Block] = {}
        for block in blocks_of(path):
            with _named(block):
                self._take(block)

    def _take(self, block: Block) -> None:
        word, given, part = block.keyword, block.given, self.parts[self.inside]
        if word in ("PART", "INSTANCE", "ASSEMBLY"):
            self.inside = (word, given.get("NAME", "").upper())
            self.parts.setdefault(self.inside, Part())
            if word == "INSTANCE":
                self.instances[self.inside[1]] = block
        elif word in ("END PART", "END ASSEMBLY"):
            self.inside = ("", "")
        elif word == "END INSTANCE":
            self.inside = next((key for key in self.parts if key[0] == "ASSEMBLY"), ("", ""))
        elif word == "NODE":
            new = {int(x[0]): [float(y or 0) for y in [*x[1:4], 0, 0, 0][:3]] for x in map(fields, block.lines)}
            part.nodes.update(new)
            _add(part.node_sets, given.get("NSET"), new)
        elif word == "ELEMENT":
            new = dict(_elements(given["TYPE"].upper(), block.lines))
            part.elements.update(new)
            _add(part.element_sets, given.get("ELSET"), new)
        elif word in ("NSET", "ELSET"):
            self._take_set(
                block, self.parts[("INSTANCE", given["INSTANCE"].upper())] if "INSTANCE" in given else part
            )
        elif word in ("BOUNDARY", "EQUATION"):
            part.supports.append(block)
        elif word in MAKES_NODES:
            raise InputError(f"{block.where}: nodes or elements that Abaqus makes are not read; write them out")
        elif word in COUPLES:
            raise InputError(
                f"{block.where}: its matrices hold such constraints in a way that is not read. Leave it out, and "
                "join the nodes by modes of interfaces (RBE2, RBE3) or in the mechanism"
            )

    def _take_set(self, block: Block, part: Part) -> None:
        name = block.given[block.keyword]
        sets = part.node_sets if block.keyword == "NSET" else part.element_sets
        found: list[int] = []
        if "ELSET" in block.given and block.keyword == "NSET":
            found = [n for e in _set(part.element_sets, block.given["ELSET"]) for n in part.elements[e][1]]
        for entries in map(fields, block.lines):
            if "GENERATE" in block.given:
                first, last, step = (int(x) for x in [*entries, 1][:3])
                found += range(first, last + 1, step)
            else:
                found += [n for entry in entries if entry for n in _members(entry, sets)]
        _add(sets, name, found)

    def mesh(self) -> Mesh:
        """Return the one mesh that the file has."""
        main, sets, supports = self._main()
        if not main.nodes:
            raise InputError(f"{self.path.name} has no *Node; pass the .inp that has the mesh")
        numbers = np.array(sorted(main.nodes))
        x = np.array([main.nodes[n] for n in numbers.tolist()])
        for block in self.instances.values():
            x = _placed(x, block.lines)
        elements: dict[str, list] = {}
        for kind, nodes in main.elements.values():
            elements.setdefault(kind, []).append(nodes)
        held: list[tuple[int, int]] = []
        for block in supports:
            with _named(block):
                held += _held(block, sets)
        return Mesh(numbers, x, elements, sets, held)

    def _main(self) -> tuple[Part, dict[str, list[int]], list[Block]]:
        """The part with the mesh, sets and supports of it and of all around it."""
        if len(self.instances) > 1:
            names = ", ".join(block.given.get("NAME", "") for block in self.instances.values())
            raise InputError(
                f"{self.path.name} has {len(self.instances)} instances ({names}); merge them into one part"
            )
        parts = [self.parts[key] for key in self.parts if key[0] == "PART"]
        around = [part for key, part in self.parts.items() if key[0] in ("", "ASSEMBLY")]
        if self.instances:
            ((name, block),) = self.instances.items()
            around = [self.parts[("PART", block.given.get("PART", "").upper())], *around]
            around.insert(0, self.parts[("INSTANCE", name)])
        elif len(parts) == 1:
            around = [*parts, *around]
        main = next((part for part in around if part.nodes), around[0])
        sets: dict[str, list[int]] = {}
        for part in reversed(around):
            sets.update(part.node_sets)
        return main, sets, [block for part in around for block in part.supports]


@contextmanager
def _named(block: Block) -> Iterator[None]:
    """Say where a line is that cannot be read."""
    try:
        yield
    except InputError:
        raise
    except (ValueError, IndexError, KeyError) as error:
        raise InputError(f"{block.where}: cannot be read ({error})") from error


def _elements(kind: str, lines: list[str]) -> Iterator[tuple[int, tuple[str, list[int]]]]:
    """Number, type and nodes; an element goes on after a line that ends with a comma."""
    known = next((name for pattern, name in TYPES.items() if re.fullmatch(pattern, kind)), kind)
    numbers: list[int] = []
    for line in lines:
        numbers += [int(x) for x in fields(line) if x]
        if not line.rstrip().endswith(","):
            yield numbers[0], (known, numbers[1:])
            numbers = []


def _members(entry: str, sets: dict[str, list[int]]) -> list[int]:
    """Numbers of an entry: a number, one in an instance ("bar-1.5"), or the name of a set."""
    number = entry.rpartition(".")[2]
    return [int(number)] if number.isdigit() else _set(sets, number)


def _set(sets: dict[str, list[int]], name: str) -> list[int]:
    found = [numbers for key, numbers in sets.items() if key.upper() == name.upper()]
    if not found:
        raise KeyError(f"no set {name!r} before this line")
    return found[0]


def _add(sets: dict[str, list[int]], name: str | None, numbers) -> None:
    if name is not None:
        sets[name] = list(dict.fromkeys([*sets.get(name, []), *numbers]))


def _held(block: Block, sets: dict[str, list[int]]) -> Iterator[tuple[int, int]]:
    """(node number, coordinate 0..5) that *Boundary, or an *Equation of one term, holds at zero."""
    lines = [fields(line) for line in block.lines]
    if block.keyword == "EQUATION":
        if any(int(line[0]) != 1 for line in lines[::2]):
            raise InputError(
                f"{block.where}: an equation of several terms couples nodes, which is not read; leave it out"
            )
        lines = [[*line[:2], line[1]] for line in lines[1::2]]
    for where, *rest in lines:
        numbers = [x for x in rest if x]
        if numbers[0].upper() in SUPPORTS:
            dofs = SUPPORTS[numbers[0].upper()]
        else:
            if len(numbers) > 2 and float(numbers[2]):
                raise InputError(f"{block.where}: {where} is moved by {numbers[2]}; only supports at zero are read")
            dofs = range(int(numbers[0]), int(numbers[min(len(numbers) - 1, 1)]) + 1)
        yield from ((node, dof - 1) for node in _members(where, sets) for dof in dofs if dof <= 6)


def _placed(x: np.ndarray, lines: list[str]) -> np.ndarray:
    """Positions (nodes, 3) as the lines of *Instance move, then turn them."""
    from scipy.spatial.transform import Rotation  # here, for it takes a third of the time to import the package

    numbers = [[float(y) for y in fields(line) if y] for line in lines]
    x = x + numbers[0] if numbers else x
    if len(numbers) > 1:
        a, b, angle = np.array(numbers[1][:3]), np.array(numbers[1][3:6]), np.radians(numbers[1][6])
        axis = (b - a) / np.linalg.norm(b - a)
        x = a + Rotation.from_rotvec(angle * axis).apply(x - a)
    return x
