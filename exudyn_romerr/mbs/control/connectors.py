"""Springs and dampers of an mbs: how stiff they are beside the masses that they join."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...online.coupled_runs import Connectors
from ..access.mbs_items import BODIES, DAMPING, has_dampers, numbers, stands_alone
from .control_functions import find_controls

if TYPE_CHECKING:
    from collections.abc import Callable

# objects and where their stiffness, a number, list or matrix, stands in one of forces and torques (6, 6)
PLACES = {
    "ConnectorSpringDamper": slice(0, 3),
    "ConnectorCartesianSpringDamper": slice(0, 3),
    "ConnectorLinearSpringDamper": slice(0, 3),
    "ConnectorTorsionalSpringDamper": slice(3, 6),
    "ConnectorRigidBodySpringDamper": slice(0, 6),
}
GROUNDS = ("Ground", "PointGround")
Compliance = tuple[float, float]  # of a force and of a torque: largest acceleration, in 1/kg and 1/(kg m^2)


def connectors(mbs: Any, of_marker: Callable[[int], Compliance | None]) -> Connectors:
    """Return what is to be known of springs and dampers beside floating bodies.

    K_s <= s M for the stiffness K_s of all springs, since x^T K_s x is at most tr(k C) x^T M x for each of them, C
    the compliance of mass at its markers; s is the sum, inf where there are springs of other kinds. Of a user
    function k is the gain where the run begins. So it is with dampers.

    of_marker : number of a marker on a floating body -> its compliance; None: it is on none.
    """
    if not has_dampers(mbs):
        return Connectors()
    t, springs = mbs.systemData.GetTime(), find_controls(mbs).springs
    gains = {spring.number: spring.gains(mbs, t, spring.motion(mbs)) for spring in springs}
    stiffness, damping, covered = 0.0, 0.0, np.inf
    for i in range(mbs.systemData.NumberOfObjects()):
        item = mbs.GetObject(i)
        if item["objectType"] in BODIES or item.get("activeConnector") is False or stands_alone(mbs, i):
            continue
        k, d = _matrices(item, gains.get(i))
        markers = numbers(item, "markerNumbers") if k is None or d is None or k.any() or d.any() else ()
        compliances = [_compliance(mbs, marker, of_marker) for marker in sorted(markers)]
        stiffness, damping = stiffness + _beside_mass(k, compliances), damping + _beside_mass(d, compliances)
        covered = min(covered, _covered(k, d))
    return Connectors(True, stiffness, damping, covered)


def _matrices(item: dict, gains: np.ndarray | None) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Stiffness and damping (6, 6) of an object; None: it has some that is not known.

    gains (2, k, k) : of its user function; None: it has none that could be asked.
    """
    place, found = PLACES.get(item["objectType"]), []
    by_function = any(key.startswith("spring") and key.endswith("Function") and item[key] for key in item)
    for j, (name, words) in enumerate((("stiffness", ("stiffness",)), ("damping", DAMPING))):
        given = {key for key in item if any(word in key.lower() for word in words) and _is_given(item[key])}
        is_known = given <= {name} and (gains is not None or not by_function)
        is_known = is_known and (place is not None or not (given or by_function))
        found.append(_placed(gains[j] if by_function else item.get(name, 0.0), place) if is_known else None)
    return tuple(found)


def _placed(value: Any, place: slice | None) -> np.ndarray:
    """A number, list or matrix where it stands among forces and torques (6, 6); a number is along any axis."""
    whole, value = np.zeros((6, 6)), _dense(value)
    if place is not None:
        part = np.diag(np.append(np.atleast_1d(value), [0.0, 0.0])[:3]) if value.ndim < 2 else value
        whole[place, place][: len(part), : len(part)] = part
    return whole


def _beside_mass(k: np.ndarray | None, compliances: list[Compliance | None]) -> float:
    """Sum of tr(k C) over markers; inf: not known."""
    if k is None or any(one is None for one in compliances):
        return np.inf
    whole = 2.0 if k[:3, 3:].any() or k[3:, :3].any() else 1.0  # k <= 2 of its blocks on the diagonal
    return float(whole * sum(np.dot((np.trace(k[:3, :3]), np.trace(k[3:, 3:])), one) for one in compliances))


def _covered(k: np.ndarray | None, d: np.ndarray | None) -> float:
    """Largest beta with d >= beta k, or less."""
    if k is None or d is None:
        return 0.0
    if not k.any():
        return np.inf
    if np.array_equal(k, np.diag(np.diag(k))) and np.array_equal(d, np.diag(np.diag(d))):
        stiff = np.diag(k) > 0
        return float(np.min(np.diag(d)[stiff] / np.diag(k)[stiff], initial=np.inf))
    return max(float(np.linalg.eigvalsh(d)[0] / np.linalg.eigvalsh(k)[-1]), 0.0)


def _compliance(mbs: Any, number: int, of_marker: Callable[[int], Compliance | None]) -> Compliance | None:
    """Of a marker on a body; None: unknown."""
    if (known := of_marker(number)) is not None:
        return known
    marker = mbs.GetMarker(number)
    if "bodyNumber" not in marker:
        return None
    body = mbs.GetObject(int(marker["bodyNumber"]))
    kind = body["objectType"]
    if kind in GROUNDS:
        return 0.0, 0.0
    if kind == "MassPoint":
        return 1 / body["mass"], 0.0
    if kind != "RigidBody":
        return None
    xx, yy, zz, yz, xz, xy = body["inertia"]
    mass, centre = body["mass"], _dense(body["centerOfMass"])
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    J -= mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))  # about the centre of mass
    least = float(np.linalg.eigvalsh(J)[0])
    arm = _dense(marker.get("localPosition", np.zeros(3))) - centre
    return (1 / mass + float(arm @ arm) / least, 1 / least) if least > 0 else None


def _dense(value: Any) -> np.ndarray:
    value = value.Convert2DenseMatrix() if hasattr(value, "Convert2DenseMatrix") else value
    return np.asarray(value, dtype=float)


def _is_given(value: Any) -> bool:
    """Whether a parameter is a number, list or matrix that is not zero."""
    return not (callable(value) or isinstance(value, dict | str)) and bool(np.any(_dense(value)))
