"""Bundle adjustment: aatri against COLMAP, on the same blocks, from the same start, to the same gradient.

    python -m benchmarks.bundle_against_colmap uav1kd uav4k film --repeats 3

What is compared. The same cost: image points of known interior orientation, and observed positions of the projection
centres (`PosePrior`), all with the same standard deviations, no robust loss, double precision. The same start: COLMAP
first moves it onto the observed positions by a similarity, as its pose-prior adjustment always does; this is part of
its time. The same end: a gradient norm, by `common_gradient`, of at most that of aatri's solution (which stops by its
own criterion, Newton decrement 1e-3), but no less than 1e-9 of the norm at the start, where rounding begins. Ceres's
test counts a rotation's gradient as at most 2, so COLMAP's `gradient_tolerance` starts at that norm and is lowered, run
by run, until its solution is within it; runs that stopped too early are not counted. All norms are printed.

COLMAP runs three times. `colmap` has every default, its own gradient tolerance of 1e-4 included, which it may take many
iterations at the level of rounding to reach, or never. `colmap-stopped` has its defaults but is stopped as above.
`colmap-tuned` is set by an expert (SPARSE_SCHUR, trust region 1e12 from the start, two threads) and stopped likewise.

Each run is a process of its own; the clock starts when the block stands in the program's own structures and stops with
the solution: aatri's index and COLMAP's problem are built within it. Compiled functions are in the cache. Covariances
are those of all poses.

`factor / dgemm` is the time of one factorisation of the tree, without observations, over its predicted flops at the
rate of a product of two 2000 x 2000 matrices in the same process.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
from dataclasses import asdict
from typing import Any

from benchmarks.blocks import BLOCKS, made_block
from benchmarks.common_gradient import cost_and_gradient
from benchmarks.programs import run_aatri, run_colmap

ROUNDING = 1e-9
COLMAP_DEFAULT = 1e-4
PROGRAMS = ("aatri", "colmap", "colmap-stopped", "colmap-tuned")


def main() -> None:
    """Run what the command line asks for, or, in a process of its own, one adjustment."""
    arguments = _arguments()
    if arguments.one:
        sys.stdout.write(json.dumps(_one(arguments)) + "\n")
        return
    results = []
    for name in arguments.blocks:
        found = _block(name, arguments)
        results.append(found)
        sys.stdout.write(_table(found))
        sys.stdout.flush()
    if arguments.json:
        with open(arguments.json, "w", encoding="utf-8") as file:  # noqa: PTH123
            json.dump(results, file, indent=2)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("blocks", nargs="+", choices=BLOCKS)
    parser.add_argument("--repeats", type=int, default=3, help="the median of this many runs")
    parser.add_argument("--programs", nargs="+", choices=PROGRAMS, default=list(PROGRAMS))
    parser.add_argument("--no-covariances", action="store_true")
    parser.add_argument("--json", help="file for all figures")
    parser.add_argument("--one", choices=PROGRAMS, help=argparse.SUPPRESS)
    parser.add_argument("--gradient-tolerance", type=float, default=COLMAP_DEFAULT, help=argparse.SUPPRESS)
    return parser.parse_args()


def _one(arguments: argparse.Namespace) -> dict[str, Any]:
    block = made_block(**BLOCKS[arguments.blocks[0]])
    covariances = not arguments.no_covariances
    if arguments.one == "aatri":
        start = cost_and_gradient(block, block.position_m, block.ground_from_image, block.xyz_m)[1]
        run = asdict(run_aatri(block, covariances=covariances))
        size = {"images": len(block.position_m), "points": len(block.xyz_m), "rays": len(block.image)}
        return {**run, "start_gradient": start, **size}
    tuned = arguments.one == "colmap-tuned"
    return asdict(
        run_colmap(block, tuned=tuned, gradient_tolerance=arguments.gradient_tolerance, covariances=covariances)
    )


def _block(name: str, arguments: argparse.Namespace) -> dict[str, Any]:
    """All runs of one block, the programs in turn; aatri's first run sets the gradient norm."""
    load = os.getloadavg()[0]
    first = _in_own_process("aatri", name, COLMAP_DEFAULT, arguments)
    target = max(first["gradient"], ROUNDING * first["start_gradient"], COLMAP_DEFAULT)
    tolerance = {**dict.fromkeys(PROGRAMS, target), "colmap": COLMAP_DEFAULT}
    runs: dict[str, list[dict[str, Any]]] = {"aatri": [first], **{p: [] for p in arguments.programs if p != "aatri"}}
    for k in range(arguments.repeats):
        for program, of_program in runs.items():
            while len(of_program) <= k:
                found = _in_own_process(program, name, tolerance[program], arguments)
                if found["gradient"] <= target or tolerance[program] <= COLMAP_DEFAULT or program == "aatri":
                    of_program.append(found)
                else:
                    lower = 0.5 * tolerance[program] * target / found["gradient"]
                    tolerance[program] = max(lower, COLMAP_DEFAULT)
    return {"block": name, "gradient": target, "tolerance": tolerance, "load_before": load, "runs": runs}


