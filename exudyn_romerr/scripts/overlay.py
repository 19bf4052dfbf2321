"""A folder in which a script finds its files and may write, while the user's own stay as they are.

It holds links to what lies in the user's folder. What is about to be written to is made a private copy first: Python
tells of it by audit events, before it happens. What a script would write elsewhere is refused.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from typing import Any

WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
CHANGES = {  # events, and which of their arguments are paths that change
    "os.remove": (0,),
    "os.rmdir": (0,),
    "os.mkdir": (0,),
    "os.truncate": (0,),
    "os.chmod": (0,),
    "os.rename": (0, 1),
    "os.link": (1,),
    "os.symlink": (1,),
    "shutil.rmtree": (0,),
}
ON_LINKS = ("os.remove", "os.rename")  # links go or move, what they lead to stays
REFUSED = "{} is outside the folder of this run, in which alone it may write"
DEVICES = "/dev/"


class Overlay:
    """The folder `root` of a run; `home` stands for the user's working folder in it.

    refused : paths that the script would have written to.
    """

    def __init__(self, root: str, home: str):
        self.root, self.refused = os.path.realpath(root), []
        self._folders: dict[str, str] = {}
        self._users, self._is_busy = [os.path.realpath(home)], False
        free = (tempfile.gettempdir(), "~/.cache", "~/.config/matplotlib")  # caches of libraries
        self._free = [os.path.realpath(os.path.expanduser(path)) for path in free]
        self._chdir = os.chdir

    def enter(self, script: str) -> None:
        """Go there, for the rest of the process; script : whose folder is the user's, too."""
        self._users.append(os.path.dirname(os.path.realpath(script)))
        self._chdir(self.folder(self._users[0]))
        os.chdir = self.chdir
        sys.addaudithook(self._audit)

    def chdir(self, path: Any) -> None:
        """Go to what stands for a folder: one of the user's is never the current one."""
        real = os.path.realpath(path)
        self._chdir(real if self._is_inside(real) or not os.path.isdir(real) else self.folder(real))

    def folder(self, real: str) -> str:
        """Return the folder that stands for one of the user's."""
        if real not in self._folders:
            own = self._folders[real] = os.path.join(self.root, f"folder{len(self._folders)}")
            os.mkdir(own)
            self._fill(own, real)
        return self._folders[real]

    def place(self, path: str) -> str:
        """Return where Exudyn, whose writing Python does not see, may write instead of a path; as an empty file."""
        if not path:
            return path
        inside = os.path.normpath(os.path.join(os.getcwd(), path))
        if not self._is_inside(inside):
            inside = os.path.join(self.root, "elsewhere", os.path.basename(path))
        self._is_busy = True
        try:
            self._own(inside, keep=False)
            os.makedirs(os.path.dirname(inside), exist_ok=True)
        finally:
            self._is_busy = False
        return inside if os.path.isabs(path) or os.path.relpath(inside) != os.path.normpath(path) else path

    def _audit(self, event: str, arguments: tuple) -> None:
        if self._is_busy or (event != "open" and event not in CHANGES):
            return
        self._is_busy = True  # what is done here raises events, too
        try:
            if event == "open":
                path, _, flags = arguments
                if isinstance(path, str | bytes | os.PathLike) and flags & WRITES:
                    self._allow(os.fsdecode(path), keep=not flags & os.O_TRUNC)
            else:
                for i in CHANGES[event]:
                    if isinstance(arguments[i], str | bytes | os.PathLike):
                        self._allow(os.fsdecode(arguments[i]), keep=True, as_link=event in ON_LINKS)
        finally:
            self._is_busy = False

    def _allow(self, path: str, keep: bool, as_link: bool = False) -> None:
        """Make a path the script's own, or refuse it; keep : its contents; as_link : only the way to it."""
        full = os.path.normpath(os.path.join(os.getcwd(), path))
        if self._is_inside(full):
            self._own(full, keep, as_link)
            return
        real = os.path.realpath(full)
        is_free = any(_within(real, place) for place in self._free) or full.startswith(DEVICES)
        if self._is_inside(real) or (is_free and not any(_within(real, place) for place in self._users)):
            return
        self.refused.append(full)
        raise PermissionError(REFUSED.format(full))

    def _own(self, full: str, keep: bool, as_link: bool = False) -> None:
        """Replace links on the way to a path by folders of links, and one at its end by a copy, or nothing."""
        at = self.root
        for part in os.path.relpath(os.path.dirname(full), self.root).split(os.sep):
            at = os.path.join(at, part)
            if os.path.islink(at):
                real = os.path.realpath(at)
                os.remove(at)
                os.mkdir(at)
                self._fill(at, real)
        if os.path.islink(full) and not as_link:
            real = os.path.realpath(full)
            os.remove(full)
            if os.path.isdir(real):
                os.mkdir(full)
                self._fill(full, real)
            elif keep and os.path.exists(real):
                shutil.copy2(real, full)

    @staticmethod
    def _fill(own: str, real: str) -> None:
        """Put links to what is in a folder of the user's; copies where there are no links."""
        for entry in os.scandir(real):
            to = os.path.join(own, entry.name)
            try:
                os.symlink(entry.path, to, target_is_directory=entry.is_dir())
            except OSError:  # Windows, without the right to make links
                (shutil.copytree if entry.is_dir() else shutil.copy2)(entry.path, to)

    def _is_inside(self, path: str) -> bool:
        return _within(path, self.root)


def _within(path: str, folder: str) -> bool:
    return path == folder or path.startswith(folder + os.sep)
