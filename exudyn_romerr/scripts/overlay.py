"""A folder in which a script finds its files and may write, while the user's own stay as they are.

The file tree stands in it once more: links to what lies beside the way to the user's folders, and these themselves.
What is about to be written to is made a private copy first: Python tells of it by audit events, before it happens.
What a script would write elsewhere is refused, by the system what compiled code and other processes would, too.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = {  # events, and which of their arguments are paths that change
    "os.remove": (0,),
    "os.rmdir": (0,),
    "os.mkdir": (0,),
    "os.truncate": (0,),
    "os.chmod": (0,),
    "os.chown": (0,),
    "os.utime": (0,),
    "os.rename": (0, 1),
    "os.link": (1,),
    "os.symlink": (1,),
    "shutil.rmtree": (0,),
    "sqlite3.connect": (0,),
}
ON_LINKS = ("os.remove", "os.rename")  # links go or move, what they lead to stays
REFUSED = "{} is outside the folder of this run, in which alone it may write"
DEVICES = "/dev"
CACHES = ("~/.cache", "~/.config/matplotlib")  # of libraries
# linux/landlock.h, the same on all processors
CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446
VERSION_FLAG, PATH_BENEATH = 1, 1
TRUNCATE_VERSION = 3  # before it files could be emptied, and not be moved to another folder
WRITE_FILE, TRUNCATE = 1 << 1, 1 << 14
OF_FOLDERS = sum(1 << bit for bit in range(4, 14))  # remove, make files and folders of all kinds, move
GUARDED = WRITE_FILE | OF_FOLDERS | TRUNCATE
NO_NEW_PRIVILEGES = 38  # prctl: without it only root may restrict itself


class Overlay:
    """The folder `root` of a run, in which `home`, the user's working folder, stands once more.

    free : folders in which anybody may write, which count unless they are above one of the user's; the first is that
    of this run, above root. refused : paths that the script would have written to.
    """

    def __init__(self, root: str, home: str, free: Sequence[str]):
        self.root, self.refused = os.path.realpath(root), []
        self._users, self._is_busy, self._is_removed = [os.path.realpath(home)], False, False
        self._free = [os.path.realpath(os.path.expanduser(path)) for path in (*free, *CACHES)]
        self._chdir = os.chdir

    @property
    def free(self) -> list[str]:
        """Folders in which a script may write, none of them above one of the user's."""
        free = (place for place in self._free if not any(_within(own, place) for own in self._users))
        return [self.root, *free, DEVICES]

    def enter(self, script: str) -> str:
        """Go there, for the rest of the process; return what stands for the script; its folder is the user's, too."""
        folder, name = os.path.split(os.path.abspath(script))
        self._users.append(os.path.realpath(folder))
        for top in {os.path.splitdrive(path)[0] + os.sep for path in self._users}:
            os.makedirs(self.at(top), exist_ok=True)
            self._fill(self.at(top), top)
        own = os.path.join(self.at(self._users[1]), name)
        self._own(own)  # a copy: even what realpath says of __file__ is in this run's folder
        self._chdir(self._folder(self.at(self._users[0])))
        os.chdir = self.chdir
        sys.addaudithook(self._audit)
        return own

    def at(self, path: str) -> str:
        """Return the place of an absolute path in the folder of this run."""
        drive, rest = os.path.splitdrive(os.path.normpath(path))
        return os.path.normpath(os.path.join(self.root, *_parts(drive.replace(":", "")), *_parts(rest)))

    def remove(self) -> None:
        """Remove the folder above root, whose other files are of this run, too; nothing is looked at from now on."""
        self._is_removed = True
        shutil.rmtree(self._free[0], ignore_errors=True)

    def chdir(self, path: Any) -> None:
        """Go to what stands for a folder: one of the user's is never the current one."""
        full = self._full(os.fsdecode(path))
        is_ours = not self._is_inside(full) and any(_within(full, place) for place in self.free)
        self._chdir(full if is_ours or not os.path.isdir(full) else self._folder(self._inside(full)))

    def place(self, path: str, keep: bool = False) -> str:
        """Return where Exudyn, whose writing Python does not see, may write; keep : what is there is needed."""
        if not path:
            return path
        full = self._full(path)
        if _within(full, self._free[0]) and not self._is_inside(full):  # a temporary file of this run
            return path
        inside = self._inside(full)
        with self._busy():
            self._own(inside, keep)
            os.makedirs(os.path.dirname(inside), exist_ok=True)
        return inside if os.path.isabs(path) else path

    @contextmanager
    def _busy(self) -> Iterator[None]:
        """What is done here raises events, too, which are none of the script's."""
        was_busy, self._is_busy = self._is_busy, True
        try:
            yield
        finally:
            self._is_busy = was_busy

    def _folder(self, inside: str) -> str:
        """Return a folder of this run, made of links to what is in the one that it stands for."""
        with self._busy():
            self._own(os.path.join(inside, "x"))
        return inside

    def _audit(self, event: str, arguments: tuple) -> None:
        if self._is_busy or self._is_removed or (event != "open" and event not in CHANGES):
            return
        is_open = event == "open"
        if is_open and not arguments[2] & WRITES:
            return
        keep = not (is_open and arguments[2] & os.O_TRUNC)
        with self._busy():
            for path in (arguments[i] for i in ((0,) if is_open else CHANGES[event])):
                if isinstance(path, str | bytes | os.PathLike):
                    self._allow(os.fsdecode(path), keep, event in ON_LINKS)

    def _allow(self, path: str, keep: bool, as_link: bool) -> None:
        """Make a path the script's own, or refuse it; keep : its contents; as_link : only the way to it."""
        full = self._full(path)
        real = os.path.realpath(full)
        if self._is_inside(full):
            self._own(full, keep, as_link)
        elif not any(_within(real, place) for place in self.free) and path != ":memory:":
            self.refused.append(full)
            raise PermissionError(REFUSED.format(full))

    def _own(self, full: str, keep: bool = True, as_link: bool = False) -> None:
        """Replace links on the way to a path by folders of links, and one at its end by a copy, or nothing."""
        at = self.root
        for part in _parts(os.path.relpath(os.path.dirname(full), self.root)):
            at = os.path.join(at, part)
            if os.path.islink(at) and os.path.isdir(at):
                self._unfold(at, os.path.realpath(at))
        if os.path.islink(full) and not as_link:
            real = os.path.realpath(full)
            if os.path.isdir(real):
                self._unfold(full, real)
                return
            os.remove(full)
            if keep and os.path.exists(real):
                shutil.copy2(real, full)

    def _unfold(self, link: str, real: str) -> None:
        os.remove(link)
        os.mkdir(link)
        self._fill(link, real)

    def _fill(self, own: str, real: str) -> None:
        """Put links to what is in a folder; where there are none, copies of what is the user's."""
        try:
            entries = list(os.scandir(real))
        except PermissionError:  # somebody else's, which one may go through but not list: the way itself is enough
            ways = [x for x in self._users if _within(x, real) and x != real]
            names = {_parts(os.path.relpath(way, real))[0] for way in ways}
            entries = []
            for name in names:
                os.symlink(os.path.join(real, name), os.path.join(own, name), target_is_directory=True)
        for entry in entries:
            to = os.path.join(own, entry.name)
            try:
                os.symlink(entry.path, to, target_is_directory=entry.is_dir())
            except OSError:  # Windows, without the right to make links
                self._copy(entry, to)

    def _copy(self, entry: os.DirEntry, to: str) -> None:
        if any(_within(entry.path, own) for own in self._users):
            (shutil.copytree if entry.is_dir() else shutil.copy2)(entry.path, to)
        elif any(_within(own, entry.path) for own in self._users):
            os.mkdir(to)
            self._fill(to, entry.path)

    def _full(self, path: str) -> str:
        return os.path.normpath(os.path.join(os.getcwd(), path))

    def _inside(self, full: str) -> str:
        return full if self._is_inside(full) else self.at(full)

    def _is_inside(self, path: str) -> bool:
        return _within(path, self.root)


