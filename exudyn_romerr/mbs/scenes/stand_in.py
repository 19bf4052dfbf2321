"""Standing in front of Exudyn's functions, and going away again."""

from __future__ import annotations

from typing import Any


class StandIn:
    """Functions of classes that were replaced, to be put back."""

    def __init__(self) -> None:
        self._replaced: list[tuple[Any, str, Any]] = []

    def replace(self, owner: Any, name: str, function: Any) -> None:
        """Put a function in place of the one that a class has under that name."""
        self._replaced.append((owner, name, getattr(owner, name)))
        setattr(owner, name, function)

    def uninstall(self) -> None:
        """Put back all that was replaced, the last first."""
        while self._replaced:
            setattr(*self._replaced.pop())
