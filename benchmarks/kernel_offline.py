"""Offline time of the certified kernel against the matrix exponential, on the linkage (114 free coordinates).

Counted: for the exponential, Phi at 201 instants and the norms of its blocks; for the kernel, its constants C11, C12
and all that the estimators need of it, once with the lowest frequency omega_1 computed and once with omega_1 known
already. Not counted, for either: assembling the body and factorising M and K.

    python benchmarks/kernel_offline.py [--instants 201]
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from examples.fundamental_matrix_norms import TIMES, build_times, exponential_seconds, print_times

AIM = 10_000  # times less than the matrix exponential; the paper has 700


def print_verdict(exponential: float, kernels: dict[str, tuple[float, float]]) -> None:
    """Print which ways of counting reach the aim."""
    for name, what in (("certified", "omega_1 included"), ("certified, omega_1 known", "omega_1 not included")):
        ratio = exponential / kernels[name][0]
        print(f"certified kernel, {what}: {ratio:.0f} times less ({'reaches' if ratio >= AIM else 'misses'} {AIM})")


def main(arguments: list[str] | None = None) -> tuple[float, dict[str, tuple[float, float]]]:
    """Measure and print; return the exponential's time in s and those of the kernels."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument(
        "--instants", type=int, default=len(TIMES), help="exponentials computed; the rest extrapolated"
    )
    options = parser.parse_args(arguments)
    exponential, _ = exponential_seconds(options.instants)
    kernels = build_times(repeats=51)
    print_times(exponential, options.instants, kernels)
    print_verdict(exponential, kernels)
    return exponential, kernels


if __name__ == "__main__":
    main()
