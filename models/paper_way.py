"""The estimators of the paper as it computed them, in one floating point type: what the package is compared with.

Written down as plainly as it can be had (solve, Arnoldi, eigh) and no part of the package. The paper does not say how
its Krylov vectors are orthonormalised; taken here unless told otherwise: by the Euclidean scalar product, as Arnoldi.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg
from scipy.integrate import solve_ivp

import exudyn_romerr as romerr
from exudyn_romerr.linalg import oscillator
from models import exact


class PaperWay:
    """A body with one input and one output row, its basis, and everything that the paper computes of them.

    Parameters
    ----------
    body : ElasticBody
        Rayleigh damping.
    inputs : ndarray, (N, 1)
    output : Output
        One row.
    dtype : numpy.float64 or numpy.float32
    n : int
        Krylov vectors; as many as free coordinates: the full model in its own coordinates.
    V : ndarray, (free, n), optional
        Other vectors in their place.
    """

    def __init__(self, body, inputs, output, dtype: type, n: int, V: np.ndarray | None = None):
        self.body, self.inputs, self.dtype = body, inputs, dtype
        alpha, beta = (dtype(x) for x in body.rayleigh)
        self.M, self.K = (matrix.toarray().astype(dtype) for matrix in (body.M, body.K))
        self.D = alpha * self.M + beta * self.K
        self.B = inputs[body.free].astype(dtype)
        self.C = output.resolve(body)[:, body.free].astype(dtype)
        full = n == len(self.M)
        self.V = V.astype(dtype) if V is not None else np.eye(n, dtype=dtype) if full else self._arnoldi(n)

    def _arnoldi(self, n: int) -> np.ndarray:
        """Return n orthonormal vectors that span K^-1 B, K^-1 M K^-1 B, ..."""
        V = np.zeros((len(self.M), n), dtype=self.dtype)
        vector = np.linalg.solve(self.K, self.B[:, 0])
        for i in range(n):
            for _ in range(2):
                vector = vector - V[:, :i] @ (V[:, :i].T @ vector)
            V[:, i] = vector / np.linalg.norm(vector)
            vector = np.linalg.solve(self.K, self.M @ V[:, i])
        return V

    def tip(self, q: np.ndarray) -> np.ndarray:
        """Return the output (T,) of reduced coordinates (T, n)."""
        return q @ (self.C @ self.V)[0].astype(float)

    def exact_motion(self, t: np.ndarray, amplitude: float, W: float) -> romerr.Trajectory:
        """Return the reduced motion in closed form, computed in double: no time integration blurs the study."""
        basis = romerr.Basis(self.body.expand(self.V.astype(float)))
        solution = exact.reduced_solution(self.body, basis, self.inputs, amplitude, W)
        return exact.reduced_trajectory(solution, t, amplitude)

    def integrated_motion(
        self, end: float, amplitude: float, W: float, relative: float, absolute: float
    ) -> romerr.Trajectory:
        """Return the steps of an adaptive Runge-Kutta 4(5) method with tolerances that know no unit."""
        n, V = self.V.shape[1], self.V
        Mr, Dr, Kr = (V.T @ matrix @ V for matrix in (self.M, self.D, self.K))
        A = -np.linalg.solve(Mr, np.hstack([Kr, Dr]))
        b = np.linalg.solve(Mr, V.T @ self.B)[:, 0]

        def acceleration(t: np.ndarray, state: np.ndarray) -> np.ndarray:
            return A @ state + np.multiply.outer(b, amplitude * np.sin(W * t))

        run = solve_ivp(
            lambda t, x: np.concatenate([x[n:], acceleration(t, x)]),
            (0.0, end),
            np.zeros(2 * n),
            rtol=relative,
            atol=absolute,
        )
        u = amplitude * np.sin(W * run.t)[:, None]
        return romerr.Trajectory(run.t, run.y[:n].T, run.y[n:].T, acceleration(run.t, run.y).T, u)

    def squared_residuals(self, motion: romerr.Trajectory) -> dict[str, np.ndarray]:
        """Return way -> |Rt|_M^2 (T,): Method 1 (33), Method 2 (34)-(35), and an orthonormal factor."""
        M, V = self.M, self.V
        Y = np.linalg.solve(M, np.hstack([M @ V, self.D @ V, self.K @ V, -self.B]))
        z = np.hstack([motion.q_tt, motion.q_t, motion.q, motion.u]).astype(self.dtype)
        Rt, H = z @ Y.T, Y.T @ (M @ Y)
        weighted = np.linalg.cholesky(M).T @ Y
        length = np.linalg.norm(weighted, axis=0)
        T = np.linalg.qr(weighted / length, mode="r") * length
        return {
            "direct": np.einsum("ij,ij->i", Rt @ M, Rt),
            "expanded": np.einsum("ij,ij->i", z @ H, z),
            "orthonormal": np.sum((z @ T.T) ** 2, axis=1),
        }

    def bounds(self, t: np.ndarray, residual: np.ndarray) -> dict[str, np.ndarray]:
        """Return fast (26) and convolution (25) bounds (T,) of the output from |Rt|_M (T,).

        Kernel: the first reduced mode and its envelope.
        """
        h = np.diff(t).astype(self.dtype)
        added = h * (residual[1:] + residual[:-1]) / 2
        largest, envelope, rate = self._kernel()
        sums = np.zeros(len(t), dtype=self.dtype)
        for k, decay in enumerate(np.exp(-rate * h)):
            sums[k + 1] = decay * sums[k] + added[k]  # of the envelope, its maximum over each step's lag counts
        fast = largest * np.concatenate([[0], np.cumsum(added)])
        return {"fast": self._C2() * fast, "convolution": self._C2() * np.minimum(envelope * sums, fast)}

    def _kernel(self) -> tuple[float, float, float]:
        """Return max |Phi12|, and a, r of the envelope a exp(-r t) (36)-(37), from the first reduced mode."""
        pencil = (self.V.T @ matrix @ self.V for matrix in (self.K, self.M))
        square = linalg.eigvalsh(*((x + x.T) / 2 for x in pencil))[0]
        if square <= 0:
            raise ValueError(f"the lowest omega^2 of the reduced model is {square:.3g}")
        omega, (alpha, beta) = np.sqrt(square), self.body.rayleigh
        rate = (alpha + beta * square) / 2
        largest = oscillator.largest_impulse_response(np.array([omega]), np.array([rate / omega]))[0]
        return self.dtype(largest), self.dtype(1 / np.sqrt(square - rate**2)), self.dtype(rate)

    def _C2(self) -> float:
        return np.sqrt(self.C[0] @ np.linalg.solve(self.M, self.C[0]))
