"""A progress bar for long offline work: tqdm's where it is installed and somebody looks, nothing otherwise."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import TypeVar

Item = TypeVar("Item")

PATIENCE = 2.0  # s: what is done before needs no bar


def progress(items: Iterable[Item], text: str, total: int | None = None) -> Iterable[Item]:
    """Return the items; going through them moves a bar on stderr if that is a terminal and tqdm is installed."""
    if sys.stderr is None or not sys.stderr.isatty():
        return items
    try:
        from tqdm import tqdm
    except ImportError:
        return items
    return tqdm(items, desc=text, total=total, delay=PATIENCE, leave=False)
