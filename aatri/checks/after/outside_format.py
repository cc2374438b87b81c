"""Photo coordinates against the format of the image.

Seen: points outside the format, which were set aside; a principal point that counts from another origin.
Test: a share of the points and of the format; more points outside than that is a wrong unit or origin, an error. From a
corner y counts all points of an image to the wrong side where its direction is exchanged: that is tried, and named.
"""

import numpy as np

from aatri.adapters.interior.photo_coordinates import half_format_of
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.checks.as_read.rejects import name_of_image_point
from aatri.checks.finding import Finding
from aatri.checks.limits import LARGE_PRINCIPAL_POINT, MAX_REJECT_SHARE
from aatri.ids import several, shown


def outside_format(block: Block, image_points: ImagePoints) -> list[Finding]:
    """Image points outside the format, and principal points far from its middle."""
    cameras, suspects, measured = block.cameras, image_points.suspects, image_points.measurements
    rows = suspects.row[suspects.kind == "image_point"].tolist()
    names, total = (
        [name_of_image_point(block, row) for row in rows],
        len(rows) + int(measured.active.sum()),
    )
    if len(rows) > MAX_REJECT_SHARE * total:
        text = f"{len(rows)} of {total} image points lie outside the format: {shown(names)}"
        remedy = "check the camera's format, image_coordinates, pixel size and pixel origin"
        if exchanged := _y_exchanged(block, image_points, np.unique(block.images.camera[measured.image[rows]])):
            remedy = f"turn y of camera {shown(exchanged)} (`pixel: {{y: ...}}`): y of its points lies inside then"
        where = block.read_at(block.image_points, rows[0])
        return [Finding("outside_format", "error", text, remedy, where=where)]
    findings = []
    if rows:
        text = several(len(rows), "image point") + f" outside the format {'is' if len(rows) == 1 else 'are'} not used"
        findings.append(Finding("outside_format", "warning", text, ids=tuple(names)))
    far = (np.abs(cameras.principal_point_mm) > LARGE_PRINCIPAL_POINT * 2 * half_format_of(block)).any(axis=1)
    if far.any():
        text = (
            "principal point more than 5 % of the format off the image centre (it counts from there, in mm, "
            "x right, y up): camera"
        )
        findings.append(Finding("outside_format", "warning", text, ids=tuple(cameras.id[far].tolist())))
    return findings


def _y_exchanged(block: Block, image_points: ImagePoints, cameras: Int) -> list[str]:
    """Those of the cameras, (n,) rows, of all whose points y lies inside the format where it counts the other way."""
    measured, half_mm = image_points.measurements, half_format_of(block)[:, 1]
    camera = block.images.camera[measured.image]
    y_mm = measured.xy_mm[:, 1] + block.cameras.principal_point_mm[camera, 1]
    # as y from the middle, it grows from the edge that it is counted from: by one format it is on the other side
    off_mm = np.abs(np.abs(y_mm) - 2 * half_mm[camera])
    outside = np.isfinite(y_mm) & ~(off_mm <= half_mm[camera])
    from_corner = (block.cameras.kind == "digital") & (block.cameras.image_coordinates == "pixel")
    from_corner &= block.cameras.pixel_origin != "image-centre"
    return [str(block.cameras.id[k]) for k in cameras if from_corner[k] and not outside[camera == k].any()]
