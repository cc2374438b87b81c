"""Writing of an oriented block as BINGO's image coordinates and `geoin.dat`; the forms are those of `reader`.

Image coordinates are written in mm free of distortion, as the cameras of `geoin.dat` have none: that is exact, where a
table of radii is not. BINGO's older versions have names of 15 signs: longer ones become numbers, and `images.csv` or
`points.csv` says which is which. Control with three coordinates is written; its orientations are not (`itera.dat`).
"""

from pathlib import Path

import numpy as np

from aatri.errors import GeometryError
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.exported_files import full_control, short_names
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import write_files
from aatri.ids import shown
from aatri.progress import SILENT, Reporter

LONGEST = 15
IMAGES, CONTROL = "image.dat", "geoin.dat"


def write_bingo(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write `image.dat` and `geoin.dat`.

    Raises
    ------
    GeometryError
        If there are no image points.
    """
    block, rays = oriented.block, oriented.rays
    if not len(rays.image):
        raise GeometryError("no image points", remedy="give a source that has some")
    images, of_images = short_names(block.images.id.tolist(), LONGEST)
    points, of_points = short_names(block.points.id.tolist(), LONGEST)
    cameras, of_cameras = short_names(block.cameras.id.tolist(), LONGEST)
    xy_mm, camera = np.full_like(rays.xy_px, np.nan), block.images.camera
    of_geoin = ["* cameras: principal distance and principal point in mm; image coordinates are free of distortion"]
    for k, lens in enumerate(oriented.lenses):
        of_camera = camera[rays.image] == k
        c_mm = lens.focal_px[0] * lens.pixel_mm
        x0, y0 = (np.array(lens.principal_point_px) / lens.focal_px * c_mm * [1.0, -1.0]).tolist()
        xy_mm[of_camera] = lens.ideal(rays.xy_px[of_camera]) * [c_mm, -c_mm] + [x0, y0]
        of_geoin.append(f"CAPA   {cameras[k]:<16}{c_mm!r} {x0!r} {y0!r}")
    lines, first = [], np.searchsorted(rays.image, np.arange(len(images) + 1)).tolist()
    for k, name in enumerate(images):
        rows = range(first[k], first[k + 1])
        if not rows:
            continue
        lines.append(f"{name} {cameras[int(camera[k])]}")
        lines += [f"{points[rays.point[row]]} {xy_mm[row, 0].item()!r} {xy_mm[row, 1].item()!r}" for row in rows]
        lines.append("-99")
    control = full_control(oriented, "geoin.dat", reporter)
    for p in control:
        values = [*p.xyz_m.tolist(), *([] if p.exact else p.sigma_m.tolist())]
        of_geoin.append(f"CONT{points[p.row]:<16}" + " ".join(map(repr, values)))
    if exact := [p.id for p in control if p.exact]:
        reporter.log(f"control that is exact is written without standard deviations: {shown(exact)}")
    if any(any(lens.parameters.values()) for lens in oriented.lenses):
        reporter.log("image coordinates are written free of distortion")
    tables = {"images.csv": of_images, "points.csv": of_points, "cameras.csv": of_cameras}
    files = {IMAGES: "\n".join(lines) + "\n", CONTROL: "\n".join(of_geoin) + "\n"}
    write_files(folder, files | {name: table for name, table in tables.items() if table})
