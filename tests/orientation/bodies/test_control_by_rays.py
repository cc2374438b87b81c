"""Control that no strip of a component holds, by the rays of its images."""

from __future__ import annotations

import numpy as np

from aatri.geometry.similarity import IDENTITY
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.bodies.components import Component
from aatri.orientation.bodies.control_by_rays import control_by_rays
from aatri.orientation.bodies.free_body import FreeBody

C_MM = 150.0


def test_a_ray_whose_point_lies_behind_its_image_is_apart_by_no_number() -> None:
    """Four images look down at a point 1000 below them; a fifth looks up, and was given the same point."""
    centres = np.array([[-300.0, 0, 1000], [-100, 50, 1000], [100, -50, 1000], [300, 0, 1000], [0, 200, 1000]])
    rotations = np.tile(np.eye(3), (5, 1, 1))
    rotations[4] = np.diag([1.0, -1.0, -1.0])
    u = np.einsum("nji,nj->ni", rotations, -centres)
    xy_mm = -C_MM * u[:, :2] / u[:, 2:]
    xy_mm[4] += 20.0  # its line would meet the others backwards
    image, ones = np.arange(5, dtype=np.int32), np.ones(5, dtype=bool)
    rays = ImagePointRows(image, 0 * image, xy_mm, np.full((5, 2), 0.005), np.full(5, C_MM), np.zeros((5, 2)), ones)
    none = np.zeros(0, dtype=np.int64)
    component = Component(np.array([0]), (IDENTITY,), none, none, np.zeros((0, 3)), np.zeros((0, 3, 3)), None)
    no_point, small = np.full((1, 3), np.nan), np.tile(1e-4 * np.eye(3), (5, 1, 1))
    body = FreeBody(Poses(centres, rotations), no_point, np.full((1, 3, 3), np.nan), small, 1e-6)
    done = control_by_rays(component, body, np.array([0]), rays, 4.0)
    np.testing.assert_allclose(done.body.xyz[0], 0.0, atol=1e-3)
    assert done.meeting.tolist() == [0, 1, 2, 3]
    assert done.apart.tolist() == [4]
    assert np.isnan(done.apart_mm).all()
