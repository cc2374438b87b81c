"""Time of a bundle with 10,000 distances, observed and exact, beside one with 10,000 control coordinates.

    python -m benchmarks.distances [--strips 12] [--distances 10000]

One block three times: with so many control coordinates; with so many distances between near points, observed; with the
same distances exact. Told are the processor seconds of the whole bundle stage, the better of two runs, and the ratios.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from aatri.artifacts.block import CONTROL, Block
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated

CAMERA = {"kind": "digital", "format": (20000.0, 20000.0), "pixel_size_mm": 0.0115}


def block_of(strips: int, distances: int) -> Block:
    """Images with angles to begin with, a third as many control points as distances, distances."""
    options = {
        "camera": CAMERA,
        "flight": {"strips": strips, "images_per_strip": 2 * strips},
        "ties": {"per_position": 4, "random_per_image": 60.0},
        "known": {"full": -(-distances // 3)},
        "refraction": "none",
        "survey": {"distances": distances},
    }
    block = simulate(options=SimulateOptions.model_validate(options), rng=np.random.default_rng(1))
    assert block.true_images is not None
    R = block.true_images.ground_from_image
    omega, phi, kappa = np.arctan2(-R[:, 1, 2], R[:, 2, 2]), np.arcsin(R[:, 0, 2]), np.arctan2(-R[:, 0, 1], R[:, 0, 0])
    angles = np.column_stack([omega, phi, kappa]) + 1e-4 * np.random.default_rng(2).standard_normal((len(R), 3))
    return replace(block, exterior=replace(block.exterior, angles_rad=angles))


def with_few_control(block: Block, count: int = 30) -> Block:
    """The block with so many control points; the others become new points."""
    role = block.ground_points.role.copy()
    points = np.flatnonzero((role == CONTROL).any(axis=1))
    role[np.setdiff1d(points, points[:: max(1, len(points) // count)])] = 0
    return replace(block, ground_points=replace(block.ground_points, role=role))


def with_exact(block: Block) -> Block:
    """The block with its distances demanded, at their true values."""
    g, truth = block.geodetic, block.true_points
    assert truth is not None
    number = {str(name): k for k, name in enumerate(block.points.id)}
    xyz = np.empty((len(block.points), 3))
    xyz[truth.point] = truth.xyz_m
    ends = [
        xyz[[number[name] for name in ids.tolist()]] + h[:, None] * [0, 0, 1.0]
        for ids, h in ((g.start, g.start_height_m), (g.end, g.end_height_m))
    ]
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    return replace(block, geodetic=replace(g, value=length, sigma=np.zeros(len(g))))


def seconds(block: Block) -> float:
    """Of the bundle, the better of two runs."""
    points, found = calibrated(block), []
    for _ in range(2):
        begun = time.process_time()
        bundle(block, points, options=BundleOptions(blunders="none"))
        found.append(time.process_time() - begun)
    return min(found)


def main(strips: int, distances: int) -> None:
    block = block_of(strips, distances)
    few = with_few_control(block)
    without = replace(block, geodetic=type(block.geodetic).empty())
    print(f"{len(block.images)} images, {len(block.points)} points, {len(block.image_points)} image points")  # noqa: T201
    by_control = seconds(without)
    for name, made in (("control", without), ("distances observed", few), ("distances exact", with_exact(few))):
        took = by_control if made is without else seconds(made)
        print(f"{name}: {took:.2f} s, {took / by_control:.2f} times", flush=True)  # noqa: T201


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strips", type=int, default=12)
    parser.add_argument("--distances", type=int, default=10_000)
    chosen = parser.parse_args()
    main(chosen.strips, chosen.distances)
