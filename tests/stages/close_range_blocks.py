"""Close-range blocks for tests: a field of targets photographed all round, with rolls, and bars for the scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.artifacts.block import APPROXIMATE_VALUE, Block, CameraParameters, RelativeControl, RelativeControlMembers
from aatri.artifacts.image_points import ImagePoints
from aatri.geometry.rotations import angles_from_rotation
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.chain import simulated

LENS = {"k1": 1e-4, "k2": -1.5e-7, "k3": 1e-10, "p1": 1e-5, "p2": -8e-6, "b1": 2e-4, "b2": -1e-4}
TEN = ("principal_distance", "principal_point.x", "principal_point.y", *LENS)


def field_block(seed: int, rings: int, per_ring: int, targets: int, *, noise: float = 1.0) -> Block:
    """Images all round a field of targets with relief, true orientations as approximate ones, nothing known."""
    camera = {
        "kind": "digital",
        "principal_distance_mm": 24.0,
        "principal_point_mm": (0.05, -0.08),
        "format": (6000.0, 4000.0),
        "pixel_size_mm": 0.006,
        "distortion": "brown",
        "brown": LENS,
        "margin_mm": 0.1,
    }
    block = simulated(
        seed,
        name="field",
        camera=camera,
        flight={
            "arrangement": "orbit",
            "strips": rings,
            "images_per_strip": per_ring,
            "scale_number": 200.0,
            "orbit_elevations_deg": (35.0, 75.0),
            "kappa_sigma_deg": 1.0,
            "orbit_rolls": True,
            "tilt_sigma_deg": 2.0,
            "tilt_max_deg": 6.0,
            "position_sigma_m": (0.1, 0.1, 0.1),
        },
        terrain={"mean_height_m": 0.0, "relief_m": 0.8, "wavelength_m": 0.8},
        ties={"per_position": 0, "new_points": targets},
        known={"full": 0},
        gnss={"observed": False},
        imu={"observed": True},
        refraction="none",
        earth="flat",
        noise={"image_um": 0.6, "factor": noise},
    )
    true = block.true_images
    assert true is not None
    n = len(block.images)
    return replace(
        block,
        exterior=replace(
            block.exterior,
            position_m=true.position_m,
            position_use=np.full(n, APPROXIMATE_VALUE, dtype=np.int8),
            angles_rad=angles_from_rotation(true.ground_from_image, "omega-phi-kappa"),
            angle_use=np.full(n, APPROXIMATE_VALUE, dtype=np.int8),
        ),
    )


def with_open_camera(block: Block, names: tuple[str, ...] = TEN) -> Block:
    """The block with parameters of its camera model free, nominal values for starts."""
    k = len(names)
    start = np.array([{"principal_distance": 24.0}.get(name, 0.0) for name in names])
    return replace(
        block,
        camera_parameters=CameraParameters(
            camera=np.zeros(k, dtype=np.int32),
            name=np.array(names),
            value=start,
            sigma=np.full(k, np.nan),
            free=np.ones(k, dtype=bool),
        ),
    )


def with_bar(block: Block, sigma_m: float = 2e-5, error_m: float = 0.0) -> Block:
    """The block with the true distance of its two farthest points as a bar."""
    assert block.true_points is not None
    xyz = block.true_points.xyz_m
    a = int(np.argmax(((xyz - xyz.mean(axis=0)) ** 2).sum(axis=1)))
    b = int(np.argmax(((xyz - xyz[a]) ** 2).sum(axis=1)))
    control = RelativeControl(
        type=np.array(["distance"]),
        value=np.array([np.linalg.norm(xyz[a] - xyz[b]) + error_m]),
        sigma=np.array([sigma_m]),
        axis=np.array([""]),
        file=np.array([-1], dtype=np.int32),
        line=np.array([-1], dtype=np.int32),
    )
    members = RelativeControlMembers(
        condition=np.zeros(2, dtype=np.int32), part=np.array(["points", "points"]), id=block.points.id[[a, b]]
    )
    return replace(block, relative_control=control, relative_control_members=members)


def measured(block: Block) -> ImagePoints:
    """Its photo coordinates, lens distortion included."""
    return calibrated(block)
