"""Free strips as bodies: their points and images, and what of them and of the ground earlier stages have rejected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.geometry.similarity import transform
from aatri.observations.control import Control
from aatri.observations.observed import Observed
from aatri.observations.ties import STRIP_TIE
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.components import Component

if TYPE_CHECKING:
    from aatri.artifacts.strips import Strips
    from aatri.artifacts.suspects import Suspects


def strip_points_of(strips: Strips) -> BodyPoints:
    """Points of free strips."""
    table = strips.strip_points
    return BodyPoints(table.strip.astype(np.int64), table.point.astype(np.int64), table.xyz, table.covariance)


def usable_ties(strips: Strips) -> Bool:
    """Strip points that no earlier stage has rejected, (n,) bool."""
    table = strips.strip_points
    if not len(strips.suspects):
        return np.ones(len(table), dtype=bool)
    return ~named_by_suspects(strips.suspects, STRIP_TIE, strips.strips.id[table.strip], strips.points.id[table.point])


def named_by_suspects(suspects: Suspects, kind: str, image: Text, point: Text) -> Bool:
    """Observations of a kind, (n,), that suspects which stay out name by the ids of image (or body) and point."""
    out = suspects.take(np.flatnonzero((suspects.kind == kind) & suspects.staying_out))
    names = set(zip(out.image.tolist(), out.point.tolist()))
    return np.array([pair in names for pair in zip(image.tolist(), point.tolist())], dtype=bool)


def most_models(strips: Strips) -> int:
    """Models of the longest strip."""
    return int(np.bincount(strips.strip_images.strip).max(initial=1)) - 1


def distance_m(position_m: Float, point_m: Float) -> float:
    """From the middle of the projection centres to that of the points, m."""
    return float(np.linalg.norm(np.nanmean(position_m, axis=0) - np.nanmean(point_m, axis=0)))


def not_rejected(observed: Sequence[Observed], before: Mapping[str, Suspects]) -> Bool:
    """Which observations no earlier stage has rejected, (n,), kind by kind.

    Parameters
    ----------
    before : mapping
        Suspects of earlier stages, by kind. What has no row in the Block is known by its names.
    """
    parts = [~_rejected(o, before[o.kind]) if o.kind in before else np.ones(len(o), dtype=bool) for o in observed]
    return np.concatenate([np.zeros(0, dtype=bool), *parts])


def _rejected(o: Observed, before: Suspects) -> Bool:
    if not len(before):
        return np.zeros(len(o), dtype=bool)
    out = (before.kind == o.kind) & before.staying_out
    if not out.any() or (o.row >= 0).any():
        return np.asarray(np.isin(o.row, before.row[out & (before.row >= 0)]))
    return named_by_suspects(before, o.kind, *o.names(np.arange(len(o))))


def free_images(strips: Strips, component: Component) -> tuple[Float, Float, Int]:
    """Projection centres and rotations of a component's images, in its frame; rows in images."""
    table = strips.strip_images
    rows = np.flatnonzero(np.isin(table.strip, component.strips))
    centres, rotations = np.empty((len(rows), 3)), np.empty((len(rows), 3, 3))
    for strip, pose in zip(component.strips, component.component_from_strip):
        of_strip = table.strip[rows] == strip
        centres[of_strip] = transform(pose, table.position[rows[of_strip]])
        rotations[of_strip] = pose.rotation @ table.strip_from_image[rows[of_strip]]
    return centres, rotations, table.image[rows].astype(np.int64)


def origin_of(control: Control, position_m: Float) -> Float:
    """A round place near the block, (3,) m: coordinates are reduced to it before any arithmetic."""
    observed_m = np.concatenate([np.where(control.given, control.xyz_m, np.nan), position_m])
    sums, counts = np.nansum(observed_m, axis=0), np.isfinite(observed_m).sum(axis=0)
    return np.asarray(np.round(sums / np.maximum(counts, 1)))
