"""Copies of user functions with copies of all that they keep: called away from the run, they leave it as it is."""

from __future__ import annotations

import copyreg
import io
import os
import pickle
import random
import sys
import sysconfig
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from itertools import chain
from pathlib import Path
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ...errors import AssumptionError
from .equations import current_state, state_set
from .mbs_items import Items

PLACES = ("stdlib", "platstdlib", "purelib", "platlib")
INSTALLED = tuple(str(Path(sysconfig.get_path(place)).resolve()) + os.sep for place in PLACES)
OURS = str(Path(__file__).resolve().parents[2]) + os.sep
NUMBERS = (bool, int, float, complex, str, bytes, type(None))
CHANGES = ("Set", "Add", "Create", "Delete", "Modify", "Reset", "Assemble", "Solve")  # begin names of what changes
INTERFACE = "ObjectFFRFreducedOrderInterface"
# of a main system: where its state may be, beside what Get... functions give
STATE = ("systemData", "variables", "sys")
READS_SENSORS, READS_NODES = "GetSensorValues", "GetObjectOutputSuperElement"  # by what functions ask a main system
STREAMS = ("__next__", "fileno")  # of iterators and open files, of files and sockets


class OnlyReads:
    """A main system of the run as copies of functions see it: what would change it raises AssumptionError.

    instead : what is asked in place of main systems, by their identity.
    """

    instead: ClassVar[dict[int, Any]] = {}

    def __init__(self, of: Any):
        object.__setattr__(self, "_of", of)

    def __getattr__(self, name: str) -> Any:
        """Return what it has; its data as they are seen, too."""
        if id(self._of) in self.instead:
            return getattr(self.instead[id(self._of)], name)
        if name.startswith(CHANGES):
            raise AssumptionError(f"a user function calls {name}, which would change the run")
        found = getattr(self._of, name)
        return OnlyReads(found) if name == "systemData" else found

    def __setattr__(self, name: str, value: Any) -> None:
        """Refuse."""
        raise AssumptionError(f"a user function sets {name}, which would change the run")


class Detached:
    """Copies of user functions: of closures, defaults, attributes, and of globals and attributes that they name.

    Classes, functions and modules of libraries, and objects of Exudyn stay what they are; of main systems copies can
    only read. Does not cover: what functions of libraries keep, lists and the like that a class of the user's has.

    lost : why they cannot be copied, so that they must not be called; empty: they can. names : of globals and
    attributes in the functions.
    """

    def __init__(self, mbs: Any, functions: Sequence[Callable]):
        """Copy; mbs : whose variables they know, None: of none."""
        self._functions, self.lost, self._kept = functions, "", b""
        self._held: dict[int, Any] = {}  # what stays
        self._classes: list[type] = []  # the user's
        self._interfaces: list[Any] = []  # of bodies: their function for the mass writes into a matrix that they keep
        self.names: set[str] = set()
        of_mbs = [{}, {}] if mbs is None else [mbs.variables, mbs.sys]
        self._copies = [*of_mbs, *functions]
        if functions:
            try:
                self._kept = self._pickled(self._copies)
                self._copies = self._unpickled(self._kept)
            except Exception as error:  # whatever a script may hold
                self.lost = str(error)

    def _pickled(self, value: Any, to_be_read: bool = True) -> bytes:
        """Return it pickled; else as it is compared, without variables of modules, of which copies have others."""
        file = io.BytesIO()
        _Writer(file, self, to_be_read).dump(value)
        return file.getvalue()

    def _unpickled(self, kept: bytes) -> Any:
        return _Reader(io.BytesIO(kept), self._held).load()

    def held(self, x: Any) -> tuple:
        """Return how something is pickled that stays what it is."""
        if id(x) not in self._held and isinstance(x, type) and _is_users(_file_of(x.__module__)):
            self._classes.append(x)
        if id(x) not in self._held and type(x).__name__ == INTERFACE:
            self._interfaces.append(x)
        self._held[id(x)] = x
        return _same, (id(x),)

    @property
    def spaces(self) -> tuple[Any, Any]:
        """The variables of the main system, and its sys: copies."""
        return self._copies[0], self._copies[1]

    def of(self, function: Callable) -> Callable:
        """Return the copy of a function; itself, if it is none of those."""
        found = (copy for f, copy in zip(self._functions, self._copies[2:], strict=True) if f is function)
        return next(found, function)

    def has_changed(self) -> bool:
        """Whether the copies keep something else than at first."""
        if not self._functions or self.lost:
            return False
        now, first = (self._pickled(x, False) for x in (self._copies, self._unpickled(self._kept)))
        return now != first

    def may_know_motion(self, function: Callable, load: Any) -> bool:
        """Return whether a user function of a load may know more than the time: it asks its mbs, or another one."""
        if any(name.startswith("Get") or name in STATE for name in self.names):
            return True
        try:
            function(None, 0.0, load)
        except Exception:  # whatever comes of asking None
            return True
        return False

    @contextmanager
    def in_use(self, *systems: Any) -> Iterator[Detached]:
        """Let main systems have copies of the variables; put back random numbers, numbers of classes, masses.

        systems : None: one that is gone.
        """
        of_random, of_numpy = random.getstate(), np.random.get_state(legacy=False)
        of_classes = [(one, name, x) for one in self._classes for name, x in _numbers(one)]
        masses = [(x.massMatrixFFRFreduced, x.massMatrixFFRFreduced.copy()) for x in self._interfaces]
        own = [(mbs, mbs.variables, mbs.sys) for mbs in systems if mbs and self._functions and not self.lost]
        try:
            for mbs, *_ in own:
                mbs.variables, mbs.sys = self.spaces
            yield self
        finally:
            for mbs, variables, of_system in own:
                mbs.variables, mbs.sys = variables, of_system
            for one, name, x in of_classes:
                setattr(one, name, x)
            for mass, was in masses:
                mass[:] = was
            random.setstate(of_random)
            np.random.set_state(of_numpy)


