"""Reading of WuCAPS files, the Chinese block adjustment system, as a Block.

The form of the files is that of `wucaps_files`. Image coordinates have their origin at the fiducial centre, x0 y0 are
not subtracted. Ground coordinates, X north and Y east in the files, are turned into east, north, up. Ground points
without a role keep their coordinates. Two strips of the same number are two strips; strips are then named by their
order. The files hold no standard deviations: image points get the one given, control is exact unless one is given.
What PREPHI says of its strips, number of photos and photo scale, is held against what was read.
"""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np

from aatri.artifacts.block import NO_ROLE, Block, Fiducials, Frames
from aatri.artifacts.builder import block_of
from aatri.formats.limits import LARGEST_RATIO
from aatri.formats.wucaps.files import WucapsFiles, WucapsPhoto, read_files
from aatri.ids import canonical
from aatri.progress import SILENT, Reporter

Place = tuple[float, float]

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


def compare_strips(files: WucapsFiles, reporter: Reporter) -> None:
    """Warn of strips that have another number of photos than they say, or another scale than their known points."""
    others, seen = [], _known_points(files)
    by_strip: dict[int, list[WucapsPhoto]] = {}
    for photo in files.photos:
        by_strip.setdefault(photo.strip, []).append(photo)
    for k, strip in enumerate(files.stated):
        photos = by_strip.get(k, [])
        if strip.photos not in (0, len(photos)):
            others.append(f"line {strip.entry.line} says {strip.photos}, {len(photos)} follow")
        scale = np.median([s for photo in photos for s in _scales(seen.get(photo.id, []))] or [np.nan])
        stated = strip.scale_times_10 / 10.0
        if stated > 0 and not 1 / LARGEST_RATIO <= np.nan_to_num(stated / scale, nan=1.0) <= LARGEST_RATIO:
            what = f"a scale of {strip.scale_times_10:.10g}, but between known points it is 1 : {scale:.0f}"
            remedy = f"write {10 * scale:.0f}, ten times the scale number, or check both units"
            reporter.warn(f"{strip.entry.path}:{strip.entry.line}: {what}; {remedy}")
    if others:
        path = files.stated[0].entry.path
        reporter.warn(f"{path}: other numbers of photos in strips than stated: {'; '.join(others)}: is it complete?")


def _known_points(files: WucapsFiles) -> dict[str, list[tuple[Place, Place]]]:
    """Of each photo the places of known points in it, mm, and on the ground, m."""
    seen: dict[str, list[tuple[Place, Place]]] = {}
    for m in files.measured:
        if m.point in files.ground:
            east, north, _ = files.ground[m.point].xyz_m
            seen.setdefault(m.photo, []).append((m.xy, (east, north)))
    return seen


def _scales(seen: list[tuple[Place, Place]]) -> list[float]:
    """Ground over photo distances of known points that are neighbours in a photo."""
    scales = []
    for (xy, ground), (other_xy, other_ground) in pairwise(seen):
        if (apart := math.dist(xy, other_xy)) > 0:
            scales.append(1000.0 * math.dist(ground, other_ground) / apart)
    return scales
