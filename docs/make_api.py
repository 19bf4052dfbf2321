"""Writes docs/api.md, a table of all public names, from signatures and docstrings: python docs/make_api.py."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from types import FunctionType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import exudyn_romerr as romerr
from exudyn_romerr.mbs.access.reduced_body import ReducedBody
from exudyn_romerr.mbs.floating.floating_body import FloatingBody
from exudyn_romerr.mbs.monitoring.monitor import MechanismMonitor, Monitor
from exudyn_romerr.mbs.studies.parameter_sweep import Failure, Sweep
from exudyn_romerr.mbs.studies.two_level import LevelOutput, TwoLevel

# by public functions
RETURNED = (ReducedBody, FloatingBody, MechanismMonitor, Monitor, Failure, Sweep, LevelOutput, TwoLevel)
PAGE = ROOT / "docs" / "api.md"
HEAD = """# All names

Made by `python docs/make_api.py` from docstrings. `help(romerr.attach)` shows a whole docstring: parameters with
shapes and units, errors, what is not covered. Symbols: [theory.md](theory.md#notation).
"""
GROUPS = {
    "Scripts as they are": "run verify tune",
    "Beside a simulation": "floating_body attach add_reduced_body evaluate_file evaluate two_level add_bands "
    "load_report",
    "Outputs": "node_displacement node_velocity node_rotation mean_displacement mean_rotation relative_displacement "
    "node_strain node_stress von_mises",
    "Bodies": "read_body mean_motion mass_orthogonal hold_modes set_modal_damping initial_coordinates initial_error",
    "Modes": "choose_modes mode_table keep_modes modal_basis krylov_basis gramian_basis frequency_response "
    "from_pymor",
    "Many runs": "sweep plot_convergence plot_run_time",
}


def signature(name: str, thing: Any) -> str:
    """Return the call, without annotations."""
    if inspect.isclass(thing) and issubclass(thing, Exception | str):
        return name
    found = inspect.signature(thing)
    bare = [p.replace(annotation=inspect.Parameter.empty) for p in found.parameters.values()]
    return f"{name}{found.replace(parameters=bare, return_annotation=inspect.Signature.empty)}"


def first_sentence(thing: Any) -> str:
    """Return the first paragraph of a docstring, in one line."""
    return " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())


def members(cls: type) -> dict[str, str]:
    """Return {call: first sentence} of every public method and property."""
    found = {
        name: member for base in reversed(cls.__mro__) if base is not object for name, member in vars(base).items()
    }
    rows = {}
    for name, member in found.items():
        if name.startswith("_") or not isinstance(member, property | classmethod | FunctionType):
            continue
        # bound, so that self and cls are gone
        call = name if isinstance(member, property) else signature(name, member.__get__(cls))
        rows[call] = first_sentence(getattr(cls, name))
    return rows


def table(rows: dict[str, str]) -> str:
    """Return {name or call: what it is} as a table."""
    cells = ((call, what.replace("|", r"\|")) for call, what in rows.items())
    return "\n".join(["| name | what it does |", "|---|---|", *(f"| `{call}` | {what} |" for call, what in cells)])


def class_entry(name: str, cls: type) -> str:
    """Return a heading, the first sentence, and a list of members."""
    lines = "\n".join(f"- `{call}`: {what}" for call, what in members(cls).items())
    return "\n\n".join(filter(None, [f"### {name}", first_sentence(cls), lines]))


def page() -> str:
    """Return the whole page."""
    public = {name: getattr(romerr, name) for name in romerr.__all__}
    classes = {n: x for n, x in public.items() if inspect.isclass(x)} | {x.__name__: x for x in RETURNED}
    text = [HEAD]
    for title, names in GROUPS.items():
        functions = {name: public.pop(name) for name in names.split()}
        text.append(f"## {title}\n\n{table({signature(*x): first_sentence(x[1]) for x in functions.items()})}\n")
    if left := set(public) - set(classes):
        raise ValueError(f"in no group: {sorted(left)}")
    text.append("## Classes\n")
    text += [f"{class_entry(*item)}\n" for item in sorted(classes.items()) if not issubclass(item[1], Exception)]
    errors = {n: first_sentence(x) for n, x in sorted(classes.items()) if issubclass(x, Exception)}
    text.append(f"## Errors\n\n{table(errors)}\n")
    return "\n".join(text)


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
