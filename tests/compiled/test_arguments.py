"""What compiled loops are given: sizes, shapes and kinds of numbers are looked at before any number is."""

import numpy as np
import pytest

TURNS = [(2, 3)] * 4  # of a body in closed form: w, alpha, b, g; then c, c1, c2 and sums over its nodes
BODY = [*TURNS, *[(2, 1)] * 3, (3,), (3, 3), (3, 4), (3, 3, 4), (9, 4, 4), (3, 4, 4), *[(4, 4)] * 3]
CALLS = {  # sizes that are right, and shapes of the arrays
    "oscillators": ((5, 4, 3), [(2, 3), (2, 2, 3), (2, 4, 3), (5, 4, 3), (5, 2, 3)]),
    "rows_times": ((7, 5, 3), [(7, 5), (3, 5), (7, 3)]),
    "squares": ((7, 5, 3), [(7, 5), (3, 5), (7,)]),
    "curves": ((5, 2, 3, 0.1, 0.2), [(5,), *[(6, 2)] * 3, (6, 3), (5, 6, 3), (6, 7), (5, 6, 7)]),
    "lengths": ((5, 2, 4, 7), [(5, 3, 4), (7, 4), (5,)]),
    "interpolate": ((5, 3), [*[(5, 3)] * 2, (5, 9, 3), (6, 6), (5, 6), (5, 6, 3), *[(5, 3)] * 2]),
    "largest_sizes": ((7, 5), [(7, 5), (5,)]),
    "decaying_sums": ((2, 5), [*[(2, 5)] * 2, (2,), (2, 5)]),
    "moved_motion": (
        (2, 1, 4),
        [(2, 3, 3), *TURNS, *[(2, 1)] * 3, *[(2, 10)] * 3, (2, 3, 3), *TURNS, *[(2, 4)] * 3],
    ),
    "body_residual": ((2, 1, 4, 0.5), [*BODY, (2, 10)]),
    "body_tangent": ((2, 1, 3, 4, 0.5), [*BODY, (9, 3, 1), *[(2, 9, 9)] * 3, *[(2, 9, 1)] * 5]),
    "inside": ((5, 4, 3), [(3,), (5,), (5, 2, 3), (5, 4, 3), (5, 2, 3)]),
}


def arguments(name):
    """Sizes and arrays that a loop takes."""
    sizes, shapes = CALLS[name]
    return [*sizes], [np.ones(shape) for shape in shapes]


@pytest.mark.parametrize("name", CALLS)
def test_numbers_of_other_kinds_and_shapes_are_refused(name, compiled):
    """Their bytes would be read as another number's: all of these have eight, as floats have."""
    sizes, arrays = arguments(name)
    getattr(compiled, name)(*sizes, *arrays)
    for i, array in enumerate(arrays):
        for kind in ("i8", "c8", ">f8"):
            with pytest.raises(ValueError, match="in place of"):
                getattr(compiled, name)(*sizes, *arrays[:i], array.astype(kind), *arrays[i + 1 :])
        with pytest.raises(ValueError, match="in place of"):  # nothing is read or written beyond the end of an array
            getattr(compiled, name)(*sizes, *arrays[:i], array[:-1], *arrays[i + 1 :])
        if array.ndim > 1:
            with pytest.raises(ValueError, match="not C-contiguous"):
                getattr(compiled, name)(*sizes, *arrays[:i], np.repeat(array, 2, axis=-1)[..., ::2], *arrays[i + 1 :])


@pytest.mark.parametrize("name", CALLS)
def test_sizes_that_overflow_or_are_negative_are_refused(name, compiled):
    """So many empty arrays, whose bytes are zero modulo 2^64, were taken: nothing is to be read of them."""
    sizes, arrays = arguments(name)
    empty = [np.zeros(0)] * len(arrays)
    for i in (i for i, size in enumerate(sizes) if isinstance(size, int)):
        for given, wrong in ((empty, 2**61), (empty, -(2**63)), (arrays, -1)):
            of_all = [2**61 if wrong == 2**61 and isinstance(x, int) else x for x in sizes]
            with pytest.raises(ValueError, match=r"negative|too large"):
                getattr(compiled, name)(*of_all[:i], wrong, *of_all[i + 1 :], *given)


def test_without_points_in_a_step_nothing_is_looked_at(compiled):
    with pytest.raises(ValueError, match="negative"):
        compiled.inside(5, 0, 3, np.ones(3), np.ones(5), np.ones((5, 2, 3)), np.ones((5, 0, 3)), np.ones((5, 2, 3)))
