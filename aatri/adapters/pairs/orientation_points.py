"""Relative orientation by named points: the others are intersected, and judged by the orientation they had no part in.

The orientation-point-name file of WuCAPS and of the lecture notes: names between blanks, commas and ends of lines.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from aatri.adapters.pairs.image_pairs import Pairs
from aatri.arrays import Bool, Float, Int, Text
from aatri.errors import InputError
from aatri.geometry.coplanarity import RayPairs, parallax
from aatri.geometry.intersection import intersect_pair
from aatri.ids import shown
from aatri.orientation.relative.orientations import RelativeOrientations


def named_points(path: Path, ids: Text) -> Bool:
    """Which points a file names, (n_points,).

    Raises
    ------
    InputError
        If it cannot be read or names points that are not in the block.
    """
    try:
        names = path.read_text(encoding="utf-8-sig").replace(",", " ").split()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("cannot be read as UTF-8 text", where=str(path), remedy="give a file of names") from error
    strange = sorted(set(names) - set(ids.tolist()))
    if strange or not names:
        what = f"names of points that are not in the block: {shown(strange)}" if strange else "no names in the file"
        raise InputError(what, where=str(path), remedy="write the ids of points, one a line")
    return np.isin(ids, names)


def oriented_by(
    pairs: Pairs, named: Bool, limit: float, orient: Callable[[RayPairs, Int], RelativeOrientations]
) -> RelativeOrientations:
    """Orientations of the pairs by the named points, with all points.

    Parameters
    ----------
    pairs : Pairs
    named : (n_points,) bool
    limit : float
        Another point is rejected if its y-parallax is larger, in standard deviations of its image coordinates.
    orient : callable
        Orients pairs of rays and first rows.
    """
    use = named[pairs.point]
    start = np.concatenate([[0], np.cumsum(use)])[pairs.start]
    part = orient(pairs.rays.take(np.flatnonzero(use)), start)

    def spread(values: Float) -> Float:
        whole = np.full((len(use), *values.shape[1:]), np.nan)
        whole[use] = values
        return whole

    active = np.zeros(len(use), dtype=bool)
    active[use] = part.active
    found = replace(
        part, active=active, parallax_mm=spread(part.parallax_mm), error_mm=spread(part.error_mm),
        error_sigma_mm=spread(part.error_sigma_mm), test=spread(part.test), xyz=spread(part.xyz),
        point_covariance=spread(part.point_covariance), depth=spread(part.depth),
    )  # fmt: skip
    for pair in np.flatnonzero(part.formed):
        rows = np.arange(pairs.start[pair], pairs.start[pair + 1])
        rows = rows[~use[rows]]
        R, base, rays = part.left_from_right[pair], part.base[pair], pairs.rays.take(rows)
        points = intersect_pair(R, base, rays)
        found.xyz[rows], found.point_covariance[rows], found.depth[rows] = points.xyz, points.covariance, points.depth
        found.parallax_mm[rows], sigma = parallax(R, base, rays)
        found.error_mm[rows], found.error_sigma_mm[rows] = found.parallax_mm[rows], sigma
        found.test[rows] = np.abs(found.parallax_mm[rows]) / sigma
        found.active[rows] = (found.test[rows] <= limit) & (points.depth > 0).all(axis=1)
    return found
