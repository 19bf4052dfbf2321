"""The bar of models/driven_bar.py under exactly prescribed motion of its left face: all modes, integrated to 1e-11.

It uses nothing of the package. `python -m models.driven_truth` writes what it finds to models/data (half a minute).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from models import floating, hex_bar

DATA = Path(__file__).parent / "data" / "driven_bar.npz"
STEP = 2.5e-4  # s, of what is stored
END = 0.04  # s
SENSORS = ("displacement", "position", "velocity", "displacement local", "velocity local")
FORCE = np.array([0.0, 5.0, -3.0])  # N, times sin(60 t)^2
WEIGHT = (0.0, 3.0, -9.81)  # m/s^2


def fourth(rate: float, size: float) -> Callable[[float], np.ndarray]:
    """Size sin(rate t)^4 and its first two derivatives: smooth from rest."""

    def motion(t: float) -> np.ndarray:
        s, c = np.sin(rate * t), np.cos(rate * t)
        return size * np.array([s**4, 4 * rate * s**3 * c, 4 * rate**2 * (3 * s**2 * c**2 - s**4)])

    return motion


STOP = 0.0163  # s


def stopped(t: float) -> np.ndarray:
    """Part of a cosine that ends inside a step: accelerations jump at its beginning and at its end."""
    angle, goes = 200.0 * min(t, STOP), t < STOP
    return 0.01 * np.array([1 - np.cos(angle), goes * 200 * np.sin(angle), goes * 4e4 * np.cos(angle)])


MOTIONS = {
    "turns": {4: fourth(30.0, 0.1)},
    "shifts": {2: fourth(30.0, 0.02)},
    "tumbles": {0: fourth(30.0, 0.02), 3: fourth(25.0, 0.4), 4: fourth(30.0, -0.3), 5: fourth(40.0, 0.6)},
    "turns round": {4: fourth(20.0, 12.5)},
    "stops": {2: stopped},
}


def offsets(name: str) -> Callable[[float], np.ndarray]:
    """F(t), f'(t), f''(t) side by side (3, 6)."""
    parts = MOTIONS[name]

    def motion(t: float) -> np.ndarray:
        found = np.zeros((3, 6))
        for axis, part in parts.items():
            found[:, axis] = part(t)
        return found

    return motion


UNITS = np.cross(np.eye(3)[:, None], np.eye(3)).swapaxes(1, 2)  # e~ of the three axes


def rotation(angles: np.ndarray) -> tuple[np.ndarray, ...]:
    """Rx Ry Rz of angles and their derivatives (3, 3), with its first two derivatives."""
    A = np.eye(3), np.zeros((3, 3)), np.zeros((3, 3))
    for axis in range(3):
        e, (a, a_t, a_tt) = UNITS[axis], angles[:, axis]
        R = np.eye(3) + np.sin(a) * e + (1 - np.cos(a)) * e @ e
        B = R, a_t * R @ e, R @ (a_t**2 * e @ e + a_tt * e)
        A = A[0] @ B[0], A[1] @ B[0] + A[0] @ B[1], A[2] @ B[0] + 2 * A[1] @ B[1] + A[0] @ B[2]
    return A


class FullBody:
    """All modes of the bar in a frame that moves as prescribed; joint: its left face, at `hinge`."""

    def __init__(self, name: str, back: bool = False, loaded: bool = False):
        fem = hex_bar.hex_bar()
        floating.reduce(fem, 0, "complete")
        self.P, M = fem.modeBasis["matrix"], fem.massMatrix.toarray()
        self.omega, self.PM = np.sqrt(fem.eigenValues), self.P.T @ M
        self.zeta2 = floating.RAYLEIGH[0] + floating.RAYLEIGH[1] * self.omega**2
        self.x = fem.GetNodePositionsAsArray()
        nodes, weights = floating.interface(fem, "left")
        self.hinge = weights @ self.x[nodes]
        nodes, weights = floating.interface(fem, "right")
        self.pull = np.einsum("i,ijm->jm", weights, self.P.reshape(-1, 3, len(self.omega))[nodes])
        self.offsets, self.back, self.loaded = offsets(name), back, float(loaded)
        self.weight = self.loaded * np.array(WEIGHT)

    def frame(self, t: float) -> tuple:
        """R, r', r'' of the origin, and A, A', A''."""
        f, sign = self.offsets(t), -1 if self.back else 1
        A = rotation(f[:, 3:])
        A = tuple(x.T for x in A) if self.back else A
        place = np.array([self.hinge, 0 * self.hinge, 0 * self.hinge]) + sign * f[:, :3]
        return [p - x @ self.hinge for p, x in zip(place, A, strict=True)], A

    def slope(self, t: float, y: np.ndarray) -> np.ndarray:
        q, q_t = np.split(y, 2)
        (*_, r_tt), (A, A_t, A_tt) = self.frame(t)
        u, u_t = ((self.P @ x).reshape(-1, 3) for x in (q, q_t))
        a = A.T @ (r_tt - self.weight) + (self.x + u) @ (A.T @ A_tt).T + 2 * u_t @ (A.T @ A_t).T
        load = self.pull.T @ (A.T @ FORCE) * self.loaded * np.sin(60 * t) ** 2
        return np.concatenate([q_t, load - self.PM @ a.ravel() - self.zeta2 * q_t - self.omega**2 * q])

    def motion(self, t: np.ndarray, breaks: Sequence[float] = ()) -> dict[str, np.ndarray]:
        """What the sensors show at times t (T,), sensor -> (T, 3)."""
        y, edges = np.zeros((len(t), 2 * len(self.omega))), [0.0, *breaks, t[-1]]
        state = y[0]
        for first, last in pairwise(edges):
            inside = (t > first) & (t <= last)
            at = np.append(t[inside], last)
            found = solve_ivp(self.slope, (first, last), state, "DOP853", np.unique(at), rtol=1e-11, atol=1e-15)
            y[inside], state = found.y.T[: inside.sum()], found.y[:, -1]
        rows, values = self.P[-3:], []
        for time, (q, q_t) in zip(t, y.reshape(len(t), 2, -1), strict=True):
            (r, r_t, _), (A, A_t, _) = self.frame(time)
            u, u_t, x = rows @ q, rows @ q_t, self.x[-1]
            values.append([r + A @ (x + u) - x, r + A @ (x + u), r_t + A_t @ (x + u) + A @ u_t, u, u_t])
        return dict(zip(SENSORS, np.swapaxes(values, 0, 1), strict=True))


CASES = {
    "turns": ("turns", False, False, END),
    "shifts": ("shifts", False, False, END),
    "turns round": ("turns round", False, False, END),
    "stops": ("stops", False, False, END),
    "tumbles": ("tumbles", False, True, END / 2),
    "tumbles back": ("tumbles", True, True, END / 2),
}


def computed(case: str, end: float | None = None) -> np.ndarray:
    """Return what the sensors show, (5, T, 3), at every STEP up to the end of a case, or to an earlier one."""
    name, back, loaded, last = CASES[case]
    t = STEP * np.arange(round((end or last) / STEP) + 1)
    found = FullBody(name, back, loaded).motion(t, (STOP,) if name == "stops" and t[-1] > STOP else ())
    return np.array([found[sensor] for sensor in SENSORS])


def stored(case: str) -> np.ndarray:
    """Return what was computed, from the file."""
    with np.load(DATA, allow_pickle=False) as file:
        return file[case]


if __name__ == "__main__":
    np.savez_compressed(DATA, **{case: computed(case) for case in CASES})
