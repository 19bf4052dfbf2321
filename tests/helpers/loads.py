"""Seeded loads, linear between the samples of a coarse time grid but for given jumps: the truth is then exact."""

from dataclasses import dataclass

import numpy as np

LOADS = ("sine", "constant", "jump", "ramp", "pulse", "noise", "none")


@dataclass(frozen=True)
class Load:
    """u(t) (p,): linear between knots t (P,), values (P, p), plus `height` (p,) from t = jump on."""

    t: np.ndarray
    values: np.ndarray
    jump: float | None = None
    height: np.ndarray | None = None

    def __call__(self, t):
        after = self.jump is not None and t >= self.jump
        return self.smooth(np.array([t]))[0] + (self.height if after else 0.0)

    def smooth(self, t):
        """The part without the jump at times t, (T, p)."""
        return np.column_stack([np.interp(t, self.t, column) for column in self.values.T])

    def sides(self, t):
        """Values right of the start and left of the end of every step between knots t: two (S, p)."""
        smooth = self.smooth(t)
        if self.jump is None:
            return smooth[:-1], smooth[1:]
        on = (t >= self.jump)[:, None] * self.height
        return smooth[:-1] + on[:-1], smooth[1:] + on[:-1]


def load(kind, t, p, omega, rng):
    """Return a Load of one of LOADS on the grid t (T,) with frequencies around omega."""
    return Load(t, *MAKERS[kind](t, p, omega, rng))


def uneven_grid(h, steps, rng):
    """Times (steps + 1,) from 0 with steps of h, h/2 and h/4 in random order; h a power of 2: no rounding."""
    return np.concatenate([[0.0], np.cumsum(h * rng.choice([1.0, 0.5, 0.25], steps, p=[0.8, 0.1, 0.1]))])


def _sine(t, p, omega, rng):
    frequency, phase = omega * rng.uniform(0.2, 2, p), rng.uniform(0, np.pi, p) * rng.integers(0, 2)
    return (np.sin(frequency * t[:, None] + phase),)


def _constant(t, p, omega, rng):
    return (np.ones((len(t), 1)) * rng.standard_normal(p),)


def _jump(t, p, omega, rng):
    """At a sample or inside a step, on top of a slow ramp."""
    k = int(rng.integers(1, len(t) // 2))
    at = t[k] + rng.integers(0, 2) * 0.25 * (t[k + 1] - t[k])
    return 0.2 * _ramp(t, p, omega, rng)[0], float(at), rng.standard_normal(p)


def _ramp(t, p, omega, rng):
    rise = np.clip(t / t[-1] / rng.uniform(0.1, 1), 0, 1)
    return (rise[:, None] * rng.standard_normal(p),)


def _pulse(t, p, omega, rng):
    """A triangle of 10 to 30 steps."""
    first, half = int(rng.integers(0, len(t) // 3)), int(rng.integers(5, 15))
    corners = t[[first, first + half, first + 2 * half]]
    return (np.interp(t, corners, [0, 1, 0])[:, None] * rng.standard_normal(p),)


def _noise(t, p, omega, rng):
    """New random values at every 12th to 40th sample."""
    knots = t[:: int(rng.integers(12, 40))]
    return (np.column_stack([np.interp(t, knots, rng.standard_normal(len(knots))) for _ in range(p)]),)


def _none(t, p, omega, rng):
    return (np.zeros((len(t), p)),)


MAKERS = {
    "sine": _sine,
    "constant": _constant,
    "jump": _jump,
    "ramp": _ramp,
    "pulse": _pulse,
    "noise": _noise,
    "none": _none,
}