def _parts(path: str) -> list[str]:
    return [part for part in path.replace(os.sep, "/").split("/") if part not in ("", ".")]


def _within(path: str, folder: str) -> bool:
    return path == folder or path.startswith(folder.rstrip(os.sep) + os.sep)


class _Rule(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("allowed", ctypes.c_uint64), ("folder", ctypes.c_int32))


def write_only_in(folders: Iterable[str]) -> bool:
    """Let this process, and what it starts, change files in these folders only; whether that holds now.

    Python tells nothing of what HDF5, VTK or a mesh generator write. Linux (from 6.2 on) lets a process give up
    rights for itself and all that it starts: Landlock. Elsewhere this does nothing.
    """
    if not sys.platform.startswith("linux"):
        return False
    library = ctypes.CDLL(None)
    if library.syscall(CREATE_RULESET, None, ctypes.c_size_t(0), VERSION_FLAG) < TRUNCATE_VERSION:
        return False
    handled = ctypes.c_uint64(GUARDED)
    rules = library.syscall(CREATE_RULESET, ctypes.byref(handled), ctypes.c_size_t(ctypes.sizeof(handled)), 0)
    if rules < 0:
        return False
    for folder in folders:
        if os.path.isdir(folder):
            _add_rule(library, rules, folder)
    library.prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    is_held = library.syscall(RESTRICT_SELF, rules, 0) == 0
    os.close(rules)
    return is_held


def _add_rule(library: ctypes.CDLL, rules: int, folder: str) -> None:
    place = os.open(folder, os.O_PATH | os.O_CLOEXEC)
    try:
        library.syscall(ADD_RULE, rules, PATH_BENEATH, ctypes.byref(_Rule(GUARDED, place)), 0)
    finally:
        os.close(place)
