"""sweep: one function over many parameters, by exudyn.processing.ParameterVariation; a failure stops nothing else."""

from __future__ import annotations

from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple

from exudyn.processing import ParameterVariation

from ...checks import check_choice
from ...errors import InputError, RunError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

# of ParameterVariation, which takes any other name without a word
OPTIONS = (
    "useMultiProcessing",
    "numberOfThreads",
    "useMPI",
    "clusterHostNames",
    "useDispyWebMonitor",
    "showProgress",
    "resultsFile",
    "parameterFunctionData",
    "addComputationIndex",
    "useLogSpace",
    "debugMode",
)
NOT_SERIAL = ("useMPI", "clusterHostNames")


class Failure(str):
    """What a variation left instead of a value: type and message of its exception."""


NO_RESULT = Failure("no result from the dispy cluster: an exception there, or the function returned None")


class Sweep(NamedTuple):
    """Result of a sweep.

    parameters : name -> (variations,), as ParameterVariation returns them. values : what the function returned, in
    that order, or a Failure.
    """

    parameters: dict[str, np.ndarray]
    values: list

    @property
    def failures(self) -> dict[int, Failure]:
        """Position in values -> what went wrong there."""
        return {i: value for i, value in enumerate(self.values) if isinstance(value, Failure)}

    def complete(self) -> list:
        """Return values if every variation has one; RunError lists the failures."""
        if self.failures:
            lines = [f"{self._point(i)}: {failure}" for i, failure in self.failures.items()]
            raise RunError(f"{len(lines)} of {len(self.values)} variations failed:\n" + "\n".join(lines))
        return self.values

    def _point(self, i: int) -> str:
        return ", ".join(f"{name}={x[i]:g}" for name, x in self.parameters.items())


def sweep(function: Callable[[dict], Any], parameters: dict[str, list | tuple], **options: Any) -> Sweep:
    """Call function(dict) for every combination of parameters, one after another or at once; keep every result.

    Parameters
    ----------
    function : callable
        Takes a dict name -> number, returns any value that can be pickled. Defined at the top of a module, and builds
        its model itself: in other processes nothing else of the caller is there.
    parameters : dict
        name -> list of numbers, or (begin, end, count) as in numpy.linspace. The last name varies fastest.
    **options
        Those of exudyn.processing.ParameterVariation, passed through. Default: serial. `useMultiProcessing=True`:
        processes on this machine, `numberOfThreads` of them. With it `useMPI=True`: MPI ranks (mpi4py), or
        `clusterHostNames=[...]`, `useDispyWebMonitor=True`: a dispy cluster. `showProgress` is off unless asked for.

    Returns
    -------
    Sweep
        (parameters, values) in the order ParameterVariation has; a variation that raised has a Failure as its value.

    Raises
    ------
    InputError
        An option that ParameterVariation does not have, parameters that are no numbers or empty, MPI or a cluster
        without useMultiProcessing (Exudyn would run serially).

    Notes
    -----
    Several processes may hang on Linux if a scene was built before in the process that starts them, as with plain
    ParameterVariation: it forks a process that has threads. Build nothing there, or call
    multiprocessing.set_start_method("spawn") first.

    Does not cover: what went wrong on a dispy cluster, which sends the function's source and returns None then; a
    process that is killed, for which Exudyn's pool waits for ever.
    """
    _check(parameters, options)
    options = {"showProgress": False} | options
    if not options.get("clusterHostNames"):
        return Sweep(*ParameterVariation(_Guarded(function), parameters, **options))
    # dispy sends source code, which a guarded function does not have
    points, values = ParameterVariation(function, parameters, **options)
    return Sweep(points, [NO_RESULT if value is None else value for value in values])


def _check(parameters: dict, options: dict) -> None:
    for name in options:
        check_choice("option", name, OPTIONS)
    for name in NOT_SERIAL:
        if options.get(name) and not options.get("useMultiProcessing"):
            raise InputError(f"{name} needs useMultiProcessing=True; without it Exudyn runs serially")
    if not parameters:
        raise InputError("parameters is empty; pass name -> list of numbers, or (begin, end, count)")
    for name, values in parameters.items():
        _check_values(name, values)


def _check_values(name: str, values: object) -> None:
    kind = "list of numbers, or a tuple (begin, end, count)"
    if not isinstance(values, list | tuple) or not values:
        raise InputError(f"parameters[{name!r}]={values!r}; needed: a {kind}")
    if isinstance(values, tuple) and (len(values) != 3 or values[2] < 1):
        raise InputError(f"parameters[{name!r}]={values}; a tuple is (begin, end, count), count 1 or more")
    wrong = [x for x in values if isinstance(x, bool) or not isinstance(x, Real)]
    if wrong:
        raise InputError(f"parameters[{name!r}] has {wrong[0]!r}; needed: a {kind}. Number other things 0, 1, ...")


class _Guarded:
    """The function, with an exception as its value; a class, for other processes to unpickle."""

    def __init__(self, function: Callable[[dict], Any]):
        self.function = function

    def __call__(self, parameters: dict) -> Any:
        try:
            return self.function(parameters)
        except Exception as error:  # whatever it is: the other variations go on
            return Failure(f"{type(error).__name__}: {error}")