def _numbers(of: type) -> list[tuple[str, Any]]:
    return [(name, x) for name, x in vars(of).items() if type(x) in NUMBERS and not name.startswith("__")]


class _Reader(pickle.Unpickler):
    """Gives what stays."""

    def __init__(self, file: io.BytesIO, held: dict[int, Any]):
        super().__init__(file)
        self._held = held

    def find_class(self, module: str, name: str) -> Any:
        """Return what a name stands for."""
        is_held = (module, name) == (__name__, _same.__name__)
        return self._held.__getitem__ if is_held else super().find_class(module, name)


class _Writer(pickle.Pickler):
    """Pickles what functions keep, but for what stays what it is; the user's functions and modules by their parts."""

    def __init__(self, file: io.BytesIO, of: Detached, to_be_read: bool):
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._of, self._to_be_read = of, to_be_read
        self._spaces = 0
        self._of_dicts: dict[int, _Space] = {}

    def reducer_override(self, x: Any) -> Any:
        """Return how something is pickled that is no number, text, or container of Python's own."""
        if isinstance(x, np.ndarray | np.generic) or any(x is helper for helper in HELPERS):
            return NotImplemented
        if isinstance(x, CellType):
            return _cell, (), _content(x), None, None, _fill_cell
        if isinstance(x, _Space):
            self._spaces += 1
            return dict, (_Whole(x.of),) if self._to_be_read else ((("space", self._spaces),),)
        if isinstance(x, _Whole):
            return self._of.held(x.of)
        if _is_users_module(x):
            return _Module, (self._space(vars(x)),)
        if isinstance(x, FunctionType) and _is_users(x.__code__.co_filename):
            return self._parts(x)
        if type(x).__name__ == "MainSystem" or isinstance(x, OnlyReads):
            return OnlyReads, (_Whole(x._of if isinstance(x, OnlyReads) else x),)
        if isinstance(x, FunctionType | type | ModuleType) or type(x).__module__.startswith("exudyn"):
            return self._of.held(x)
        return self._reduced(x)

    def _space(self, of: dict) -> _Space:
        """One for each dict."""
        return self._of_dicts.setdefault(id(of), _Space(of))

    def _parts(self, f: FunctionType) -> tuple:
        names, cells = _names_in(f.__code__), f.__closure__ or ()
        self._of.names.update(names)
        named = {name: f.__globals__[name] for name in names if name in f.__globals__}
        modules = [x for x in [*named.values(), *chain.from_iterable(map(_content, cells))] if _is_users_module(x)]
        of_modules = [
            (self._space(vars(x)), {name: vars(x)[name] for name in names if name in vars(x)}) for x in modules
        ]
        state = f.__defaults__, f.__kwdefaults__, f.__dict__, named, of_modules
        start = _Whole(f.__code__), f.__name__, cells, self._space(f.__globals__)
        return _shell, start, state, None, None, _fill

    def _reduced(self, x: Any) -> Any:
        """As Python has it; what it cannot pickle stays what it is, but for what reading makes another."""
        if type(x) in copyreg.dispatch_table:
            return NotImplemented
        try:
            return x.__reduce_ex__(pickle.HIGHEST_PROTOCOL)
        except Exception:
            printed = x is sys.stdout or x is sys.stderr  # nothing is read from there
            if isinstance(x, memoryview) or (not printed and any(hasattr(type(x), name) for name in STREAMS)):
                raise
            return self._of.held(x)


class _Whole(NamedTuple):
    """Something that stays what it is, though copies of it could be made."""

    of: Any


class _Space:
    """Variables of a module, which functions of it share."""

    def __init__(self, of: dict):
        self.of = of


