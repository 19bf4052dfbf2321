"""Writes outside given folders refused by the system: those of compiled code and of other processes, too.

Audit events tell of what Python opens; what HDF5, VTK or a mesh generator write they do not. Linux (from 6.2 on) lets
a process give up rights for itself and all that it starts: Landlock. Elsewhere this does nothing.
"""

from __future__ import annotations

import ctypes
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

# linux/landlock.h, the same on all processors
CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
VERSION_FLAG, PATH_BENEATH = 1, 1
TRUNCATE_VERSION = 3  # before it files could be emptied, and not be moved to another folder
WRITE_FILE, TRUNCATE = 1 << 1, 1 << 14
OF_FOLDERS = sum(1 << bit for bit in range(4, 14))  # remove, make files and folders of all kinds, move
CHANGES = WRITE_FILE | OF_FOLDERS | TRUNCATE
NO_NEW_PRIVILEGES = 38  # prctl: without it only root may restrict itself


class _Rule(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("allowed", ctypes.c_uint64), ("folder", ctypes.c_int32))


def write_only_in(folders: Iterable[str]) -> bool:
    """Let this process, and what it starts, change files in these folders only; whether that holds now."""
    if not sys.platform.startswith("linux"):
        return False
    library = ctypes.CDLL(None)
    if library.syscall(CREATE_RULESET, None, ctypes.c_size_t(0), VERSION_FLAG) < TRUNCATE_VERSION:
        return False
    handled = ctypes.c_uint64(CHANGES)
    rules = library.syscall(CREATE_RULESET, ctypes.byref(handled), ctypes.c_size_t(ctypes.sizeof(handled)), 0)
    if rules < 0:
        return False
    for folder in folders:
        if os.path.isdir(folder):
            _allow(library, rules, folder)
    library.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    is_held = library.syscall(RESTRICT_SELF, rules, 0) == 0
    os.close(rules)
    return is_held


def _allow(library: ctypes.CDLL, rules: int, folder: str) -> None:
    place = os.open(folder, os.O_PATH | os.O_CLOEXEC)
    try:
        library.syscall(ADD_RULE, rules, PATH_BENEATH, ctypes.byref(_Rule(CHANGES, place)), 0)
    finally:
        os.close(place)
