"""What PREPHI says of its strips, number of photos and photo scale, held against what was read."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from aatri.formats.wucaps.files import Photo, WucapsFiles
from aatri.progress import Reporter

LARGEST_RATIO = 2.0
"""Stated scale over that of known points; tilt and relief change it by less, a wrong factor by more."""


def compare_strips(files: WucapsFiles, reporter: Reporter) -> None:
    """Warn of strips that have another number of photos than they say, or another scale than their known points."""
    others = []
    for k, strip in enumerate(files.stated):
        photos = [photo for photo in files.photos if photo.strip == k]
        if strip.photos not in (0, len(photos)):
            others.append(f"line {strip.entry.line} says {strip.photos}, {len(photos)} follow")
        scale = np.median([s for photo in photos for s in _scales(files, photo)] or [np.nan])
        stated = strip.scale_times_10 / 10.0
        if stated > 0 and not 1 / LARGEST_RATIO <= np.nan_to_num(stated / scale, nan=1.0) <= LARGEST_RATIO:
            what = f"a scale of 1 : {stated:.0f}, but between known points it is 1 : {scale:.0f}"
            reporter.warn(f"{strip.entry.path}:{strip.entry.line}: {what}; check the unit of both")
    if others:
        path = files.stated[0].entry.path
        reporter.warn(f"{path}: other numbers of photos in strips than stated: {'; '.join(others)}: is it complete?")


def _scales(files: WucapsFiles, photo: Photo) -> list[float]:
    """Ground over photo distances of known points that are neighbours in a photo."""
    seen = [(m.xy, files.ground[m.point].xyz_m[:2]) for m in files.measured
            if m.photo == photo.id and m.point in files.ground]  # fmt: skip
    found = []
    for (xy, ground), (other_xy, other_ground) in pairwise(seen):
        apart = np.hypot(*np.subtract(xy, other_xy))
        if apart > 0:
            found.append(float(1000.0 * np.hypot(*np.subtract(ground, other_ground)) / apart))
    return found
