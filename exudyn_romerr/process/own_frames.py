"""Exceptions of the user's without frames of this package: in tracebacks, and in what Exudyn writes of them."""

from __future__ import annotations

import os
import re
import sys
from types import TracebackType

OURS = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))  # the package: its frames are no news to users
# In what Exudyn adds to exceptions: a frame of ours, or of what starts us; the frame that called Exudyn last
PLACE = re.compile(rf"^  (?:{re.escape(OURS)}.*|<frozen runpy>)\(\d+\): .*\n", re.MULTILINE)
LAST_PLACE = re.compile(rf"\[Python file '{re.escape(OURS)}[^']*', line \d+\]")


def without_our_frames(error: BaseException) -> BaseException:
    """Return the exception, its causes too, without frames of this package in its traceback."""
    seen: list[BaseException] = []
    waiting: list[BaseException | None] = [error]
    while waiting:
        one = waiting.pop()
        if one is not None and not any(one is other for other in seen):
            seen.append(one)
            one.__traceback__ = _kept(one.__traceback__)
            waiting += [one.__cause__, one.__context__]
    return error


def _kept(trace: TracebackType | None) -> TracebackType | None:
    """The traceback without our frames; from its end on, for one of a deep recursion has a thousand."""
    traces: list[TracebackType] = []
    while trace is not None:
        if not os.path.abspath(trace.tb_frame.f_code.co_filename).startswith(OURS + os.sep):
            traces.append(trace)
        trace = trace.tb_next
    kept = None
    for one in reversed(traces):
        kept = TracebackType(kept, one.tb_frame, one.tb_lasti, one.tb_lineno)
    return kept


def without_our_places(error: BaseException) -> BaseException:
    """Return the exception, in whose text Exudyn lists frames, without those of this package.

    Exudyn names the frame that called it last, too: the user's, not ours.
    """
    if len(error.args) == 1 and isinstance(text := error.args[0], str) and OURS in text:
        frame = sys._getframe(1)
        while frame is not None and _is_between(frame.f_code.co_filename):
            frame = frame.f_back
        place = "" if frame is None else f"[Python file '{frame.f_code.co_filename}', line {frame.f_lineno}]"
        error.args = (PLACE.sub("", LAST_PLACE.sub(lambda _: place, text)),)
    return error


def _is_between(file: str) -> bool:
    return file.startswith(OURS) or "site-packages/exudyn/" in file.replace("\\", "/")
