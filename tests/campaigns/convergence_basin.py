"""How far the start of a bundle adjustment may be from its end: a grid of start errors over random blocks.

    python -m tests.campaigns.convergence_basin 20 [--first 0] [--without-positions] [--few]

Well-posed blocks: three strips of four images, 60 % overlap both ways, control, observed positions. Every image is
turned by the given angle about a random axis, every position moved by a normal error of the given share of the flying
height, points start below their first image on the mean height of the control; or the principal distance, free, starts
at a multiple of its value, and every image is turned by 0 or 30 degrees. A start is *right* if the adjustment ends
within 1e-4 standard deviations of the one started at the truth, *refused* if it ends with an error, *told* if it ends
in another minimum and warns of its sigma0, *false* if it does not even warn: there must be none.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import replace

import numpy as np

from aatri.adapters.cameras.unknowns import camera_parameters
from aatri.adjustment.statistics.global_test import global_test
from aatri.artifacts.block import Block, CameraParameters
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.rotations import exp_rotation
from aatri.observations.control import control_of
from aatri.observations.image_points import rays_of
from aatri.observations.poses import Poses
from aatri.observations.positions import Positions, positions_of
from aatri.orientation.bundle.result import BundleResult
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.orientation.bundle.parts import Parts, adjust_bundle, adjust_bundle_from_afar
from tests.stages.chain import simulated

ANGLES_DEG = (0.0, 10.0, 30.0, 45.0, 60.0)
SHARES = (0.0, 0.1, 0.3, 0.5)
FACTORS = (0.5, 0.7, 1.0, 2.0, 4.0, 8.0, 32.0)
TURNED_DEG = (0.0, 30.0)
Grid = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
WHOLE: Grid = (ANGLES_DEG, SHARES, FACTORS)
FEW: Grid = (ANGLES_DEG[::2], SHARES[::3], FACTORS[::3])
"""Ends and middle of the grid."""
MAX_ITERATIONS = 100


def well_posed(seed: int, free_c: bool = False) -> tuple[Parts, float]:
    """A block at its truth, and its flying height; with `free_c` the principal distance is unknown."""
    block = simulated(
        seed,
        camera={"kind": "digital", "format": (6000.0, 6000.0), "pixel_size_mm": 0.01, "principal_distance_mm": 60.0},
        flight={"strips": 3, "images_per_strip": 4, "side_overlap": 60.0, "tilt_sigma_deg": 1.0},
        terrain={"relief_m": 15.0},
        ties={"per_position": 3},
        known={"full": 8},
        refraction="none",
    )
    block = _with_free_c(block) if free_c else block
    off = SystematicOptions(distortion=False, refraction=False, earth_curvature=False)
    image_points = systematic(block, calibrated(block), options=off)
    camera = camera_parameters(block, image_points)
    assert block.true_images is not None
    assert block.true_points is not None
    control, positions = control_of(block), positions_of(block)
    given = Parts(
        block.images.id,
        block.points.id,
        rays_of(block, image_points),
        Poses(block.true_images.position_m.copy(), block.true_images.ground_from_image.copy()),
        block.true_points.xyz_m.copy(),
        control,
        positions,
        (camera,) if camera else (),
    )
    return given, 60.0e-3 * 2500.0


def disturbed(given: Parts, rng: np.random.Generator, angle_deg: float, error_m: float) -> Parts:
    """The block with a wrong start."""
    axis = rng.normal(size=(len(given.image_ids), 3))
    turn = exp_rotation(np.radians(angle_deg) * axis / np.linalg.norm(axis, axis=1, keepdims=True))
    position = given.poses.position_m + error_m * rng.normal(size=axis.shape)
    poses = Poses(position, turn @ given.poses.ground_from_image)
    known = np.full_like(given.xyz_m, np.nan)
    known[given.control.point] = given.control.xyz_m
    plane = np.nanmean(known[:, 2])
    rays, nadir = given.rays, np.full_like(known, np.nan)
    first = np.full(len(known), -1)
    first[rays.point[::-1]] = rays.image[::-1]
    nadir[:, :2], nadir[:, 2] = position[first, :2], plane
    return replace(given, poses=poses, xyz_m=np.where(np.isfinite(known), known, nadir))


def with_start_c(given: Parts, factor: float) -> Parts:
    """The block with a wrong principal distance at the start."""
    (camera,) = given.parameters
    start = camera.start.copy()
    start[:, 0] *= factor
    return replace(given, parameters=(replace(camera, start=start),))


def outcome(given: Parts, reference: BundleResult) -> str:
    """right, refused, told or false."""
    try:
        found = adjust_bundle_from_afar(given, covariances=False, max_iterations=MAX_ITERATIONS, tolerance=1e-5)
    except (ConvergenceError, GeometryError):
        return "refused"
    sigma = np.sqrt(np.einsum("nii->ni", reference.point_covariance_m2))
    sigma = np.where(sigma > 0, sigma, 1e-6)
    if found.point_adjusted.all() and np.nanmax(np.abs(found.xyz_m - reference.xyz_m) / sigma) < 1e-4:
        return "right"
    verdict = global_test(found.adjusted.sigma0, found.adjusted.redundancy).verdict
    return "told" if verdict in ("warned", "far") else "false"


def without_positions(given: Parts) -> Parts:
    """The block with control alone."""
    p, none = given.positions, np.zeros(0, dtype=np.int64)
    return replace(
        given,
        positions=Positions(p.row[none], p.image[none], p.position_m[none], p.covariance_m2[none], p.lever_arm_m[none]),
    )


def grid(seeds: range, positions: bool = True, of: Grid = WHOLE) -> dict[tuple[str, float, float], Counter[str]]:
    """Outcomes by kind of error and its size."""
    counted: dict[tuple[str, float, float], Counter[str]] = {}
    angles, shares, factors = of
    for seed in seeds:
        given, height = well_posed(seed)
        given = given if positions else without_positions(given)
        reference = adjust_bundle(given, tolerance=1e-6)
        rng = np.random.default_rng(seed)
        for angle in angles:
            for share in shares:
                result = outcome(disturbed(given, rng, angle, share * height), reference)
                counted.setdefault(("pose", angle, share), Counter())[result] += 1
        if not positions:
            continue  # c and the heights of vertical images over flat ground are not well posed then
        given, _ = well_posed(seed, free_c=True)
        reference = adjust_bundle(given, tolerance=1e-6)
        for factor in factors:
            for angle in TURNED_DEG:
                start = disturbed(given, rng, angle, 0.0) if angle else given
                result = outcome(with_start_c(start, factor), reference)
                counted.setdefault(("c", factor, angle), Counter())[result] += 1
    return counted


def _with_free_c(block: Block) -> Block:
    free = CameraParameters(
        camera=np.zeros(1, np.int32),
        name=np.array(["principal_distance"]),
        value=np.array([np.nan]),
        sigma=np.array([np.nan]),
        free=np.ones(1, bool),
    )
    return replace(block, camera_parameters=free)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("blocks", type=int)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--without-positions", action="store_true")
    parser.add_argument("--few", action="store_true", help="ends and middle of the grid alone")
    given = parser.parse_args()
    of = FEW if given.few else WHOLE
    angles, shares, factors = of
    counted = grid(range(given.first, given.first + given.blocks), not given.without_positions, of)
    lines = ["| angle | " + " | ".join(f"{share:.0%} of H" for share in shares) + " |", "|---|" + "---|" * len(shares)]
    for angle in angles:
        cells = [_cell(counted["pose", angle, share]) for share in shares]
        lines.append(f"| {angle:g}° | " + " | ".join(cells) + " |")
    if given.without_positions:
        counted |= {("c", f, a): Counter() for f in factors for a in TURNED_DEG}
    lines += ["", "| c at the start | " + " | ".join(f"{f:g} c" for f in factors) + " |"]
    lines += ["|---|" + "---|" * len(factors)]
    for angle in TURNED_DEG:
        lines.append(f"| {angle:g}° | " + " | ".join(_cell(counted["c", f, angle]) for f in factors) + " |")
    lines.append("")
    sys.stdout.write("\n".join(lines))
    if any(c["false"] for c in counted.values()):
        raise SystemExit("a false solution was claimed")


def _cell(counts: Counter[str]) -> str:
    if not counts:
        return "-"
    text = f"{counts['right'] / counts.total():.0%}"
    return text + "".join(f", {counts[name] / counts.total():.0%} {name}" for name in ("told", "false") if counts[name])


if __name__ == "__main__":
    main()
