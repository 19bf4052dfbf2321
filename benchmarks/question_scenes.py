"""The scenes of question.py: how each is run, with bounds and without, and what its truth is."""

from collections.abc import Callable
from typing import Any, NamedTuple

import exudyn as exu
import numpy as np
from exudyn import itemInterface

import exudyn_romerr as romerr
from models import exact, floating, linkage, mechanisms, wishbone

Setting = tuple[int, float]  # modes, step in s


class Run(NamedTuple):
    """Times (T,) in s, displacements (T, r) in m, and the largest bound (without bounds: None)."""

    t: np.ndarray
    y: np.ndarray
    bound: float | None = None


class Question(NamedTuple):
    """A scene, how to run it, and which settings each way tries.

    columns : what n counts. share : of the largest displacement, allowed as error. covers : what the bound is of.
    run : (n, step, whether with bounds) -> Run. truth : Run -> true displacements (T, r) at its times. repeats : of
    every short run, for its time.
    """

    title: str
    columns: str
    share: float
    covers: str
    run: Callable[[int, float, bool], Run]
    truth: Callable[[Run], np.ndarray]
    bounded: tuple[Setting, ...]
    compared: tuple[tuple[Setting, Setting], ...]
    full: tuple[Setting, ...]
    full_label: str
    repeats: int = 1


class Answer(NamedTuple):
    """One way's answer: wall and CPU time in s, claimed and true error in m; None: no claim, or no better truth."""

    way: str
    settings: str
    seconds: float
    cpu: float
    claim: float | None
    error: float | None


class Table(NamedTuple):
    """All answers of a question; within: the error asked for, largest: the displacement, in m."""

    question: Question
    within: float
    largest: float
    answers: list[Answer]


def tip(end: float) -> Question:
    """Return the linkage: total error of the tip's displacement."""
    truth = exact.full_solution(*linkage.build()[:2], linkage.AMPLITUDE, 2 * np.pi * linkage.FREQUENCY)
    rows = linkage.build()[2].resolve(linkage.build()[0])

    def run(n: int, h: float, bounds: bool) -> Run:
        body, inputs, output = linkage.build()
        full = n == body.free.size
        basis = romerr.Basis(body.expand(np.eye(n))) if full else romerr.krylov_basis(body, inputs, n)
        mbs = exu.SystemContainer().AddSystem()
        flex = romerr.add_reduced_body(mbs, body, basis, inputs=inputs, input_function=linkage.force)
        state = itemInterface.SensorNode(
            nodeNumber=flex.items["nGenericODE2"],
            outputVariableType=exu.OutputVariableType.Coordinates,
            storeInternal=True,
        )
        sensor = None if bounds else mbs.AddSensor(state)
        monitor = romerr.attach(mbs, flex, outputs=[output]) if bounds else None
        mbs.Assemble()
        mbs.SolveDynamic(floating.solver_settings(h, end))
        if bounds:
            return reported(monitor.report(), output.name)
        stored = mbs.GetSensorStoredData(sensor)
        return Run(stored[:, 0], stored[:, 1:] @ (rows @ basis.V).T)

    return Question(
        "Linkage, displacement of its tip",
        "Krylov vectors",
        1e-3,
        "total error, scope complete",
        run,
        lambda found: truth.output(rows, found.t),
        ((6, 1e-3), (12, 1e-3), (12, 5e-4)),
        (((6, 1e-3), (12, 1e-3)), ((12, 1e-3), (24, 1e-3)), ((12, 5e-4), (24, 5e-4))),
        ((114, 1e-3), (114, 5e-4)),
        "all 114 coordinates",
        repeats=3,
    )


def rod(end: float) -> Question:
    """Return the slider crank of examples/how_many_modes.py: reduction error of the middle of its rod."""
    step = 2.5e-4

    def run(n: int, h: float, bounds: bool, kind: str = "RBE3") -> Run:
        scene = mechanisms.slider_crank(n, kind, h=h, t_end=end)
        if not bounds:
            scene.solve()
            return stored(scene, "middle 1 local")
        flex = romerr.floating_body(scene.fem, scene.bodies[0])
        monitor = romerr.attach(scene.mbs, flex, outputs=[romerr.node_displacement("middle", node=mechanisms.MIDDLE)])
        scene.solve()
        return reported(monitor.report(), "middle")

    every = 3 * 65 - 6  # coordinates of the bar less its frame's

    def chosen(n: int, h: float, bounds: bool) -> Run:
        return run(n, h, bounds, "complete" if n == every else "RBE3")

    return Question(
        "Connecting rod, displacement of its middle",
        "eigenmodes",
        1e-2,
        "reduction error, coupled (linearised)",
        chosen,
        lambda found: chosen(every, step, False).y,
        tuple((n, step) for n in (0, 2, 4, 8)),
        tuple(((n, step), (2 * n or 2, step)) for n in (0, 2, 4, 8)),
        ((every, step),),
        "all 189 modes, the truth",
        repeats=3,
    )


def ball_joint(end: float) -> Question:
    """Return the quarter car with static modes of the bushes only: reduction error of a node of the ball joint."""
    step, most = 5e-4, 32

    def run(n: int, h: float, bounds: bool) -> Run:
        static = wishbone.INTERFACES if n == most else wishbone.INTERFACES[:2]
        scene = wishbone.quarter_car(n, "RBE3", static, h=h, t_end=end)
        if not bounds:
            scene.solve()
            return stored(scene, "ball node local")
        node = int(floating.interface(scene.fem, "ball")[0][0])
        flex = romerr.floating_body(scene.fem, scene.bodies[0])
        monitor = romerr.attach(scene.mbs, flex, outputs=[romerr.node_displacement("ball node", node=node)])
        scene.solve()
        return reported(monitor.report(), "ball node")

    return Question(
        "Wishbone, displacement of its ball joint",
        "eigenmodes",
        1e-3,
        "reduction error, coupled (linearised)",
        run,
        lambda found: run(most, step, False).y,
        tuple((n, step) for n in (8, 11, 16)),
        tuple(((n, step), (more, step)) for n, more in ((8, 11), (8, 16), (11, 16), (16, 24))),
        ((most, step),),
        "50 modes, the truth",
    )


def stored(scene: Any, name: str) -> Run:
    """Return what a sensor stored in the last solve."""
    rows = scene.mbs.GetSensorStoredData(scene.sensors[name])
    steps = int(scene.settings.timeIntegration.numberOfSteps)
    return Run(rows[-steps - 1 :, 0], rows[-steps - 1 :, 1:])


def reported(report: romerr.BoundReport, name: str) -> Run:
    """Return values and bound of an output."""
    output = report.output(name)
    return Run(report.t, output.value, float(np.max(output.bound["best"])))