class _Module:
    """Stands for a module of the user's, with variables of its own."""

    def __init__(self, space: dict):
        self.__dict__ = space


def _same(number: int) -> Any:
    """Stands for what stays; _Reader knows it."""


def _shell(code: CodeType, name: str, cells: tuple[CellType, ...], space: dict) -> FunctionType:
    """A function with the code of another one and variables of its own."""
    return FunctionType(code, space, name, None, cells)


def _fill(f: FunctionType, state: tuple) -> None:
    f.__defaults__, f.__kwdefaults__, attributes, named, of_modules = state
    f.__dict__.update(attributes)
    f.__globals__.update(named)
    for space, of_module in of_modules:
        space.update(of_module)


def _content(cell: CellType) -> tuple:
    """What a variable of a closure stands for, (1,), for pickle leaves out a state of None; empty: nothing yet."""
    try:
        return (cell.cell_contents,)
    except ValueError:
        return ()


def _cell() -> CellType:
    return CellType()


def _fill_cell(cell: CellType, content: tuple) -> None:
    for x in content:
        cell.cell_contents = x


HELPERS = (OnlyReads, _same, _shell, _fill, _cell, _fill_cell, _Module, dict)


def _names_in(code: CodeType) -> list[str]:
    """Names of globals and attributes in a function, and in those defined in it."""
    inner = [name for own in code.co_consts if isinstance(own, CodeType) for name in _names_in(own)]
    return list(dict.fromkeys([*code.co_names, *inner]))


def _is_users_module(x: Any) -> bool:
    """Whether it is a module of the user's, or what stands for one."""
    if not isinstance(x, ModuleType):
        return isinstance(x, _Module)
    return x.__name__ not in sys.builtin_module_names and _is_users(_file_of(x.__name__))


def _file_of(module: str) -> str:
    return getattr(sys.modules.get(module), "__file__", None) or ""


@cache
def _is_users(file: str) -> bool:
    """Whether code is in a file that nobody has installed, or in none."""
    return not (file and str(Path(file).resolve()).startswith((*INSTALLED, OURS)))


MOVED = 1e-4  # of coordinates and rates: what user functions of loads are tried with
LATER = 1e-9  # of the time, or of 1 s: a memory that looks at the clock shows


def controller(mbs: Any, number: int, load: dict[str, Any]) -> str:
    """Return the name of a load that is no function of time alone: it sees the motion, or keeps something; else "".

    Copies of its functions are called in this state twice, in another one and a little later. Those that keep what
    cannot be copied are not called.
    """
    why = _why_not_by_time_alone(mbs, load)
    return "" if why is None else f"load {number} ({load['name']}{why})"


def _why_not_by_time_alone(mbs: Any, load: dict[str, Any]) -> str | None:
    """None if a load is a function of time alone; else what its function keeps, if that cannot be copied."""
    if not (functions := functions_of(load)):
        return None
    t = mbs.systemData.GetTime()
    given, detached = load.get("loadVector", load.get("load")), Detached(mbs, functions)
    if detached.lost:
        return f", whose function keeps what cannot be copied: {detached.lost}"

    def values(at: float = t) -> Any:  # given as Exudyn does: a number, or a list of their own, to write to
        return np.hstack(
            [np.ravel(detached.of(f)(OnlyReads(mbs), at, np.asarray(given).tolist())) for f in functions]
        )

    with detached.in_use(mbs):
        try:
            found = [values(), _elsewhere(mbs.systemData, values)]
        except AssumptionError as error:
            return f", for {error}"
        with suppress(Exception):  # a table that ends here
            values(t + LATER * max(abs(t), 1.0))
        found.append(values())
    same = all(np.array_equal(found[0], row, equal_nan=True) for row in found)
    return None if same and not detached.has_changed() else ""


def _elsewhere(system: Any, values: Callable[[], Any]) -> Any:
    """What values are in another state: each coordinate is moved by another amount."""
    q, q_t, q_tt, multipliers = current_state(system)
    shifts, rates = (MOVED * (1 + of(np.arange(len(q)))) for of in (np.sin, np.cos))
    with state_set(system, system.GetTime(), (q + shifts, q_t + rates, q_tt + shifts, multipliers + MOVED)):
        return values()


def user_functions(mbs: Any) -> tuple[list[Callable], list[Callable]]:
    """Return the user functions of loads, and of objects."""
    items = Items(mbs)
    return tuple([f for item in of for f in functions_of(item)] for of in (items.loads, items.objects))


def functions_of(item: dict[str, Any]) -> list[Callable]:
    """Return the user functions of a load or an object; symbolic ones keep nothing."""
    values = [value for key, value in item.items() if key.endswith("UserFunction") and value]
    return [f for f in (v.get("function") if isinstance(v, dict) else v for v in values) if callable(f)]
