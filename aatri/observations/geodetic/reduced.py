"""Distances reduced to the map or to the ellipsoid: between the places below, whatever the heights of their ends.

    map        l = (E, N, 0)(B) - (E, N, 0)(A)
    ellipsoid  l = F(B) - F(A),    F(X) = X - h u,    s = 2 R asin(|l| / 2 R)
               dF/dX = M / (M + h) n n' + N / (N + h) e e'

u is the normal, h the ellipsoidal height; n, e are true north and east, M and N the radii of curvature, R their
geometric mean in the middle of the block. The arc of this sphere for the geodesic is right to 10 um over 10 km.

In a frame whose Z is the height both are lengths in its plane; there a distance on the ellipsoid is first enlarged by
the scale of the map in its middle. Source: Torge, Geodesy; docs/formulas.md 5.4.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Float
from aatri.errors import AatriError, InputError
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.geodetic.sights import Between, Measured, Sights, places_of_ends, slope
from aatri.observations.level import Level
from aatri.observations.limits import NOTED_NEGLECT

if TYPE_CHECKING:
    from aatri.frames.tangent import TangentFrame
    from aatri.observations.observed import ObservationSource


def in_map(level: Level, start: Float, end: Float, _a: Float, _b: Float) -> tuple[Float, Float, Float]:
    """Lines between places in the map, and their derivatives."""
    plan = np.array([1.0, 1.0, 0.0])
    (low, by_low), (high, by_high) = level.coordinates(start), level.coordinates(end)
    return (high - low) * plan, -by_low * plan[:, None], by_high * plan[:, None]


def on_ellipsoid(frame: TangentFrame, origin_m: Float) -> tuple[Between, Measured]:
    """Lines between the places below on the ellipsoid, and the length of their arcs."""
    at_origin = frame.up_at(np.asarray(origin_m)[None])
    radius = float(np.sqrt(np.prod(_radii(frame, at_origin))))

    def below(X: Float) -> tuple[Float, Float]:
        u, h = frame.up_at(X), frame.height_at(X)
        east, north, up = np.moveaxis(frame.true_axes_at(X.real), 2, 0)
        meridian, normal = _radii(frame, up)
        by_north, by_east = meridian / (meridian + h.real), normal / (normal + h.real)
        D = [k[:, None, None] * a[:, :, None] * a[:, None, :] for k, a in ((by_north, north), (by_east, east))]
        return X - h[:, None] * u, D[0] + D[1]

    def between(_level: Level, start: Float, end: Float, _a: Float, _b: Float) -> tuple[Float, Float, Float]:
        (low, by_low), (high, by_high) = below(start + origin_m), below(end + origin_m)
        return high - low, -by_low, by_high

    def arc(line: Float) -> tuple[Float, Float]:
        chord, by_line = slope(line)
        half = 0.5 * chord / radius
        return 2 * radius * np.arcsin(half), by_line / np.sqrt(1 - half**2)[:, None]

    return between, arc


def _radii(frame: TangentFrame, up: Float) -> tuple[Float, Float]:
    """Radii of curvature in the meridian and across it where the normal is `up`."""
    sine = up @ frame.axes[2]
    w = 1 - frame.body.e2 * sine**2
    return frame.body.a_m * (1 - frame.body.e2) / w**1.5, frame.body.a_m / np.sqrt(w)


def map_scale(frame: TangentFrame, xyz: Float) -> Float:
    """Length in the map over length on the ground, (n,), at places given in coordinates of the block."""
    D = frame.derivatives_at(frame.from_block(xyz))
    return np.asarray(np.sqrt(np.abs(np.linalg.det(D[:, :2, :2]))))


def in_the_plane(source: ObservationSource, rows: Sights) -> Sights:
    """Distances on the ellipsoid as they are in the plane of a map."""
    if source.geodesy is None or source.frame is not None:
        return rows
    middle = _middles(source, rows) * np.array([1.0, 1.0, 0.0])
    return replace(rows, value=rows.value * np.where(np.isfinite(middle[:, 0]), map_scale(source.geodesy, middle), 1.0))


def check_map(source: ObservationSource, rows: Sights) -> None:
    """Whether there is a map that distances can be reduced to.

    Raises
    ------
    InputError
        If the first frame of the block is geocentric.
    """
    if len(rows) and source.frame is not None and source.frame.geocentric:
        raise InputError(
            f"{several(len(rows), 'geodetic observation', 'is', 'are')} reduced to a map, but the "
            "block's first frame is none",
            where=f"geodetic.csv: {rows.names[0]}",
            remedy="make the map the first frame of block.yaml, or give observations that are not reduced",
        )


def not_reduced(source: ObservationSource, rows: Sights) -> tuple[Note, ...]:
    """What the scale of the map, in which the block is adjusted, does to distances that are not reduced to it."""
    if source.geodesy is None or source.frame is not None or not len(rows):
        return ()
    middle = _middles(source, rows)
    try:
        scale = map_scale(source.geodesy, middle)
    except AatriError:
        return ()
    effect = np.abs(scale - 1) * rows.value
    large = effect > NOTED_NEGLECT * rows.sigma
    if not large.any():
        return ()
    worst = int(np.nanargmax(effect))
    text = (
        f"{several(len(rows), 'distance', 'is', 'are')} not reduced, and the adjustment is in a map of "
        f"scale {scale[worst]:.6f} here: "
        f"{large.sum()} are wrong by more than {NOTED_NEGLECT:g} sigma, {rows.names[worst]} by {effect[worst]:.3g} m; "
        "earth_curvature: frame takes them as they are, `reduced: map` says that they are reduced"
    )
    return (Note("warning", text, tuple(rows.names[large].tolist())),)


def _middles(source: ObservationSource, rows: Sights) -> Float:
    """Middles of the lines, in the coordinates of the block; NaN where an end is unknown."""
    ends = places_of_ends(rows, source.start)
    return np.asarray(0.5 * (ends[0] + ends[1]) + source.origin_m)
