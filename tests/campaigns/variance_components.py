"""Variance components: standard deviations that are wrong by known factors are found again.

    python -m tests.campaigns.variance_components --count 100
    python -m tests.campaigns.variance_components --count 100 --blunders robust_snooping

Six groups of observations, each of a redundancy of 30 or more: image points of two cameras, control in plan and in
height, observed positions, distances. Their errors are `TRUE` times the standard deviations that the block gives. Told
is in how many of the blocks the true factor is inside the 95 % limits of the estimate. Asked are 86 of 100 for each
group: of 100 draws at 95 % fewer than 87 come in one of 1,000. Nothing is removed unless `--blunders` says so: a search
for gross errors takes the largest of errors twice as large as they say for gross.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from aatri.artifacts.block import Block
from aatri.stages.bundle_adjustment._variance_components import VarianceComponentOptions
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.chain import simulated

TRUE = {
    "control height": 1.6,
    "control plan": 0.7,
    "distance": 2.0,
    "image_point camera A": 0.6,
    "image_point camera B": 1.5,
    "position": 1.3,
}

SIGMA = {"image_mm": 0.005, "plan_m": 0.02, "height_m": 0.03, "position_m": 0.05, "distance_m": 0.01}

Float = np.ndarray


def error_free(**flight: object) -> Block:
    """A block of digital images without any error, every other of another camera, with distances between points."""
    block = simulated(
        3,
        preset="rc30",
        flight={"strips": 3, "images_per_strip": 6, "cross_strips": 1, **flight},
        camera={"kind": "digital", "distortion": "none", "format": (20000.0, 20000.0), "pixel_size_mm": 0.0115},
        earth="flat",
        refraction="none",
        ties={"new_points": 200},
        known={"full": 55},
        noise={"factor": 0.0},
    )
    cameras = block.cameras
    twice = {name: np.repeat(getattr(cameras, name), 2, axis=0) for name in cameras.__dataclass_fields__}
    twice["id"] = np.array(["A", "B"])
    images = replace(block.images, camera=(np.arange(len(block.images)) % 2).astype(np.int32))
    return with_distances(replace(block, cameras=type(cameras)(**twice), images=images))


def with_distances(block: Block, count: int = 110) -> Block:
    """With so many slope distances between near points, free of errors."""
    rng, truth = np.random.default_rng(1), block.true_points
    assert truth is not None
    pairs: set[tuple[int, int]] = set()
    while len(pairs) < count:
        a = int(rng.integers(len(truth)))
        near = np.argsort(np.linalg.norm(truth.xyz_m - truth.xyz_m[a], axis=1))[1:6]
        b = int(rng.choice(near))
        pairs.add((min(a, b), max(a, b)))
    first, second = np.array(sorted(pairs)).T
    length = np.linalg.norm(truth.xyz_m[first] - truth.xyz_m[second], axis=1)
    ids, text, zero = block.points.id, np.full(count, ""), np.zeros(count)
    rows = {
        "type": np.full(count, "distance"),
        "start": ids[truth.point[first]],
        "end": ids[truth.point[second]],
        "via": text,
        "start_kind": np.full(count, "point"),
        "end_kind": np.full(count, "point"),
        "value": length,
        "sigma": np.full(count, SIGMA["distance_m"]),
        "set": text,
        "group": text,
        "start_height_m": zero,
        "end_height_m": zero,
        "active": np.ones(count, bool),
        "reduced": np.full(count, "no"),
        "file": np.full(count, -1, np.int32),
        "line": np.zeros(count, np.int32),
    }
    return replace(block, geodetic=type(block.geodetic)(**rows))


def disturbed(block: Block, rng: np.random.Generator, factors: dict[str, float] = TRUE) -> Block:
    """The block with normal errors, `factors` times the standard deviations that it gives."""
    points, ground, exterior, geodetic = block.image_points, block.ground_points, block.exterior, block.geodetic
    camera = block.images.camera[points.image]
    f = np.where(camera == 0, factors["image_point camera A"], factors["image_point camera B"])[:, None]
    pixel = block.cameras.pixel_size_mm[camera]
    xy = points.xy + rng.normal(size=points.xy.shape) * f * SIGMA["image_mm"] / pixel
    sigma_mm = np.full(points.xy.shape, SIGMA["image_mm"])
    s = np.array([SIGMA["plan_m"], SIGMA["plan_m"], SIGMA["height_m"]])
    g = np.array([factors["control plan"], factors["control plan"], factors["control height"]])
    n = len(ground)
    xyz = ground.xyz_m + rng.normal(size=(n, 3)) * s * g
    covariance = np.broadcast_to(np.diag(s**2), (n, 3, 3)).copy()
    m, p = len(exterior), SIGMA["position_m"]
    position = exterior.position_m + factors["position"] * p * rng.normal(size=(m, 3))
    length = geodetic.value + factors["distance"] * SIGMA["distance_m"] * rng.normal(size=len(geodetic))
    return replace(
        block,
        image_points=replace(points, xy=xy, sigma_mm=sigma_mm),
        ground_points=replace(ground, xyz_m=xyz, covariance_m2=covariance),
        exterior=replace(
            exterior,
            position_m=position,
            position_covariance_m2=np.broadcast_to(p**2 * np.eye(3), (m, 3, 3)).copy(),
        ),
        geodetic=replace(geodetic, value=length),
    )


def inside(block: Block, seed: int, blunders: str = "none") -> dict[str, tuple[bool, float, float]]:
    """Of each group: whether the true factor is inside the limits, the estimate, the redundancy."""
    made = disturbed(block, np.random.default_rng(seed))
    options = BundleOptions(variance_components=VarianceComponentOptions(groups=("camera",)), blunders=blunders)  # type: ignore[arg-type]
    c = bundle(made, calibrated(made), options=options).variance_components
    assert c is not None
    return {
        str(name): (bool(low < TRUE[str(name)] < high), float(f), float(r))
        for name, low, high, f, r in zip(c.group, c.low, c.high, c.factor, c.redundancy)
    }


def main(count: int, blunders: str) -> int:
    block, hits = error_free(), dict.fromkeys(TRUE, 0)
    factors: dict[str, list[float]] = {name: [] for name in TRUE}
    least = dict.fromkeys(TRUE, np.inf)
    for seed in range(1, count + 1):
        for name, (hit, factor, redundancy) in inside(block, seed, blunders).items():
            hits[name] += hit
            factors[name].append(factor)
            least[name] = min(least[name], redundancy)
    wrong = 0
    for name in TRUE:
        ok = hits[name] >= 0.86 * count - 1e-9 if count >= 20 else hits[name] >= count - 2
        ok = ok and least[name] >= 30
        wrong += not ok
        said = f"{name}: true {TRUE[name]}, mean {np.mean(factors[name]):.4f}, inside {hits[name]} of {count}"
        print(f"{said}, redundancy from {least[name]:.1f}{'' if ok else '  WRONG'}", flush=True)  # noqa: T201
    return 1 if wrong else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--blunders", default="none")
    wanted = parser.parse_args()
    raise SystemExit(main(wanted.count, wanted.blunders))
