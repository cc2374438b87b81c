"""Reading of WuCAPS files, the Chinese block adjustment system, as a Block.

The form of the files is that of `wucaps_files`. Image coordinates have their origin at the fiducial centre, x0 y0 are
not subtracted. Ground coordinates, X north and Y east in the files, are turned into east, north, up. Ground points
without a role keep their coordinates. Two strips of the same number are two strips; strips are then named by their
order. The files hold no standard deviations: image points get the one given, control is exact unless one is given.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aatri.arrays import Int
from aatri.artifacts.block import (
    NO_ROLE,
    Block,
    Cameras,
    Fiducials,
    Frames,
    GroundPoints,
    ImagePoints,
    Images,
    Strips,
)
from aatri.formats.plain_block import plain_block
from aatri.formats.screening import MAX_REJECT_SHARE, screen_block
from aatri.formats.tables.images import image_point_order
from aatri.formats.tables.source import texts
from aatri.formats.wucaps.files import NAMES, Camera, GroundPoint, Measured, Photo, read_files
from aatri.ids import canonical, rows_of
from aatri.progress import SILENT, Reporter

CAMERA = "PRECAI"
"""Id of the camera; the files give it none."""


def read_wucaps(folder: Path, *, image_sigma_mm: float = 0.010, control_sigma_m: float | None = None,
                max_reject_share: float = MAX_REJECT_SHARE, reporter: Reporter = SILENT) -> Block:  # fmt: skip
    """Read a folder of WuCAPS files.

    Parameters
    ----------
    folder : Path
    image_sigma_mm : float, mm
        Standard deviation of image coordinates; the files have none.
    control_sigma_m : float, m, optional
        Standard deviation of control and check points; None: exact.
    max_reject_share : float
        Largest share of images, points or image points that may be set aside.
    reporter : Reporter

    Raises
    ------
    InputError
        If a file is missing or a line is not of its form.
    """
    files = read_files(folder, reporter)
    photos = sorted(files.photos, key=lambda p: p.id.encode())
    strips = canonical(files.strips)
    image_ids = [p.id for p in photos]
    point_ids = canonical([*(m.point for m in files.measured), *files.ground])
    block = plain_block(
        name=folder.resolve().name,
        rotation="phi-omega-kappa",
        earth_curvature="correct",
        files=files.paths,
        frames=Frames(id=texts(["map"]), axes=texts(["north,east,up"]), crs=texts(["local"]), vertical=texts([""])),
        cameras=_camera_table(files.camera),
        fiducials=_fiducial_table(files.camera),
        strips=Strips(id=texts(strips)),
        images=_image_table(photos, rows_of([files.strips[p.strip] for p in photos], strips)),
        point_ids=point_ids,
        image_points=_image_point_table(files.measured, image_ids, point_ids, image_sigma_mm),
        ground_points=_ground_table(files.ground, files.roles, point_ids, control_sigma_m or 0.0),
    )
    return screen_block(block, reporter, max_reject_share)


def _camera_table(camera: Camera) -> Cameras:
    c, x0, y0 = camera.interior
    unknown = np.full((1, 2), np.nan)
    return Cameras(
        id=texts([CAMERA]), kind=texts(["film"]), image_coordinates=texts(["photo"]), pixel_size_mm=unknown,
        pixel_origin=texts([""]), pixel_y=texts([""]), format=unknown, principal_distance_mm=np.array([c]),
        principal_point_mm=np.array([[x0, y0]]), symmetry_point_mm=np.zeros((1, 2)), distortion=texts(["none"]),
        lever_arm_m=np.zeros((1, 3)), boresight_rad=np.zeros((1, 3)),
        mount_deg=np.zeros(1, np.int32),
    )  # fmt: skip


def _fiducial_table(camera: Camera) -> Fiducials:
    marks = canonical(camera.fiducials)
    return Fiducials(camera=np.zeros(len(marks), np.int32), id=texts(marks),
                     xy_mm=np.array([camera.fiducials[m] for m in marks]).reshape(-1, 2))  # fmt: skip


def _image_table(photos: list[Photo], strip: Int) -> Images:
    n = len(photos)
    blank = texts([""] * n)
    return Images(
        id=texts(p.id for p in photos), camera=np.zeros(n, np.int32), strip=strip,
        sequence=np.array([p.sequence for p in photos], float), time_s=np.full(n, np.nan), flight=blank,
        session=blank, rig=blank, member=blank, active=np.ones(n, bool),
        file=np.full(n, NAMES.index("PREPHI"), np.int32),
        line=np.array([p.entry.line for p in photos], np.int32),
    )  # fmt: skip


def _image_point_table(
    rows: list[Measured], image_ids: list[str], point_ids: list[str], sigma_mm: float
) -> ImagePoints:
    n = len(rows)
    table = ImagePoints(
        image=rows_of([m.photo for m in rows], image_ids), point=rows_of([m.point for m in rows], point_ids),
        xy=np.array([m.xy for m in rows], float).reshape(n, 2), sigma_mm=np.full((n, 2), sigma_mm),
        group=texts([""] * n), active=np.ones(n, bool), row_time_s=np.full(n, np.nan),
        file=np.full(n, NAMES.index("PREPHI"), np.int32), line=np.array([m.entry.line for m in rows], np.int32),
    )  # fmt: skip
    return table.take(image_point_order(table))


def _ground_table(ground: dict[str, GroundPoint], roles: dict[str, list[int]], point_ids: list[str],
                  sigma_m: float) -> GroundPoints:  # fmt: skip
    names = canonical(ground)
    n = len(names)
    return GroundPoints(
        point=rows_of(names, point_ids), xyz_m=np.array([ground[p].xyz_m for p in names]).reshape(n, 3),
        covariance_m2=np.tile(np.eye(3) * (sigma_m * sigma_m), (n, 1, 1)),
        role=np.array([roles.get(p, [NO_ROLE] * 3) for p in names], np.int32).reshape(n, 3),
        datum=np.zeros(n, bool), file=np.full(n, NAMES.index("PRECKI"), np.int32),
        line=np.array([ground[p].entry.line for p in names], np.int32),
    )  # fmt: skip
