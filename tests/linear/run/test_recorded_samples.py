"""What a run keeps of its samples: of q, which is long, single rows and the last block."""

from types import SimpleNamespace

import numpy as np

from exudyn_romerr.linear.residual.samples import Samples
from exudyn_romerr.linear.run.record import RecordedSamples

ROWS, n = 50, 40
OFFLINE = SimpleNamespace(
    outputs_of=lambda q, q_t: q[:, :1], mass_root=np.eye(n), input_rounding=None, static_errors=None, views=()
)


def recorded(positions):
    """Blocks of a run whose bounds of |e|_M are `positions` (blocks, 50); q says which sample it is of."""
    known = {"energy": SimpleNamespace(position=np.zeros(0)), "auxiliary": SimpleNamespace(position=np.zeros(0))}
    found = RecordedSamples(OFFLINE, lambda: known)
    for i, part in enumerate(positions):
        numbers = np.arange(i * ROWS, (i + 1) * ROWS, dtype=float)
        q = np.tile(numbers[:, None], n)
        known["energy"].position = np.append(known["energy"].position, part)
        known["auxiliary"].position = np.append(known["auxiliary"].position, part[::-1])
        new = Samples(numbers, q, q, q, np.zeros((ROWS, 0)), np.zeros((ROWS, 0)))
        found.append(new, SimpleNamespace(outputs=q[:, :1]), 0.0)
    return found, known


def test_motions_where_bounds_are_largest_are_known_and_no_others_are_kept():
    """Largest at first, in between, in the last block; twice as large as those before, or never again."""
    for at in (0, 3, 5):
        positions = np.random.default_rng(at).uniform(0, 1, (6, ROWS))
        positions[at, 17] = 2.0
        found, known = recorded(positions)
        for bounds in known.values():
            i = int(np.argmax(bounds.position))
            np.testing.assert_array_equal(found._motion(i), np.full(n, i))
        kept = [q if q.base is None else q.base for _, q in found._motions]
        assert sum(q.nbytes for q in kept) <= 8 * n * (ROWS + len(known))
