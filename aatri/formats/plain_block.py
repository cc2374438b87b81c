"""A Block of digital images in a Cartesian frame: what the readers of other programs' problems have in common.

These problems have no strips, fiducials, geodetic observations or earth; their frame is right-handed with axes x, y, z.
A reader whose files have more gives it besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import (
    APPROXIMATE_VALUE,
    PROJECTION_CENTRE,
    Block,
    CameraParameters,
    Cameras,
    DistortionTable,
    Exterior,
    FiducialPoints,
    Fiducials,
    Files,
    Frames,
    Geodetic,
    GeodeticCovariances,
    GroundPointCovariances,
    GroundPoints,
    ImagePoints,
    Images,
    Points,
    Rejects,
    RelativeControl,
    RelativeControlMembers,
    RigMembers,
    Strips,
)
from aatri.formats.tables.source import texts


def plain_block(
    *, name: str, files: Sequence[Path], cameras: Cameras, images: Images, point_ids: Sequence[str] | Text,
    image_points: ImagePoints, ground_points: GroundPoints, **others: Any,
) -> Block:  # fmt: skip
    """The Block of these tables; all others are empty unless they are given. Rows must be in canonical order."""
    plain: dict[str, Any] = {
        "rotation": "omega-phi-kappa",
        "earth_curvature": "ignore",
        "terrain_height_m": np.nan,
        "undulation_m": np.nan,
        "heading": "true",
        "frames": Frames(id=texts(["local"]), axes=texts(["x,y,z"]), crs=texts(["local"]), vertical=texts([""])),
        "camera_parameters": CameraParameters.empty(),
        "distortion_table": DistortionTable.empty(),
        "fiducials": Fiducials.empty(),
        "rig_members": RigMembers.empty(),
        "strips": Strips.empty(),
        "fiducial_points": FiducialPoints.empty(),
        "ground_point_covariances": GroundPointCovariances.empty(),
        "exterior": Exterior.empty(),
        "geodetic": Geodetic.empty(),
        "geodetic_covariances": GeodeticCovariances.empty(),
        "relative_control": RelativeControl.empty(),
        "relative_control_members": RelativeControlMembers.empty(),
        "rejects": Rejects.empty(),
    }
    return Block(
        name=name,
        files=Files(path=texts(map(str, files))),
        cameras=cameras,
        images=images,
        points=Points(id=texts(str(p) for p in point_ids)),
        image_points=image_points,
        ground_points=ground_points,
        **plain | others,
    )


def image_table(ids: Sequence[str], camera: Int, sequence: npt.ArrayLike, file: int, line: npt.ArrayLike) -> Images:
    """Images without strips, sorted by id; `file` is a row in files."""
    n = len(ids)
    blank = texts([""] * n)
    table = Images(
        id=texts(ids), camera=camera, strip=np.full(n, -1, np.int32), sequence=np.asarray(sequence, np.float64),
        time_s=np.full(n, np.nan), flight=blank, session=blank, rig=blank, member=blank, active=np.ones(n, bool),
        file=np.full(n, file, np.int32), line=np.asarray(line, np.int32),
    )  # fmt: skip
    return table.take(np.array(sorted(range(n), key=lambda k: ids[k].encode()), dtype=np.intp))


def approximate_exterior(image: Int, position_m: Float, angles_rad: Float, file: int, line: npt.ArrayLike) -> Exterior:
    """Start values of positions and angles (omega-phi-kappa), sorted by image."""
    n = len(image)
    table = Exterior(
        image=image, position_m=position_m, position_covariance_m2=np.full((n, 3, 3), np.nan), angles_rad=angles_rad,
        angle_sigma_rad=np.full((n, 3), np.nan), position_use=np.full(n, APPROXIMATE_VALUE, np.int32),
        angle_use=np.full(n, APPROXIMATE_VALUE, np.int32), refers_to=np.full(n, PROJECTION_CENTRE, np.int32),
        drift_group=texts([""] * n), file=np.full(n, file, np.int32), line=np.asarray(line, np.int32),
    )  # fmt: skip
    return table.take(np.argsort(table.image))


def pixel_cameras(
    *, ids: Sequence[str], pixel_size_mm: Float, origin: str, y: str, format_px: Float, principal_distance_mm: Float,
    principal_point_mm: Float, distortion: Sequence[str],
) -> Cameras:  # fmt: skip
    """Digital cameras with pixel coordinates; sizes (n, 2), others as in the table."""
    n = len(ids)
    return Cameras(
        id=texts(ids), kind=texts(["digital"] * n), image_coordinates=texts(["pixel"] * n),
        pixel_size_mm=pixel_size_mm, pixel_origin=texts([origin] * n), pixel_y=texts([y] * n), format=format_px,
        principal_distance_mm=principal_distance_mm, principal_point_mm=principal_point_mm,
        symmetry_point_mm=np.zeros((n, 2)), distortion=texts(distortion), lever_arm_m=np.zeros((n, 3)),
        boresight_rad=np.zeros((n, 3)), mount_deg=np.zeros(n, np.int32),
    )  # fmt: skip
