"""search: runs one after another, each chosen by what those before it forecast; choose_modes and tune share it.

A run has is_enough, whether what decides is within tolerances; is_likely, whether the error itself is, too; cost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence


def search(
    run: Callable[[Any], Any],
    firsts: Sequence[Any],
    wanted: Callable[[Sequence[Any]], Any | None],
    most: int,
    watch: Callable[[Iterable[Any]], Iterable[Any]] = iter,
) -> tuple[list[Any], tuple[Any, Exception] | None]:
    """Run what is first, then what is wanted in view of all runs, `most` in all.

    An error ends the search; it is raised where no run before it was enough.

    Returns
    -------
    runs : in their order
    failed : the choice that ended the search, and its error; None: nothing did
    """
    tried = [run(one) for one in firsts]

    def following() -> Iterator[Any]:
        while len(tried) < most and (one := wanted(tried)) is not None:
            yield one

    for one in watch(following()):
        if (error := _added(tried, run, one)) is not None:
            return tried, (one, error)
    return tried, None


def _added(tried: list[Any], run: Callable[[Any], Any], one: Any) -> Exception | None:
    """Add a run to those tried, or return its error where one before it was enough."""
    try:
        tried.append(run(one))
    except Exception as error:
        if cheapest(tried) is None:
            raise
        return error
    return None


def cheapest(runs: Iterable[Any]) -> Any | None:
    """Return the cheapest run that is enough; one whose error is likely within comes before one where it may not be.

    Of equal ones the first; None: there is none.
    """
    return min((run for run in runs if run.is_enough), key=lambda run: (not run.is_likely, run.cost), default=None)
