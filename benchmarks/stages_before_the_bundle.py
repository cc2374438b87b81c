"""The stages before the bundle: processor seconds of each, and their ratio to the bundle.

    python -m benchmarks.stages_before_the_bundle 25 40
    python -m benchmarks.stages_before_the_bundle 25 40 --tree ../other-checkout

A block of preset `uav` with so many strips of so many images goes through the chain with calibrated interior, as
plain function calls; compiled functions are made before. The bundle gives all standard deviations, without search for
gross errors and statistics of single observations. Processor seconds, all threads together, are given because they
suffer less than wall time from what else the machine does; wall time stands beside them. With `--tree` the chain runs
on another checkout too, in a process of its own that follows at once, and the ratio of both is given. The first stage
that needs them loads the compiled functions, which is not part of its time: the chain runs once on a small block
before.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

STAGES = ("interior", "refined", "models", "strips", "absolute", "strip_block", "bundle")


def main() -> None:
    """Run the chain here and, if asked, on another checkout."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("strips", type=int)
    parser.add_argument("images", type=int, help="per strip")
    parser.add_argument("--tree", help="another checkout to compare with")
    parser.add_argument("--no-bundle", action="store_true")
    parser.add_argument("--json", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    here = seconds_of_stages(arguments.strips, arguments.images, bundle=not arguments.no_bundle)
    if arguments.json:
        sys.stdout.write(json.dumps(here) + "\n")
        return
    there = _in_other_tree(arguments) if arguments.tree else None
    sys.stdout.write(_table(here, there))


def seconds_of_stages(strips: int, images: int, *, bundle: bool) -> dict[str, tuple[float, float]]:
    """Processor and wall seconds of every stage."""
    _chain(2, 4, bundle=bundle)
    return _chain(strips, images, bundle=bundle)


def _chain(strips: int, images: int, *, bundle: bool) -> dict[str, tuple[float, float]]:
    import numpy as np

    from aatri.stages.absolute_orientation.similarity import similarity
    from aatri.stages.block.simulate import SimulateOptions, simulate
    from aatri.stages.bundle_adjustment.bundle import BundleOptions
    from aatri.stages.bundle_adjustment.bundle import bundle as adjust_bundle
    from aatri.stages.image_refinement.systematic import systematic
    from aatri.stages.interior_orientation.calibrated import calibrated
    from aatri.stages.relative_orientation.dependent import dependent
    from aatri.stages.strip_adjustment.polynomial import polynomial
    from aatri.stages.strip_formation.scale_transfer import scale_transfer

    flight = {"strips": strips, "images_per_strip": images}
    block = simulate(options=SimulateOptions(preset="uav", flight=flight), rng=np.random.default_rng(1))  # type: ignore[arg-type]
    seconds: dict[str, tuple[float, float]] = {}

    def timed(name: str, work: Callable[[], Any]) -> Any:
        cpu, wall = time.process_time(), time.perf_counter()
        result = work()
        seconds[name] = (time.process_time() - cpu, time.perf_counter() - wall)
        return result

    interior = timed("interior", lambda: calibrated(block))
    refined = timed("refined", lambda: systematic(block, interior))
    models = timed("models", lambda: dependent(block, refined))
    joined = timed("strips", lambda: scale_transfer(block, models))
    absolute = timed("absolute", lambda: similarity(block, joined, refined))
    strip_block = timed("strip_block", lambda: polynomial(block, refined, joined, absolute))
    if bundle:
        wanted = {"standard_deviations": True, "reliability": False, "blunders": {"method": "none"}}
        options = BundleOptions.model_validate(wanted)
        timed("bundle", lambda: adjust_bundle(block, refined, strip_block, options=options))
    return seconds


def _in_other_tree(arguments: argparse.Namespace) -> dict[str, tuple[float, float]]:
    """The same chain, by this file, with the other checkout's packages; its own cache of compiled functions."""
    command = [sys.executable, os.path.abspath(__file__), str(arguments.strips), str(arguments.images), "--json"]  # noqa: PTH100
    if arguments.no_bundle:
        command.append("--no-bundle")
    found = subprocess.run(
        command, env={**os.environ, "PYTHONPATH": arguments.tree}, capture_output=True, text=True, check=True
    )
    return {name: (pair[0], pair[1]) for name, pair in json.loads(found.stdout).items()}


def _table(here: dict[str, tuple[float, float]], there: dict[str, tuple[float, float]] | None) -> str:
    lines = ["| stage | cpu s | wall s |" + (" other tree, cpu s | times |" if there else "")]
    lines.append("|---|---|---|" + ("---|---|" if there else ""))
    for name in STAGES:
        if name not in here:
            continue
        line = f"| {name} | {here[name][0]:.2f} | {here[name][1]:.2f} |"
        if there:
            line += f" {there[name][0]:.2f} | {there[name][0] / here[name][0]:.1f} |"
        lines.append(line)
    before = sum(cpu for name, (cpu, _) in here.items() if name != "bundle")
    lines.append(f"\nbefore the bundle: {before:.2f} s")
    if "bundle" in here:
        lines[-1] += f", {before / here['bundle'][0]:.2f} times the bundle"
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