def _in_own_process(program: str, name: str, tolerance: float, arguments: argparse.Namespace) -> dict[str, Any]:
    command = [sys.executable, "-m", "benchmarks.bundle_against_colmap", name, "--one", program]
    command += ["--gradient-tolerance", repr(tolerance)]
    if arguments.no_covariances:
        command.append("--no-covariances")
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{program} on {name} failed:\n{done.stderr}")
    return dict(json.loads(done.stdout.splitlines()[-1]))


def _table(found: dict[str, Any]) -> str:
    runs = found["runs"]
    first = next(iter(runs.values()))[0]
    size = (
        f": {first['images']} images, {first['points']} points, {first['rays']} image points"
        if "images" in first
        else ""
    )
    lines = [
        f"\n{found['block']}{size}; load before the first run {found['load_before']:.1f}; gradient norm at most "
        f"{found['gradient']:.3g}",
        f"{'':15}{'wall s':>9}{'ratio':>7}{'cpu s':>9}{'ratio':>7}{'iter.':>7}{'cost':>18}{'gradient':>11}"
        f"{'peak GB':>9}"
        f"{'cov. wall s':>12}{'ratio':>7}{'cov. cpu s':>12}{'ratio':>7}",
    ]
    base = {key: _median(runs["aatri"], key) for key in _TIMES}
    for program, of_program in runs.items():
        t = {key: _median(of_program, key) for key in _TIMES}
        ratio = {key: t[key] / base[key] if base[key] else float("nan") for key in _TIMES}
        last = of_program[-1]
        lines.append(
            f"{program:15}{t['wall_s']:9.3f}{ratio['wall_s']:7.1f}{t['cpu_s']:9.3f}{ratio['cpu_s']:7.1f}"
            f"{last['iterations']:7d}{last['cost']:18.6f}{last['gradient']:11.3g}{last['memory_gb']:9.2f}"
            f"{t['covariance_wall_s']:12.3f}{ratio['covariance_wall_s']:7.1f}"
            f"{t['covariance_cpu_s']:12.3f}{ratio['covariance_cpu_s']:7.1f}"
        )
    lines.append(_factorisation(runs["aatri"][-1]["more"]))
    return "\n".join(lines) + "\n"


_TIMES = ("wall_s", "cpu_s", "covariance_wall_s", "covariance_cpu_s")


def _median(runs: list[dict[str, Any]], key: str) -> float:
    return float(statistics.median(run[key] for run in runs))


def _factorisation(more: dict[str, Any]) -> str:
    expected = more["flops"] / more["dgemm_flops"]
    text = (
        f"factor / dgemm: {more['factor_wall_s']:.3f} s for {more['flops'] / 1e9:.2f} Gflop, {expected:.3f} s at "
        f"{more['dgemm_flops'] / 1e9:.1f} Gflop/s: {more['factor_wall_s'] / expected:.2f}; "
        f"factor {more['factor_mb']:.0f} MB"
    )
    if "all_covariances_wall_s" in more:
        text += (
            f"; covariances of poses, points and image points {more['all_covariances_wall_s']:.2f} s wall, "
            f"{more['all_covariances_cpu_s']:.2f} s cpu"
        )
    return text


if __name__ == "__main__":
    main()
