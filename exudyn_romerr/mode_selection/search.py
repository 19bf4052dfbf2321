"""search: runs one after another, each chosen by what those before it forecast; choose_modes and tune share it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence


class Tried(Protocol):
    """A run that was made. is_enough : what decides is within tolerances. is_likely : the error itself is, too."""

    is_enough: bool
    is_likely: bool
    cost: float


Choice, Run = TypeVar("Choice"), TypeVar("Run", bound=Tried)


def search(
    run: Callable[[Choice], Run],
    firsts: Sequence[Choice],
    wanted: Callable[[Sequence[Run]], Choice | None],
    most: int,
    watch: Callable[[Iterable[Choice]], Iterable[Choice]] = iter,
) -> tuple[list[Run], tuple[Choice, Exception] | None]:
    """Run what is first, then what is wanted in view of all runs, `most` in all.

    An error ends the search; it is raised where no run before it was enough.

    Returns
    -------
    runs : in their order
    failed : the choice that ended the search, and its error; None: nothing did
    """
    tried = [run(one) for one in firsts]

    def following() -> Iterator[Choice]:
        while len(tried) < most and (one := wanted(tried)) is not None:
            yield one

    for one in watch(following()):
        failed = _added(tried, run, one)
        if failed is not None:
            return tried, (one, failed)
    return tried, None


def _added(tried: list[Run], run: Callable[[Choice], Run], one: Choice) -> Exception | None:
    """Add a run to those tried, or return its error where one before it was enough."""
    try:
        tried.append(run(one))
    except Exception as error:
        if cheapest(tried) is None:
            raise
        return error
    return None


def cheapest(runs: Iterable[Run]) -> Run | None:
    """Return the cheapest run that is enough; one whose error is likely within comes before one where it may not be.

    Of equal ones the first; None: there is none.
    """
    return min((run for run in runs if run.is_enough), key=lambda run: (not run.is_likely, run.cost), default=None)
