"""A change of units changes no bound: lengths, masses and times in other units, numbers converted back."""

from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp

import exudyn_romerr as romerr
from models import exact, linkage

INVARIANT = 1e-9  # the issue's
ESTIMATORS = ("state-space", "fast", "convolution", "energy", "auxiliary")
# one m, kg, s in the new units; powers of two, by which no entry is rounded
UNITS = {"km g s": (2.0**-10, 2.0**10, 1), "mm t s": (2.0**10, 2.0**-10, 1), "um pg us": (2.0**20, 2.0**50, 2.0**20)}
W = 2 * np.pi * linkage.FREQUENCY
T = np.linspace(0, 0.3, 241)


class Units:
    """The linkage in units in which one m, kg, s are `length`, `mass`, `time`; the input stays in N."""

    def __init__(self, length, mass, time):
        self.length, self.mass, self.time = length, mass, time
        self.energy = mass * length**2 / time**2
        self.scale = np.tile([length] * 3 + [1.0] * 3, len(linkage.mesh()[0]))  # of displacements and rotations

    def body(self):
        S = sp.diags(1 / self.scale)
        M, K = (S @ A @ S for A in linkage.matrices())
        alpha, beta = linkage.RAYLEIGH
        return romerr.ElasticBody(
            self.energy * self.time**2 * M,
            self.energy * K,
            rayleigh=(alpha / self.time, beta * self.time),
            fixed=linkage.CLAMPED,
            positions=self.length * linkage.mesh()[0],
        )

    def report(self, n, time, initial):
        """Bounds of the same motion of the same body."""
        basis, traj = motion(n)
        f, s = self.time, self.scale
        t, q, q_t, q_tt = f * traj.t, traj.q, traj.q_t / f, traj.q_tt / f**2
        start = None if initial is None else (s * initial, s * initial / f)
        load = np.zeros((len(s), 1))
        load[linkage.TIP_Z] = self.energy / self.length
        return romerr.evaluate(
            self.body(),
            romerr.Basis(s[:, None] * basis.V),
            romerr.Trajectory(t, q, q_t, q_tt),
            inputs=load,
            outputs=[
                romerr.node_displacement("z", node=linkage.TIP, component="z"),
                romerr.node_rotation("turn", node=linkage.TIP, component="x"),
                romerr.node_velocity("speed", node=linkage.TIP, component="z"),
            ],
            input_function=lambda x: linkage.force(x / f),
            initial=start,
            estimators=ESTIMATORS,
            time=time,
            auxiliary_modes=20,
        )

    def in_si(self, report):
        """All bounds in m, rad, m/s, sqrt(kg) m, sqrt(kg) m/s; with what rounding may move them by."""
        units = {"z": self.length, "turn": 1.0, "speed": self.length / self.time}
        weight, found = np.sqrt(self.mass) * self.length, {}
        for name, unit in units.items():
            out = report.output(name)
            bounds = {"total": out.bound, "reduction": out.reduction_bound, "cause": out.causes}
            for kind, found_here in bounds.items():
                found |= {(name, kind, e): (x / unit, out.round_off / unit) for e, x in found_here.items()}
        found |= {("position", e): (x / weight, 0.0) for e, x in report.position_bound.items()}
        found |= {("velocity", e): (x * self.time / weight, 0.0) for e, x in report.velocity_bound.items()}
        return found


@cache
def motion(n):
    """A basis, and the exact reduced motion under the load."""
    body, B, _ = linkage.build()
    basis = romerr.krylov_basis(body, B, n)
    return basis, exact.reduced_trajectory(exact.reduced_solution(body, basis, B, linkage.AMPLITUDE, W), T, 100.0)


@cache
def in_metres(n, time, moved):
    """The bounds in m, kg, s."""
    units = Units(1.0, 1.0, 1.0)
    return units.in_si(units.report(n, time, start(moved)))


def start(moved):
    """An initial state, or none."""
    if not moved:
        return None
    body = linkage.build()[0]
    # of the lowest modes: rounding of a random state would be in modes of 1e6 rad/s
    return body.expand(body.modes(3).shapes @ (1e-3 * np.random.default_rng(0).standard_normal(3)))


@pytest.mark.parametrize("moved", [False, True])
@pytest.mark.parametrize("time", ["sampled", "reconstructed"])
@pytest.mark.parametrize("n", [2, 8, 36])
@pytest.mark.parametrize("units", UNITS.values(), ids=UNITS)
def test_bounds_do_not_depend_on_units(units, n, time, moved):
    """Every estimator, every output, position, velocity, causes."""
    units = Units(*units)
    found, expected = units.in_si(units.report(n, time, start(moved))), in_metres(n, time, moved)
    assert found.keys() == expected.keys()
    for name, (bound, _) in found.items():
        np.testing.assert_allclose(bound, expected[name][0], rtol=INVARIANT, err_msg=str(name))
