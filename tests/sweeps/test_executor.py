"""Sweeps on executors: what is killed costs its own variation only."""

import multiprocessing
import os
import signal
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.mbs.studies.sweeps import Failure, run_on

GRID = {"a": [1, 2, 3], "b": [0.5, 4.0]}
PRODUCTS = [0.5, 4.0, 1.0, 8.0, 1.5, 12.0]
SPAWN = multiprocessing.get_context("spawn")  # a fork of a process that has threads may hang


def product(parameters):
    return parameters["a"] * parameters["b"]


def product_or_error(parameters):
    if product(parameters) == 1.0:
        raise ZeroDivisionError("two halves")
    return product(parameters)


def product_or_death(parameters):
    """In a process of its own: as if it had been killed for its memory."""
    if parameters["a"] in parameters.get("deadly", [2]):
        os.kill(os.getpid(), signal.SIGKILL)
    return product(parameters)


def no_pickle(parameters):
    return (lambda: 0) if parameters["a"] == 2 else 1


def two_processes():
    return ProcessPoolExecutor(2, SPAWN)


@pytest.mark.parametrize("make", [lambda: ThreadPoolExecutor(2), lambda: ThreadPoolExecutor(9), lambda: InCaller()])
def test_any_executor_gives_what_a_serial_sweep_gives(make):
    serial = romerr.sweep(product, GRID)
    with make() as executor:
        given = romerr.sweep(product, GRID, executor=executor)
        assert executor.submit(product, {"a": 1, "b": 1}).result() == 1  # it is the caller's, and still open
    for found in (given, romerr.sweep(product, GRID, executor=make)):
        assert found.values == serial.values == PRODUCTS
        for name in GRID:
            np.testing.assert_array_equal(found.parameters[name], serial.parameters[name])


class InCaller(Executor):
    """The least that an executor is: submit; nothing says how many workers it has."""

    def submit(self, function, /, *given, **named):
        future = Future()
        try:
            future.set_result(function(*given, **named))
        except BaseException as error:
            future.set_exception(error)
        return future


def test_an_exception_leaves_the_other_variations():
    with ThreadPoolExecutor(2) as executor:
        result = romerr.sweep(product_or_error, GRID, executor=executor)
    assert result.values == [0.5, 4.0, "ZeroDivisionError: two halves", 8.0, 1.5, 12.0]
    assert list(result.failures) == [2]


def test_options_of_the_grid_reach_the_function():
    options = {"parameterFunctionData": {"x": "y"}, "addComputationIndex": True, "useLogSpace": True}
    with ThreadPoolExecutor(1) as executor:
        values = romerr.sweep(dict, {"a": (1, 100, 3)}, executor=executor, **options).values
    assert values == [
        {"a": pytest.approx(10.0**i), "computationIndex": i, "functionData": {"x": "y"}} for i in range(3)
    ]


def test_a_killed_process_costs_its_own_variation_only():
    """Given as an executor or as a function that makes one; without __main__: processes import this module."""
    with two_processes() as executor:
        values = {}
        run_on(executor, product_or_death, sets_of(6, deadly=[2, 5]), values.__setitem__)
    assert [i for i, x in values.items() if isinstance(x, Failure)] in ([2, 5], [5, 2])
    assert {i: x for i, x in values.items() if i not in (2, 5)} == {0: 0, 1: 1, 3: 3, 4: 4}
    assert "killed, out of memory" in values[2]


def sets_of(count, **more):
    return {i: {"a": i, "b": 1, **more} for i in range(count)}


def test_a_result_that_cannot_be_sent_is_a_failure():
    values = {}
    run_on(two_processes, no_pickle, sets_of(4), values.__setitem__)
    assert {i: x for i, x in values.items() if i != 2} == {0: 1, 1: 1, 3: 1}
    assert "pickle" in values[2]


class Fragile(InCaller):
    """Breaks at a = 2, and for good."""

    broken = False

    def submit(self, function, /, *given, **named):
        self.broken = self.broken or given[0]["a"] == 2
        if self.broken:
            raise BrokenExecutor("a worker left")
        return super().submit(function, *given, **named)


def test_an_executor_that_cannot_be_made_again_says_how_it_could_be():
    once, again = (romerr.sweep(product, GRID, executor=given) for given in (Fragile(), Fragile))
    assert once.values[:2] == [0.5, 4.0]
    assert all("executor=lambda: Fragile(...)" in once.values[i] for i in range(2, 6))
    assert [*again.values[:2], *again.values[4:]] == [0.5, 4.0, 1.5, 12.0]
    assert list(again.failures) == [2, 3]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"useMultiProcessing": True}, "useMultiProcessing goes with neither executor= nor folder="),
        ({"resultsFile": "x.txt"}, "resultsFile goes with neither"),
        ({"numberOfThread": 2}, "option='numberOfThread' is unknown"),
    ],
)
@pytest.mark.parametrize("where", ["executor", "folder"])
def test_options_that_say_where_to_run_are_refused(options, message, where, tmp_path):
    given = {"executor": InCaller()} if where == "executor" else {"folder": tmp_path / "results"}
    with pytest.raises(romerr.InputError, match=message):
        romerr.sweep(product, GRID, **given, **options)
    assert list(tmp_path.iterdir()) == []
