"""The benchmarks, shortened: they run and count what they say. No speed is asserted: machines differ."""

import numpy as np

from benchmarks import kernel_offline, online_linkage


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
