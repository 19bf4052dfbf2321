"""Reference conditions that were found once: the next solve takes them unless modes or interfaces are others."""

import numpy as np
import pytest

import exudyn_romerr as romerr
from exudyn_romerr.errors import AssumptionError
from exudyn_romerr.mbs.floating import reference_search
from exudyn_romerr.mbs.floating.floating_body import read_object
from exudyn_romerr.mbs.floating.loads_and_joints import read_interfaces
from exudyn_romerr.mbs.floating.reference_search import find_reference
from models import floating


@pytest.fixture
def searched(monkeypatch):
    """How often conditions were searched."""
    calls, search = [], reference_search._search
    monkeypatch.setattr(reference_search, "_search", lambda *given: calls.append(given) or search(*given))
    return calls


@pytest.fixture
def bar():
    """The body of the clamped bar, its modes, and what finds its interfaces."""
    scene = floating.clamped_bar(2, assemble=True)
    flex = romerr.floating_body(scene.fem, scene.items)
    return flex, read_object(scene.mbs, flex).V, lambda: read_interfaces(scene.mbs, flex)


def test_those_of_the_same_modes_and_interfaces_are_found_once(bar, searched):
    """The interfaces are read anew every time."""
    flex, V, interfaces = bar
    first = find_reference(flex, V, interfaces())
    assert find_reference(flex, V.copy(), interfaces()) is first
    assert len(searched) == 1


def test_others_are_searched(bar, searched):
    """Modes that the conditions do not hold, fewer interfaces, others under the same names; then the first again."""
    flex, V, interfaces = bar
    first = find_reference(flex, V, interfaces())
    with pytest.raises(AssumptionError, match="no reference conditions fit"):
        find_reference(flex, V + 0.1 * np.abs(V).max(), interfaces())
    names = [*interfaces()]
    swapped = dict(zip(names, reversed(interfaces().values()), strict=True))
    assert find_reference(flex, V, swapped).source != first.source
    assert find_reference(flex, V, {first.source: interfaces()[first.source]}).source == first.source
    assert find_reference(flex, V, interfaces()).source == first.source
    assert len(searched) == 5


def test_node_sets_are_looked_at_every_time(bar, searched):
    """The fem may have others now."""
    flex, V, _ = bar
    assert find_reference(flex, V, {}).source.startswith("node set")
    flex.fem.nodeSets = []
    with pytest.raises(AssumptionError, match="no reference conditions fit"):
        find_reference(flex, V, {})
    assert len(searched) == 2
