"""Reliability of all observations of a block against an iteration of its bundle.

    python -m benchmarks.reliability_of_all uav1kd --repeats 3

The blocks of `benchmarks.blocks`. A bundle without standard deviations is timed, index building included, and divided
by its iterations; then from the adjusted block: standard deviations of all unknowns and observations, and redundancy
numbers, tests, detectable errors, external reliability and the effect on the own point and image of every observation,
as the bundle's table `tests` has them. Wall and processor seconds of the best of the repeats.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Callable
from typing import Any

from aatri.adapters.observation_tables import reliability_table
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.result import BundleResult, gains_of_observations
from aatri.orientation.bundle.settings import BundleSettings
from benchmarks.blocks import BLOCKS, made_block
from benchmarks.programs import _bundle_input


def main() -> None:
    """Measure and tell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("block", choices=list(BLOCKS))
    parser.add_argument("--repeats", type=int, default=1)
    wanted = parser.parse_args()
    _measured("film")
    runs = [_measured(wanted.block) for _ in range(wanted.repeats)]
    best = min(runs, key=lambda run: run["reliability"][0])
    wall, cpu = best["bundle"]
    n = best["iterations"]
    lines = [
        f"{best['rays']} image points, {n} iterations of {wall / n:.2f} s (wall), {cpu / n:.2f} s (processor)",
        "standard deviations {:.2f} s, {:.2f} s".format(*best["covariances"]),
        "reliability {:.2f} s, {:.2f} s".format(*best["reliability"]),
        f"both are {(best['covariances'][0] + best['reliability'][0]) * n / wall:.1f} iterations (wall), "
        f"{(best['covariances'][1] + best['reliability'][1]) * n / cpu:.1f} (processor)",
        f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9:.2f} GB",
    ]
    sys.stdout.write("\n".join(lines) + "\n")


def _measured(name: str) -> dict[str, Any]:
    given = _bundle_input(made_block(**BLOCKS[name]))  # type: ignore[arg-type]
    plain, *bundle = _timed(lambda: adjust_bundle(given, BundleSettings(covariances=False)))
    n = len(plain.adjusted.history)
    del plain
    result, *whole = _timed(lambda: adjust_bundle(given, BundleSettings()))
    _, *reliability = _timed(lambda: _tests(result))
    return {
        "rays": len(result.ray_used),
        "iterations": n,
        "bundle": bundle,
        "reliability": reliability,
        "covariances": [a - b for a, b in zip(whole, bundle)],
    }


def _tests(result: BundleResult) -> list[Any]:
    gains = gains_of_observations(result)
    return [reliability_table(o, result.adjusted.state, g) for o, g in zip(result.observations, gains)]


def _timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - wall, time.process_time() - cpu


if __name__ == "__main__":
    main()
