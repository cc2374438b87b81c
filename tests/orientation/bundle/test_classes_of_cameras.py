"""Classes of image points: a camera has standard deviations of its own, but for cameras of one image each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.statistics.class_scales import ClassScales
from aatri.observations.poses import POSE
from aatri.orientation.bundle.block import ImageGroups
from aatri.orientation.bundle.blunders.scaling import Classes, Scaling
from tests.orientation.bundle.made_bundle import made_bundle

TOGETHER = "image_point of cameras of one image"


@pytest.mark.parametrize(
    ("camera", "names"),
    [
        ([0, 0, 0, 1, 1, 1], ("image_point c0", "image_point c1")),
        ([0, 1, 2, 3, 4, 5], ("image_point",)),
        ([0, 0, 0, 0, 1, 2], ("image_point c0", TOGETHER)),
        ([0, 0, 0, 0, 0, 0], ("image_point",)),
    ],
)
def test_cameras_of_one_image_are_one_class(camera: list[int], names: tuple[str, ...]) -> None:
    none, nan = np.zeros(6, dtype=np.str_), np.full(6, np.nan)
    cameras = np.array([f"c{k}" for k in range(max(camera) + 1)])
    images = ImageGroups(cameras, np.full(len(cameras), 80.0), np.array(camera), none, none, nan, nan)
    block = replace(made_bundle().together(), images=images)
    classes = Classes.of(block)
    assert tuple(name for name in classes.names if name.startswith("image_point")) == names
    rays = dict(block.observed[0].records.touches)[POSE]
    own = np.array(camera)[rays] if len(names) > 1 else np.zeros(len(rays), dtype=int)
    np.testing.assert_array_equal(classes.number[0][:, 0], np.minimum(own, len(names) - 1))


@pytest.mark.parametrize(
    ("sigma_um", "scale", "of_result"),
    [(10.0, 0.017, 0.017), (10.0, 0.013, 1.0), (1.0, 0.022, 0.022), (1.0, 0.018, 1.0)],
)
def test_image_points_without_errors_are_finer_than_anybody_measures(
    sigma_um: float, scale: float, of_result: float
) -> None:
    """Below 1e-6 rad, 0.15 um at 150 mm, and below a fiftieth of what is stated: an example keeps what is stated."""
    parts = made_bundle()
    rays = replace(parts.rays, sigma_mm=np.full_like(parts.rays.sigma_mm, 1e-3 * sigma_um))
    scaling = Scaling.of(replace(parts, rays=rays).together())
    n = len(scaling.factor)
    scales = ClassScales(np.full(n, scale), np.full(n, 900.0), np.ones(n, dtype=bool))
    assert scaling.after(scales)[0].factor[0] == pytest.approx(of_result)
