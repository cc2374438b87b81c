"""The start values of a Block as a Solution: what the tests of writers write."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aatri.adapters.solution import ground_points, oriented_images, solved_cameras
from aatri.artifacts import solution as s
from aatri.artifacts.block import Block
from aatri.artifacts.suspects import Suspects
from aatri.geometry.rotations import rotation_from_angles


def start_solution(block: Block, rejected: Sequence[int] = ()) -> s.Solution:
    """Orientations and points as the Block gives them; the named rows of its image points are rejected."""
    n, rows = len(block.images), block.image_points
    position, R, xyz = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((len(block.points), 3), np.nan)
    position[block.exterior.image] = block.exterior.position_m
    R[block.exterior.image] = rotation_from_angles(block.exterior.angles_rad)
    xyz[block.ground_points.point] = block.ground_points.xyz_m
    m = len(rejected)
    suspects = Suspects(
        kind=np.full(m, "image_point"),
        row=np.array(rejected, np.int32),
        image=np.full(m, ""),
        point=np.full(m, ""),
        stage=np.full(m, "bundle_adjustment"),
        size=np.full(m, 1.0),
        unit=np.full(m, "mm"),
        sigma=np.full(m, 1.0),
        test=np.full(m, 9.0),
        verdict=np.full(m, "rejected"),
    )
    return s.Solution(
        method="test/start",
        observations=2 * len(rows),
        unknowns=0,
        redundancy=2 * len(rows),
        sigma0=float("nan"),
        sigma0_um=float("nan"),
        iterations=0,
        images=oriented_images(block, position, R, np.bincount(rows.image, minlength=n)),
        points=ground_points(block, xyz, np.bincount(rows.point, minlength=len(xyz))),
        cameras=solved_cameras(block),
        transformations=s.StripTransformations.empty(),
        parameters=s.Parameters.empty(),
        residuals=s.Residuals.empty(),
        history=s.Iterations.empty(),
        suspects=suspects if m else Suspects.empty(),
    )
