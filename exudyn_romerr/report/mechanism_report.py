"""Reports read from files, and joined: of bodies of one mbs, a MechanismReport; of intervals of time in a row."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NoReturn

import numpy as np

from ..errors import InputError, RunError
from .assessment import Assessment
from .data import DICTS, OPTIONAL, NodeFields, Plan, line_of
from .formats.npz_file import bodies_of, fields_of, read_npz
from .report import BoundReport, OutputReport
from .scope import SCOPES
from .wording import NO_OUTPUTS, numbered, widest_scope

ASK_BODIES = (
    "a mechanism has no {} of its own: ask report.bodies[...] where their scope is another than 'coupled "
    "(linearised)', which has none, or attach with scope='inputs frozen'"
)
MANY_BODIES = "a mechanism of several bodies has no mesh of its own: ask report.bodies[...]"
LEFT_OUT = "neither estimated nor bounded: {}; print(report.plan) says why"
NO_BOUND = "estimated only, no bound of it is known: {}"


class OfBodies(dict):
    """Bounds that bodies have, and the mechanism has not: empty; InputError for every key."""

    def __missing__(self, key: str) -> NoReturn:
        raise InputError(ASK_BODIES.format("bound of position or velocity"))


@dataclass(repr=False)
class MechanismReport(BoundReport):
    """One report for a mechanism: outputs of all bodies, and of sensors that are on none of them.

    Everything that a BoundReport does; outputs of sensors on no flexible body have an estimate, and the bound inf.
    bodies : one BoundReport for each body, in the order that attach was given or the script adds them; they have
    position_bound, velocity_bound and node_bound, of which the mechanism's raise InputError, and estimates at nodes,
    which plot_body and to_vtu show. scope : what the bounds of all outputs cover, the narrowest of the bodies'.
    """

    @property
    def node_bound(self) -> NoReturn:
        """InputError: those of report.bodies are meant."""
        raise InputError(ASK_BODIES.format("node_bound"))

    def at_nodes(self) -> NodeFields:
        """Return what is known at the nodes of its body; InputError where it has several."""
        if self.nodes is None and self.bodies:
            if len(self.bodies) > 1:
                raise InputError(MANY_BODIES)
            return self.bodies[0].at_nodes()
        return super().at_nodes()

    def assess(self, name: str, tolerance: float, relative: bool = False, cause: str | None = None) -> Assessment:
        """As of a body: what is proved of one needs no other; see BoundReport.assess."""
        of = next((body for body in self.bodies if name in body.outputs), super())
        return of.assess(name, tolerance, relative, cause)


def joined(
    bodies: Sequence[BoundReport], others: Sequence[OutputReport], left_out: Sequence[tuple[str, str]]
) -> MechanismReport:
    """Return one report; others : of sensors on no body, of which those left out are named with the reason.

    Raises
    ------
    InputError
        Two outputs have one name.
    RunError
        The bodies were bounded over different instants.
    """
    if any(not np.array_equal(body.t, bodies[0].t) for body in bodies):
        raise RunError("the bodies were bounded over different instants; ask monitor.bodies[...].report()")
    scope, doubts = _scope(bodies), _doubts(bodies[::-1])
    own = [(f"bodies[{i}]", out) for i, body in enumerate(bodies) for out in body.outputs.values()]
    check_names(
        [(where, out.name) for where, out in own] + [("a sensor on no flexible body", x.name) for x in others]
    )
    stopped = next((out.stopped for _, out in own), None)
    beside = _beside_steps(out for _, out in own)
    made = [replace(out, bound={**_infinite(out, scope), **out.bound}, beside_steps=beside) for _, out in own]
    for out in others:
        none = _infinite(out, scope)
        of_all = {"stopped": stopped, "uncertified": doubts, "beside_steps": beside}
        made.append(replace(out, bound=none, reduction_bound=none, **of_all))
    times = {body.time for body in bodies}
    certified_first = sorted(bodies, key=lambda body: bool(body.uncertified))
    unbounded = [NO_BOUND.format(", ".join(out.name for out in others))] if others else []
    unbounded += [LEFT_OUT.format(", ".join(_once(name for name, _ in left_out)))] if left_out else []
    # that a body has no outputs is no message beside outputs of others
    heard = [[text for text in body.messages if not (made and text == NO_OUTPUTS)] for body in bodies]
    first = ("t", "made", "planned_end", "ended_by", "on_purpose", "modes")
    return MechanismReport(
        **{name: getattr(bodies[0], name) for name in first},
        position_bound=OfBodies(),
        velocity_bound=OfBodies(),
        outputs={out.name: out for out in made},
        scope=scope,
        scope_reason="; ".join(_once(body.scope_reason for body in certified_first)),
        reasons={e: "; ".join(_once(b.reasons[e] for b in bodies if e in b.reasons)) for e in scope},
        plan=joined_plan([body.plan for body in bodies], others, left_out),
        messages=[*numbered(heard), *unbounded],
        time=times.pop() if len(times) == 1 else "sampled",
        total_mass=None,
        remainder={e: max(b.remainder.get(e, 0.0) for b in bodies) for b in bodies for e in b.remainder},
        bodies=tuple(bodies),
        uncertified=doubts,
    )


def check_names(places: Sequence[tuple[str, str]]) -> None:
    """InputError if two outputs, (where, name), have one name."""
    for name, count in Counter(name for _, name in places).items():
        if count > 1:
            first, second = [where for where, other in places if other == name][:2]
            raise InputError(f"{name!r} is an output of {first} and of {second}: give them names of their own")


def joined_plan(plans: Sequence[Plan], others: Sequence[Any], left_out: Sequence[tuple[str, str]]) -> Plan:
    """Return the plans of all bodies as one, with what is watched beside these, and sensors that are left out."""
    computed = numbered([plan.computed for plan in plans])
    computed += [f"{line_of(out)}, no bound" for out in others]
    shared = [pair for pair in plans[0].left_out if all(pair in plan.left_out for plan in plans)]
    pairs = ((i, *pair) for i, plan in enumerate(plans) for pair in plan.left_out if pair not in shared)
    without = [(f"bodies[{i}]: {what}", why) for i, what, why in pairs]
    return Plan(tuple(computed), (*shared, *without, *left_out))


def _scope(bodies: Sequence[BoundReport]) -> dict[str, str]:
    """The narrowest: what is said of any output holds."""
    least = max(SCOPES.index(widest_scope(body.scope)) for body in bodies)
    names = _once(e for body in bodies for e in body.scope)
    return {e: SCOPES[max([least, *(SCOPES.index(b.scope[e]) for b in bodies if e in b.scope)])] for e in names}


def _infinite(out: OutputReport, scope: dict[str, str]) -> dict[str, np.ndarray]:
    return {e: np.full(out.value.shape, np.inf) for e in (*scope, "best")}


def _once(texts: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(texts))


def joined_in_time(reports: Sequence[BoundReport]) -> BoundReport:
    """Return one report of all, of the type of the last; the first instant of each is the last of the one before.

    reports : at least one, in the order of time, of the same bodies; an output counts that all have. Does not cover:
    bounds at nodes.
    """
    last = reports[-1]
    if len(reports) == 1:
        return last
    names = [name for name in last.outputs if all(name in report.outputs for report in reports)]
    return replace(
        last,
        t=_in_a_row([report.t for report in reports]),
        position_bound=_of_keys([report.position_bound for report in reports]),
        velocity_bound=_of_keys([report.velocity_bound for report in reports]),
        outputs={name: _output([report.outputs[name] for report in reports]) for name in names},
        scope={e: max((of.scope[e] for of in reports if e in of.scope), key=SCOPES.index) for e in last.scope},
        messages=_once(message for report in reports for message in report.messages),
        uncertified=_doubts(reports),
        nodes=None,
        modes=None,
        bodies=tuple(map(joined_in_time, zip(*(report.bodies for report in reports), strict=True))),
    )


def _output(outs: Sequence[OutputReport]) -> OutputReport:
    arrays = {name: [getattr(out, name) for out in outs] for name in ("value", "round_off", *OPTIONAL)}
    joined = {name: None if any(x is None for x in of) else _in_a_row(of) for name, of in arrays.items()}
    joined |= {name: _of_keys([getattr(out, name) for out in outs]) for name in DICTS}
    return replace(outs[-1], **joined, beside_steps=_beside_steps(outs), uncertified=_doubts(outs))


def _beside_steps(outs: Iterable[OutputReport]) -> tuple[str, ...]:
    """What rings in one body is felt by all."""
    return next((out.beside_steps for out in outs if out.beside_steps), ())


def _in_a_row(arrays: Sequence[np.ndarray]) -> np.ndarray:
    return np.concatenate([arrays[0], *(array[1:] for array in arrays[1:])])


def _of_keys(dicts: Sequence[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Arrays of the keys that all have; a mechanism's dict of none stays what it is."""
    keys = [key for key in dicts[-1] if all(key in of for of in dicts)]
    return {key: _in_a_row([of[key] for of in dicts]) for key in keys} if keys else dicts[-1]


def _doubts(of: Sequence[Any]) -> tuple:
    return tuple({doubt.cause: doubt for one in of for doubt in one.uncertified}.values())


def load_report(path: str | os.PathLike) -> BoundReport:
    """Read a report that BoundReport.save wrote.

    Raises
    ------
    InputError
        No such file or no permission, truncated, not a report, or written by another format version.
    """
    return read_npz(path, report_of)


def report_of(arrays: dict[str, np.ndarray], origin: str) -> BoundReport:
    """Return the report that npz_file.arrays_of took apart; origin: the file that they were in.

    What older files lack is as the fields of a new report are.
    """
    fields = {**fields_of(arrays), "origin": origin}
    if fields["position_bound"]:
        return BoundReport(**fields)
    # of a mechanism: bodies have such, if anything has
    bodies = tuple(report_of(body, origin) for body in bodies_of(arrays))
    return MechanismReport(**{**fields, "position_bound": OfBodies(), "velocity_bound": OfBodies()}, bodies=bodies)
