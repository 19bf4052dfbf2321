"""Auxiliary vectors of bodies in a mechanism, and bounds by way of the trajectories that they add to."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.linalg as la
import tolerances as tol

from exudyn_romerr import AssumptionError, Basis, ElasticBody, Output
from exudyn_romerr.enrichment import Enrichment
from exudyn_romerr.offline import prepare
from exudyn_romerr.online import Run
from exudyn_romerr.scope import COUPLED, Scene
from exudyn_romerr.space import mass_orthogonal, mean_motion, rigid_modes

NODES = 8
N = 3 * NODES
FACES = np.arange(3), np.arange(3, 6)  # nodes of the interfaces, left and right
KINDS = ("RBE2", "RBE3", "free")
DAMPINGS = ("none", "exudyn", "air", "matrix")


@dataclass(frozen=True)
class Part:
    """A body, its M, D, K (N, N), rigid motions Rg (N, 6), mean motions of its interfaces (12, N).

    wrenches: those that move it in its frame. seen (N, N): motion as seen from there. B (N, 2): loads. C (2, N): rows
    of a displacement "y" and of a velocity "v". V (N, n): modes.
    """

    body: ElasticBody
    matrices: tuple[np.ndarray, ...]
    Rg: np.ndarray
    faces: np.ndarray
    wrenches: np.ndarray
    seen: np.ndarray
    B: np.ndarray
    C: np.ndarray
    V: np.ndarray

    def run(self, V, corrected):
        """A run whose inputs are a'', a' of the frame, loads, and wrenches at both interfaces."""
        inputs = np.hstack([-self.matrices[0] @ self.Rg, -self.matrices[1] @ self.Rg, self.B, self.faces.T])
        scene = Scene(COUPLED, feedback=corrected, corrected=corrected)
        common = {"inputs": inputs, "sampled_inputs": True, "estimators": ("energy", "auxiliary")[corrected]}
        outputs = Output("y", self.C), Output("v", self.C, of="velocity")
        return Run(prepare(self.body, Basis(V), scene=scene, outputs=outputs, **common))

    def reduced(self, rng, static, n):
        """The same on static modes of its interfaces, or without, and n eigenmodes or random columns."""
        body, columns = self.body, []
        if n:
            columns = [body.modes(n).shapes if rng.random() < 0.7 else rng.standard_normal((body.free.size, n))]
        if static:
            columns.append(body.stiffness_factor.solve(self.wrenches))
        return replace(self, V=body.expand(np.hstack(columns)))


def lattice(rng, kind, damping="none"):
    """A Part without modes: every two nodes are joined by a spring, so that nothing but rigid motion is free."""
    x = rng.uniform(-1, 1, (NODES, 3))
    K, M, Rg = np.zeros((N, N)), np.kron(np.diag(rng.uniform(0.5, 2, NODES)), np.eye(3)), rigid_modes(x)
    for i, j in zip(*np.tril_indices(NODES, -1), strict=True):
        along = np.zeros((NODES, 3))
        along[i], along[j] = x[i] - x[j], x[j] - x[i]
        K += 10 ** rng.uniform(1, 2.5) * np.outer(along, along)
    faces = np.vstack([mean_motion(face).motion_rows(x) for face in FACES])
    held = {"RBE2": {"fixed": range(9), "rigid": FACES[1:]}, "RBE3": {"reference": mean_motion(FACES[0])}}
    rows = Rg.T @ M if kind == "free" else faces[:6]
    seen, A = np.eye(N) - Rg @ la.solve(rows @ Rg, rows), rng.standard_normal((N, 4))
    D, given = {
        "none": (0 * K, {}),
        "exudyn": (seen.T @ (0.5 * M) @ seen + 2e-3 * K, {"rayleigh": (0.5, 2e-3)}),
        "air": (0.5 * M + 2e-3 * K, {"rayleigh": (0.5, 2e-3)}),
        "matrix": (A @ A.T, {"damping": A @ A.T}),
    }[damping]
    body = ElasticBody(M, K, positions=x, **held.get(kind, {"reference": mass_orthogonal()}), **given)
    wrenches = body.space.loads(faces.T)[:, 0 if kind == "free" else 6 :]
    B, C = rng.standard_normal((2, 2, N))
    return Part(body, (M, D, K), Rg, faces, wrenches, seen, B.T, C, np.zeros((N, 0)))
