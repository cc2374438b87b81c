"""What PREPHI says of its strips, number of photos and photo scale, held against what was read."""

import math
from itertools import pairwise

import numpy as np

from aatri.formats.wucaps.files import WucapsFiles, WucapsPhoto
from aatri.progress import Reporter

Place = tuple[float, float]

LARGEST_RATIO = 2.0
"""Stated scale over that of known points; tilt and relief change it by less, a wrong factor by more."""


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
