"""sweep: one function over many parameters, by Exudyn or on any executor; a failure stops nothing else."""

from __future__ import annotations

from numbers import Real
from typing import TYPE_CHECKING, Any

from exudyn.processing import ParameterVariation

from ...checks import check_choice
from ...errors import InputError
from .sweeps import Failure, Guarded, ResultFolder, Sweep, read_result, run_on

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping
    from concurrent.futures import Executor

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
# what an executor or a folder leaves to ParameterVariation: the parameter sets
OF_THE_GRID = ("parameterFunctionData", "addComputationIndex", "useLogSpace")


NO_RESULT = Failure("no result from the dispy cluster: an exception there, or the function returned None")


def sweep(
    function: Callable[[dict], Any],
    parameters: Mapping[str, list | tuple],
    *,
    executor: Executor | Callable[[], Executor] | None = None,
    folder: str | os.PathLike | None = None,
    **options: Any,
) -> Sweep:
    """Call function(dict) for every combination of parameters, one after another or at once; keep every result.

    Parameters
    ----------
    function : callable
        Takes a dict name -> number, returns any value that can be pickled. Defined at the top of a module, and builds
        its model itself: in other processes nothing else of the caller is there.
    parameters : dict
        name -> list of numbers, or (begin, end, count) as in numpy.linspace. The last name varies fastest.
    executor : concurrent.futures.Executor, or a function that makes one
        Where variations run: ProcessPoolExecutor, mpi4py's MPIPoolExecutor, those of dask or loky. A process that is
        killed costs its own variation: the executor is made again (a ProcessPoolExecutor, or by the function given),
        and what ran at the same time is repeated.
    folder : path, optional
        For one file a variation, written when it is ready: called again, the sweep takes what is there and runs what
        is missing or failed. Without executor, one after another. `romerr collect FOLDER` makes a table. The function
        returns numbers, texts, None, arrays of numbers, reports, or lists, tuples and dicts of these (no pickle).
    **options
        With executor or folder: parameterFunctionData, addComputationIndex, useLogSpace. Else those of
        exudyn.processing.ParameterVariation, passed through. Default: serial. `useMultiProcessing=True`: processes on
        this machine, `numberOfThreads` of them. With it `useMPI=True`: MPI ranks (mpi4py), or
        `clusterHostNames=[...]`, `useDispyWebMonitor=True`: a dispy cluster. `showProgress` is off unless asked for.

    Returns
    -------
    Sweep
        (parameters, values) in the order ParameterVariation has; a variation that raised has a Failure as its value.

    Raises
    ------
    InputError
        An option that ParameterVariation does not have, or that says where to run beside executor or folder;
        parameters that are no numbers or empty; MPI or a cluster without useMultiProcessing (Exudyn would run
        serially); a folder that cannot be written, a damaged file in it, or a value that has no place there.

    Notes
    -----
    Several processes may hang on Linux if a scene was built before in the process that starts them, as with plain
    ParameterVariation: it forks a process that has threads. Build nothing there, or call
    multiprocessing.set_start_method("spawn") first.

    A result is found again by the function's name, parameters and parameterFunctionData: after a change of the
    function's body delete the folder.

    Does not cover: what went wrong on a dispy cluster, which sends the function's source and returns None then;
    without executor a process that is killed, for which Exudyn's pool waits for ever.
    """
    _check(parameters, options)
    if executor is not None or folder is not None:
        if not (executor is None or callable(executor) or hasattr(executor, "submit")):
            raise InputError(
                f"executor={executor!r}; pass an executor of concurrent.futures, or a function that makes one"
            )
        return _on(executor, folder, function, parameters, options)
    options = {"showProgress": False} | options
    if not options.get("clusterHostNames"):
        return Sweep(*ParameterVariation(Guarded(function), parameters, **options))
    # dispy sends source code, which a guarded function does not have
    points, values = ParameterVariation(function, parameters, **options)
    return Sweep(points, [NO_RESULT if value is None else value for value in values])


def _on(
    executor: Executor | Callable[[], Executor] | None,
    folder: str | os.PathLike | None,
    function: Callable[[dict], Any],
    parameters: dict,
    options: dict,
) -> Sweep:
    for name in options:
        if name not in OF_THE_GRID:
            raise InputError(f"{name} goes with neither executor= nor folder=; allowed: {', '.join(OF_THE_GRID)}")
    points, sets = ParameterVariation(dict, parameters, showProgress=False, **options)
    kept = None if folder is None else ResultFolder(folder, function)
    values = {} if kept is None else _there(kept, sets)

    def done(i: int, value: Any) -> None:
        values[i] = value
        if kept is not None:
            kept.write(sets[i], value)

    left = {i: given for i, given in enumerate(sets) if i not in values}
    if executor is not None:
        run_on(executor, function, left, done)
    else:
        for i, given in left.items():
            done(i, Guarded(function)(given))
    return Sweep(points, [values[i] for i in range(len(sets))])


def _there(kept: ResultFolder, sets: list[dict]) -> dict[int, Any]:
    """What a folder has; a failure is tried again."""
    found = {i: read_result(path) for i, given in enumerate(sets) if (path := kept.path(given)).exists()}
    return {i: result.value for i, result in found.items() if result and not isinstance(result.value, Failure)}


def _check(parameters: dict, options: dict) -> None:
    for name in options:
        check_choice("option", name, OPTIONS)
    for name in NOT_SERIAL:
        if options.get(name) and not options.get("useMultiProcessing"):
            raise InputError(f"{name} needs useMultiProcessing=True; without it Exudyn runs serially")
    if not isinstance(parameters, dict):
        kind = type(parameters).__name__
        raise InputError(f"parameters is a {kind}; pass a dict name -> list of numbers, or (begin, end, count)")
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
