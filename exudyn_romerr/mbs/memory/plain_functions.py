"""Functions that only compute: what they are made of shows that they can neither keep anything nor draw numbers.

Most loads are such. A function counts as one where its code, and that of all functions that it reaches, stores into
nothing but its own local variables, takes no attribute but what math and numpy compute with, and reaches nothing but
numbers, lists of them, and functions known here. What its names stand for is looked up each time.
"""

from __future__ import annotations

import builtins
import dis
import math
import re
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np

# instructions of Python 3.10 to 3.14 that store into nothing but local variables; what is not here counts as another
COMPUTES = re.compile(
    r"(LOAD_(CONST|FAST|GLOBAL|DEREF|CLOSURE|ATTR|METHOD|SMALL_INT)|STORE_(FAST|DEREF)|COMPARE_OP|IS_OP|CONTAINS_OP"
    r"|BINARY_|UNARY_|INPLACE_|BUILD_(TUPLE|LIST|SLICE)|LIST_(APPEND|EXTEND|TO_TUPLE)|CALL(?!_INTRINSIC)|PRECALL"
    r"|KW_NAMES|PUSH_NULL|RETURN_|POP_|JUMP_|NOT_TAKEN|FOR_ITER|GET_ITER|END_FOR|UNPACK_|MAKE_|SET_FUNCTION_ATTRIBUTE"
    r"|COPY|SWAP|ROT_|DUP_|RESUME|NOP|EXTENDED_ARG|CACHE|TO_BOOL|YIELD_VALUE|GEN_START|RAISE_VARARGS|RERAISE)"
)
OF_NUMPY = ("array", "zeros", "interp", "where", "clip")  # beside its functions of single numbers
BUILT_IN = (abs, bool, enumerate, float, int, len, list, max, min, range, round, sum, tuple, zip)
NUMBERS = (bool, int, float, np.float64, type(None))
MODULES = (math, np)


def _computes(name: str, found: Any) -> bool:
    return name in OF_NUMPY or isinstance(found, np.ufunc | float) or getattr(found, "__module__", "") == "math"


# what modules have under these names when this is imported: none of it keeps anything, nor writes to a list
KNOWN = [{name: f for name, f in vars(of).items() if name[0] != "_" and _computes(name, f)} for of in MODULES]
FUNCTIONS = {id(f) for f in (*BUILT_IN, *MODULES, *(f for known in KNOWN for f in known.values()))}


def keep_nothing(functions: Iterable[Callable]) -> bool:
    """Whether all of these functions only compute."""
    return all(map(_keeps_nothing, functions))


def _keeps_nothing(f: Callable) -> bool:
    seen: dict[int, Any] = {}
    if not _only_computes(f, seen):
        return False
    adds = any(_code(value.__code__).adds for value in seen.values() if isinstance(value, FunctionType))
    return not (adds and any(isinstance(value, list) for value in seen.values()))  # += writes to lists


def _only_computes(value: Any, seen: dict[int, Any]) -> bool:
    """Whether a value is such a function, or one that it may reach; seen : those that are looked at, by number."""
    kind = type(value)
    if kind in NUMBERS or id(value) in FUNCTIONS or id(value) in seen:
        return True
    seen[id(value)] = value
    if kind is tuple or kind is list:
        return all(type(x) in NUMBERS for x in value)
    code = _code(value.__code__) if kind is FunctionType else None
    if code is None or not all(map(_is_known, code.attributes)):
        return False
    try:
        reached = [*_named(value, code.names), *(cell.cell_contents for cell in value.__closure__ or ())]
    except (KeyError, ValueError):  # a name that stands for nothing yet
        return False
    reached += [*(value.__defaults__ or ()), *(value.__kwdefaults__ or {}).values()]
    return all(_only_computes(x, seen) for x in reached)


def _is_known(attribute: str) -> bool:
    """Whether modules that have something under this name have what is known here."""
    pairs = [
        (vars(of)[attribute], known.get(attribute))
        for of, known in zip(MODULES, KNOWN, strict=True)
        if attribute in vars(of)
    ]
    return bool(pairs) and all(found is known for found, known in pairs)


def _named(f: FunctionType, names: Iterable[str]) -> Iterator[Any]:
    """Return what global names stand for; KeyError if there is nothing."""
    own, built_in = f.__globals__, f.__globals__.get("__builtins__", builtins)
    built_in = vars(built_in) if isinstance(built_in, ModuleType) else built_in
    if type(own) is not dict or type(built_in) is not dict:  # another one may keep what it is asked
        raise KeyError
    return (own[name] if name in own else built_in[name] for name in names)


class _Code(NamedTuple):
    """Global names and attributes that a function uses; adds : whether it has += or the like."""

    names: frozenset[str]
    attributes: frozenset[str]
    adds: bool


@lru_cache(256)
def _code(code: CodeType) -> _Code | None:
    """What the code of a function, and of those within it, uses; None if it may store anything."""
    names, attributes, adds = set(), set(), False
    for one in dis.get_instructions(code):
        stores = one.opname == "STORE_DEREF" and one.argval in code.co_freevars
        if stores or not COMPUTES.match(one.opname):
            return None
        if one.opname == "LOAD_GLOBAL":
            names.add(one.argval)
        elif one.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            attributes.add(one.argval)
        adds = adds or one.opname.startswith("INPLACE_") or (one.opname == "BINARY_OP" and one.argrepr.endswith("="))
    for inner in (x for x in code.co_consts if isinstance(x, CodeType)):
        found = _code(inner)
        if found is None:
            return None
        names, attributes, adds = names | found.names, attributes | found.attributes, adds or found.adds
    return _Code(frozenset(names), frozenset(attributes), adds)
