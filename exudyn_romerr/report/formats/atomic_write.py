"""Files that are written whole or not at all."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from typing import BinaryIO
from uuid import uuid4

from ...errors import InputError

FULL = (errno.ENOSPC, errno.EDQUOT)  # disk, quota


def write_whole(path: str | os.PathLike, write: Callable[[BinaryIO], None]) -> None:
    """Let `write` fill a file; one that is at `path` already is replaced when all is written, and not before.

    Raises
    ------
    InputError
        The file cannot be written: disk full, no such folder, no permission.
    """
    try:
        if os.path.exists(path) and not os.path.isfile(path):  # devices and pipes are never replaced
            with open(path, "wb") as stream:
                write(stream)
        else:
            _replace(os.path.realpath(path), write)  # what a link points to, not the link
    except OSError as error:
        raise InputError(f"path={os.fspath(path)!r} cannot be written: {_why(path, error)}") from error


def _why(path: str | os.PathLike, error: OSError) -> str:
    """What is wrong, and what to do."""
    folder = os.path.dirname(os.fspath(path))
    if folder and not os.path.exists(folder):
        return f"folder {folder!r} does not exist: make it, or pass another path"
    if os.path.isdir(path):
        return "it is a folder; pass the name of a file"
    todo = "make room, or pass another path" if error.errno in FULL else "pass another path"
    return f"{error.strerror or error}; a file that was there is as it was: {todo}"


def _replace(target: str, write: Callable[[BinaryIO], None]) -> None:
    is_there = os.path.exists(target)
    if is_there:  # replacing it would need no permission to write it
        open(target, "r+b").close()
    beside = os.path.join(os.path.dirname(target), f".{uuid4().hex}.part")
    try:
        with open(beside, "xb") as stream:
            write(stream)
            stream.flush()
            os.fsync(stream.fileno())  # some disks are found full only now
        if is_there:
            shutil.copymode(target, beside)
        os.replace(beside, target)
    except BaseException:  # an interrupt, too, leaves nothing behind
        with suppress(OSError):
            os.unlink(beside)
        raise
