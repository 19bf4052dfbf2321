"""The benchmarks, shortened: they run and count what they say. No speed is asserted: machines differ."""

import numpy as np

from benchmarks import floating_cost, kernel_offline, mechanism_cost, online_linkage
from models import floating


def test_online_linkage_measures_every_variant(capsys):
    variants, times = online_linkage.main(["--end", "0.05", "--pairs", "2"])
    assert times.shape == (2, 4)
    assert np.all(times > 0)
    assert len(variants[-1].report.t) == 51
    printed = capsys.readouterr().out
    for variant in variants:
        assert variant.label in printed
    assert printed.count("promised at most") == 2


def test_online_linkage_variants_simulate_the_same():
    end = 0.02
    states = []
    for kind in (online_linkage.Bare, online_linkage.Storing, online_linkage.Bounds, online_linkage.SharpBounds):
        variant = kind(end)
        variant.seconds()
        states.append(variant.mbs.systemData.GetODE2Coordinates())
    np.testing.assert_array_equal(states[1:], states[:1] * 3)


def test_kernel_offline_tells_what_is_counted(capsys):
    exponential, kernels = kernel_offline.main(["--instants", "1"])
    printed = capsys.readouterr().out
    assert "omega_1 included" in printed
    assert "omega_1 not included" in printed
    assert exponential > kernels["certified"][0] > kernels["certified, omega_1 known"][0] > 0


def test_floating_cost_measures_every_variant(capsys):
    variants, times = floating_cost.main(["--steps", "50", "--pairs", "2"])
    assert times.shape == (2, 3)
    assert np.all(times > 0)
    assert [len(variant.report.t) for variant in variants[1:]] == [51, 51]
    assert [variant.report.time for variant in variants[1:]] == ["sampled", "reconstructed"]
    printed = capsys.readouterr().out
    for variant in variants:
        assert variant.label in printed
    assert printed.count("promised at most") == 2


def test_floating_cost_variants_simulate_the_same():
    tips = []
    for kind in (floating_cost.Bare, floating_cost.Sampled, floating_cost.Reconstructed):
        variant = kind(20, 1e-3)
        variant.seconds()
        tips.append(variant.scene.mbs.GetSensorValues(variant.scene.sensors["tip"]))
    # Exudyn's eigenmodes start from random numbers: they differ by sign and rounding
    np.testing.assert_allclose(tips[1:], tips[:1] * 2, atol=1e-9 * np.max(np.abs(tips[0])))


def test_floating_cost_of_a_mesh_counts_every_step(capsys):
    """On a stored mesh: the benchmark itself makes them with ngsolve."""
    mesh = floating_cost.reduced(floating.load_fem("bar"))
    costs = floating_cost.measure_meshes([mesh], steps=40, pairs=2, h=1e-3)
    assert costs.shape == (2, 1, 3)
    assert len(mesh.spent) == 41
    assert len(mesh.monitor.report().t) == 41
    simulation, extra, storing = costs[0, 0]
    assert simulation > 0
    assert extra > storing > 0
    floating_cost.print_meshes([mesh], costs)
    assert capsys.readouterr().out.count("largest over smallest mesh 1.000") == 2


def test_mechanism_cost_measures_every_variant(capsys):
    found = mechanism_cost.main(["--scenes", "pendulum", "double", "--steps", "10", "--pairs", "1"])
    for bodies, (variants, times) in zip((1, 2), found.values(), strict=True):
        assert times.shape == (1, 3)
        assert np.all(times > 0)
        assert [len(variant.reports) for variant in variants] == [0, bodies, bodies]
        for variant in variants[1:]:
            assert [len(report.t) for report in variant.reports] == [11] * bodies
            assert [report.scope for report in variant.reports] == [
                dict.fromkeys(variant.estimators, "coupled (linearised)")
            ] * bodies
    assert capsys.readouterr().out.count("promised at most") == 4
