"""Solve: what is known of one solve of a script, as found from outside."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..report.report import BoundReport


@dataclass
class Solve:
    """A solve that moved reduced flexible bodies.

    number : from 0. kind : "dynamic" or "static". bodies : how many. report : None where there is none; failure says
    why then. refused : (body, why) of bodies that are not watched. sensors : names of all sensors of the mbs.
    chosen : whether outputs were chosen for a scene without sensors. notes : what else is to be said.
    until : of a solve without report that ended early, when and by what.
    seconds, our_seconds : CPU time of the solve with us, and of what we do before and after it.
    """

    number: int
    kind: str
    bodies: int
    report: BoundReport | None = None
    failure: Exception | None = None
    refused: list[tuple[str, str]] = field(default_factory=list)
    sensors: list[str] = field(default_factory=list)
    chosen: bool = False
    notes: list[str] = field(default_factory=list)
    until: str = ""
    seconds: float = 0.0
    our_seconds: float = 0.0
