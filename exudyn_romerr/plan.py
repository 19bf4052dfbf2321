"""Plan: what is computed for a scene, and what is left out and why."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Plan:
    """Readable with print().

    computed : lines; left_out : (what, why) pairs.
    """

    computed: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        lines = ["computed:", *(f"  {line}" for line in self.computed)]
        if self.left_out:
            lines += ["left out:", *(f"  {what}: {why}" for what, why in self.left_out)]
        return "\n".join(lines)
