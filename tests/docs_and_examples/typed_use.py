"""What typed scripts of users say of all public names; mypy reads it and nothing runs it (see pyproject.toml).

Arrays, lists and tuples where users have one or the other; an `ignore` that is not needed is an error, too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from exudyn.FEM import FEMinterface

import exudyn_romerr as romerr

NODES, WEIGHTS = np.arange(4), np.full(4, 0.25)


def outputs(fem: FEMinterface) -> list[romerr.Output]:
    """Return outputs of every kind."""
    return [
        romerr.Output("row", np.eye(3)),
        romerr.node_displacement("tip", node=3, component="z", unit="m"),
        romerr.node_velocity("speed", node=3),
        romerr.node_rotation("turn", node=3),
        romerr.mean_displacement("face", nodes=NODES, weights=WEIGHTS),
        romerr.mean_rotation("tilt", nodes=[1, 2, 3]),
        romerr.relative_displacement("gap", node=1, other=2),
        romerr.node_strain("strain", node=3, fem=fem),
        romerr.node_stress("stress", node=3, fem=fem, material=object()),
    ]


def beside_a_simulation(mbs: Any, fem: FEMinterface, items: dict[str, Any]) -> romerr.BoundReport:
    """Attach, solve, ask."""
    romerr.hold_modes(fem, NODES, WEIGHTS)
    romerr.keep_modes(fem, np.arange(6))
    flex = romerr.floating_body(fem, items, romerr.mean_motion(NODES), modal_damping=np.full(6, 0.01))
    print(romerr.floating_body(fem, items, romerr.mass_orthogonal()))
    romerr.set_modal_damping(mbs, flex)
    limits = {"tip": 1}
    monitor = romerr.attach(mbs, [flex], outputs=outputs(fem), tolerance=limits, jumps=np.array([0.1]))
    monitor.bound_sensor("tip")
    report = monitor.report()
    print(report, report.details, romerr.mode_table(flex, report))
    print(romerr.von_mises(report, "stress").bound, romerr.evaluate_file(mbs, flex, "run.sol").t)
    return report


def of_a_report(path: Path) -> float:
    """Numbers, words and files."""
    report = romerr.load_report(path)
    out: romerr.OutputReport = report.output("tip")
    found: romerr.Assessment = report.assess("tip", 0.01, relative=True, cause="modes")
    report.compare("tip", report.t, out.value)
    report.save(path)
    report.to_html(path.with_suffix(".html"), ["1%", "tip=0.001"])
    report.plot("run.png", ["tip"])
    romerr.add_bands(object(), report, "tip", [0, 1])
    print(found.text, report.to_dict()["t"])
    print(out.missing)  # type: ignore[attr-defined]
    if out.estimate is None or out.peak is None:
        return float(out.bound["best"].max())
    return float(np.abs(out.estimate).max() + out.peak.value[0])


def of_matrices() -> romerr.BoundReport:
    """A body without Exudyn."""
    body = romerr.ElasticBody(np.eye(6), np.eye(6), rayleigh=np.array([0.5, 1e-5]), fixed=np.arange(1))
    body = romerr.read_body("arm.inp", rayleigh=(0.5, 1e-5)).elastic_body()
    basis: romerr.Basis = romerr.krylov_basis(body, np.ones((6, 1)), 3, shifts=np.array([0.0, 10.0]))
    for basis in (romerr.modal_basis(body, 3), romerr.gramian_basis(body, np.ones((6, 1)), 3, (1.0, 10.0))):
        print(romerr.frequency_response(body, basis, np.ones(6), romerr.Output("y", np.eye(6)), [1.0, 2.0]).bound)
        print(romerr.from_pymor(body, basis).outputs[0].name)
    q, _ = romerr.initial_coordinates(body, basis, np.zeros(6), np.zeros(6))
    romerr.initial_error(body, basis, np.zeros(6), np.zeros(6))
    flex = romerr.add_reduced_body(object(), body, basis, inputs=np.ones((6, 1)), input_function=np.sin)
    romerr.attach(object(), flex)
    t = np.linspace(0, 1, 11)
    return romerr.evaluate(body, basis, romerr.Trajectory(t, np.outer(t, q), np.outer(t, q), np.outer(t, q)))


def of_scripts(script: Path) -> int:
    """Scripts as they are."""
    done: romerr.Run = romerr.run(script, ["--speed", "3"], tolerance="1%")
    for solve in done.solves:
        if solve.report is not None:
            solve.report.save("run.npz")
    measured: romerr.Verification = romerr.verify(script, tolerance=0.001)
    tuned: romerr.Tuning = romerr.tune(script, tolerance=["1%", "tip=0.001"])
    print(romerr.no_such_name)  # type: ignore[attr-defined]
    romerr.run(tolerance="1%")  # type: ignore[call-arg]
    return done.status + measured.status + tuned.status


def many(function: Any) -> None:
    """Studies."""
    values = {"n": [2, 4, 8], "h": [1, 2]}
    for _, result in romerr.sweep(function, values).complete():
        print(result)
    romerr.plot_convergence([(4, 3e-4, 2e-4), (8, 2e-5, None)], "tip z", "m", Path("modes.png"))
    romerr.plot_run_time([("bound", 1.0, 3e-4, 2e-4, "")], "tip z", "m")
    limits = {"tip": 1}
    choice: romerr.ModeChoice = romerr.choose_modes(function, limits, relative=True)
    print(choice, romerr.two_level(function, 4, 8).output("tip"))
