"""Reading of WuCAPS files, the Chinese block adjustment system, as a Block.

The form of the files is that of `wucaps_files`. Image coordinates have their origin at the fiducial centre, x0 y0 are
not subtracted. Ground coordinates, X north and Y east in the files, are turned into east, north, up. Ground points
without a role keep their coordinates. Two strips of the same number are two strips; strips are then named by their
order. The files hold no standard deviations: image points get the one given, control is exact unless one is given.
"""

from pathlib import Path

import numpy as np

from aatri.artifacts.block import NO_ROLE, Block, Fiducials, Frames
from aatri.artifacts.builder import block_of
from aatri.formats.wucaps.files import read_files
from aatri.formats.wucaps.stated import compare_strips
from aatri.ids import canonical
from aatri.progress import SILENT, Reporter

CAMERA = "PRECAI"
"""Id of the camera; the files give it none."""


def read_wucaps(
    folder: Path, *, image_sigma_mm: float = 0.010, control_sigma_m: float | None = None, reporter: Reporter = SILENT
) -> Block:
    """Read a folder of WuCAPS files.

    Parameters
    ----------
    image_sigma_mm : float, mm
        Standard deviation of image coordinates; the files have none.
    control_sigma_m : float, m, optional
        Standard deviation of control and check points; None: exact.

    Raises
    ------
    InputError
        If a file is missing or a line is not of its form.
    """
    files = read_files(folder, reporter)
    compare_strips(files, reporter)
    photos, rows, marks = files.photos, files.measured, files.camera.fiducials
    names, (c, x0, y0) = list(files.ground), files.camera.interior
    return block_of(
        name=folder.resolve().name,
        rotation="phi-omega-kappa",
        earth_curvature="correct",
        files=files.paths,
        frames=Frames.of(id="map", axes="north,east,up", crs="local", vertical=""),
        cameras={
            "id": CAMERA,
            "kind": "film",
            "image_coordinates": "photo",
            "principal_distance_mm": c,
            "principal_point_mm": [x0, y0],
        },
        fiducials=Fiducials.of(
            camera=0,
            id=canonical(marks),
            xy_mm=[marks[m] for m in canonical(marks)],
        ),
        images={
            "id": [p.id for p in photos],
            "camera": CAMERA,
            "sequence": [p.sequence for p in photos],
            "strip": [files.strips[p.strip] for p in photos],
            "at": [p.entry for p in photos],
        },
        image_points={
            "image": [m.photo for m in rows],
            "point": [m.point for m in rows],
            "xy": np.array([m.xy for m in rows], float),
            "sigma_mm": image_sigma_mm,
            "at": [m.entry for m in rows],
        },
        ground_points={
            "point": names,
            "xyz_m": [files.ground[p].xyz_m for p in names],
            "sigma_m": control_sigma_m or 0.0,
            "role": [files.roles.get(p, [NO_ROLE] * 3) for p in names],
            "at": [files.ground[p].entry for p in names],
        },
        exterior=files.exterior or None,
        geodetic=files.geodetic or None,
    )
