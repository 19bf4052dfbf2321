"""Run a script as `python script.py` does, so that the script cannot tell; needs nothing but the standard library."""

from __future__ import annotations

import io
import os
import signal
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.machinery import SourceFileLoader
from types import CodeType, ModuleType
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..process.own_frames import without_our_frames

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

FAILED, INTERRUPTED = 1, 130  # exit statuses, as of python and as shells have them
EXIT_CODES = 256


@dataclass(frozen=True)
class Ending:
    """How a script ended: exit status, the exception that ended it but SystemExit, text for stderr of sys.exit.

    began : whether a line of it was run; not where it is no Python.
    """

    status: int = 0
    error: BaseException | None = None
    said: str = ""
    began: bool = True

    def show(self) -> None:
        """Print what python prints when a script ends so."""
        if self.said:
            print(self.said, file=sys.stderr)
        if self.error is not None:
            sys.excepthook(type(self.error), self.error, self.error.__traceback__)

    def leave(self) -> None:
        """End the process as python ends it; where it returns, the exit status is `status`."""
        if isinstance(self.error, KeyboardInterrupt) and os.name == "posix":
            _flush()
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            os.kill(os.getpid(), signal.SIGINT)


def check_script(path: str | os.PathLike) -> str:
    """Return the path as a string.

    Raises
    ------
    InputError
        Nothing is there, or it is a folder, or it cannot be read.
    """
    script = os.fspath(path)
    if os.path.isdir(script):
        raise InputError(f"{script} is a folder; name a script in it, such as {os.path.join(script, 'model.py')}")
    if not os.path.exists(script):
        raise InputError(f"there is no script {script!r} here, in {os.getcwd()}")
    if not os.access(script, os.R_OK):
        raise InputError(f"{script} cannot be read: no permission")
    return script


def execute(script: str, arguments: Sequence[str] = ()) -> Ending:
    """Run a script in this process, in a new module __main__; what it raises is in the Ending, not raised.

    Modules, sys.argv, sys.path are those of this process again afterwards.

    Raises
    ------
    InputError
        No such script.
    """
    script = check_script(script)
    module = ModuleType("__main__")
    with _as_main(module, script, arguments):
        try:
            code = _compiled(module.__file__)
        except (SyntaxError, ValueError) as error:  # ValueError: null bytes
            return Ending(FAILED, without_our_frames(error), began=False)
        try:
            exec(code, module.__dict__)
        except SystemExit as end:
            return _exited(end.code)
        except BaseException as error:  # whatever it is: python would print it and end
            return Ending(INTERRUPTED if isinstance(error, KeyboardInterrupt) else FAILED, without_our_frames(error))
    return Ending()


def _compiled(file: str) -> CodeType:
    with io.open_code(file) as source:
        return compile(source.read(), file, "exec", dont_inherit=True)


@contextmanager
def _as_main(module: ModuleType, script: str, arguments: Sequence[str]) -> Iterator[None]:
    """Let the process look as it does to a script that python runs."""
    file, name = os.path.abspath(script), module.__name__
    own = {"__annotations__": {}, "__builtins__": sys.modules["builtins"], "__file__": file, "__cached__": None}
    module.__dict__.update(own, __loader__=SourceFileLoader(name, file))
    before, argv, path = sys.modules.get(name), sys.argv, sys.path[:]
    sys.modules[name], sys.argv = module, [script, *arguments]
    if not getattr(sys.flags, "safe_path", False):
        sys.path[:1] = [os.path.dirname(os.path.realpath(script))]
    try:
        yield
    finally:
        sys.argv, sys.path[:] = argv, path
        if before is not None:
            sys.modules[name] = before
        else:
            del sys.modules[name]


def _exited(code: Any) -> Ending:
    """What sys.exit(code) means."""
    if code is None or isinstance(code, int):
        return Ending((code or 0) % EXIT_CODES)
    return Ending(FAILED, said=str(code))


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
