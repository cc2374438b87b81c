"""Classes of image points: a camera has standard deviations of its own, but for cameras of one image each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.observations.poses import POSE
from aatri.orientation.bundle.block import ImageGroups
from aatri.orientation.bundle.blunders.scaling import Classes
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
