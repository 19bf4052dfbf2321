"""Springs and dampers of an mbs: how stiff they are beside the masses that they join."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...online.coupled_runs import Connectors
from ..access.mbs_items import BODIES, has_dampers, numbers
from .control_functions import find_controls

if TYPE_CHECKING:
    from collections.abc import Callable

MOVING = (
    "ConnectorSpringDamper",
    "ConnectorCartesianSpringDamper",
    "ConnectorLinearSpringDamper",
)  # stiffness in N/m
TURNING = ("ConnectorTorsionalSpringDamper",)  # in Nm/rad
BOTH = ("ConnectorRigidBodySpringDamper",)  # (6, 6)
GROUNDS = ("Ground", "PointGround")
Compliance = tuple[float, float]  # of a force and of a torque: largest acceleration, in 1/kg and 1/(kg m^2)


def connectors(mbs: Any, of_marker: Callable[[int], Compliance | None]) -> Connectors:
    """Return what is to be known of springs and dampers beside floating bodies.

    K_s <= s M for the stiffness K_s of all springs, since x^T K_s x is at most tr(k C) x^T M x for each of them, C
    the compliance of mass at its markers; s is the sum, inf where there are springs of other kinds. Of a user
    function k is the gain where the run begins.

    of_marker : number of a marker on a floating body -> its compliance; None: it is on none.
    """
    if not has_dampers(mbs):
        return Connectors()
    gains = {spring.number: spring.gains(mbs, 0.0, spring.motion(mbs))[0] for spring in find_controls(mbs).springs}
    items = [mbs.GetObject(i) for i in range(mbs.systemData.NumberOfObjects())]
    return Connectors(True, sum(_stiffness(mbs, item, gains.get(i), of_marker) for i, item in enumerate(items)))


def _stiffness(
    mbs: Any, item: dict, gains: np.ndarray | None, of_marker: Callable[[int], Compliance | None]
) -> float:
    """Part of one object; gains (k, k) : of its user function, None: it has none that could be asked."""
    kind = item["objectType"]
    keys = [key for key in item if "stiffness" in key.lower() or (key.startswith("spring") and "Function" in key)]
    given = [key for key in keys if _is_given(item[key])]
    if kind in BODIES or not given or item.get("activeConnector") is False:
        return 0.0
    if (given != ["stiffness"] and gains is None) or kind not in (*MOVING, *TURNING, *BOTH):
        return np.inf
    k = _dense(item["stiffness"]) if gains is None else np.trace(gains)
    if kind in BOTH:  # k <= 2 of its blocks on the diagonal
        whole = 2.0 if k[:3, 3:].any() or k[3:, :3].any() else 1.0
        sizes = whole * np.trace(k[:3, :3]), whole * np.trace(k[3:, 3:])
    else:
        sizes = (k.sum(), 0.0) if kind in MOVING else (0.0, k.sum())
    found = [_compliance(mbs, marker, of_marker) for marker in sorted(numbers(item, "markerNumbers"))]
    if any(one is None for one in found) or min(sizes) < 0:
        return np.inf
    return float(sum(np.dot(sizes, one) for one in found))


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
    """Whether a parameter is not zero; a user function, not none."""
    if callable(value) or isinstance(value, dict):
        return bool(value)
    value = _dense(value)
    return bool(np.any(value))
