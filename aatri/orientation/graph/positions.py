"""Projection centres of a component, rotations known: from the bases with their lengths, from GNSS, or from anywhere.

    bases:   c_right - c_left = s R_left b + v       robustly (`differences`), v in units of s
    gnss:    the rotation that turns R_left b onto the directions between observed positions, and these turned back
    random:  drawn by a seeded generator

Then from the directions of rays, v = d (X - c), d >= 0 (`directions`), with the points of most rays in every image: so
many that each image is held on all sides, not all of them.
"""

from typing import Literal

import numpy as np

from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.intersection import intersect_rays
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.vectors import unit
from aatri.observations.image_point_rows import ImagePointRows
from aatri.orientation.graph.differences import fitted_robustly, robust_weights
from aatri.orientation.graph.directions import adjusted_directions
from aatri.orientation.graph.pair_graph import PairGraph
from aatri.orientation.graph.triangulation import narrow

Start = Literal["bases", "gnss", "random"]

PER_IMAGE = 40
"""Points per image by which directions are adjusted."""

SIGMA_RAD = 0.002
"""Of a direction: rotations are averages, not yet adjusted."""

TURNS = 20


def from_bases(pairs: PairGraph, length: Float, rotation: Float) -> Float:
    """Projection centres from bases with their lengths, (n, 3); the first image of each part is at the origin."""
    difference = length[:, None] * np.einsum("nij,nj->ni", rotation[pairs.left], pairs.base)
    weight = 1.0 / (length * np.maximum(pairs.base_sigma_rad, 1e-3)) ** 2
    return fitted_robustly(pairs.images, pairs.left, pairs.right, difference, weight / weight.max(), length)[0]


def from_gnss(pairs: PairGraph, rotation: Float, observed_m: Float) -> Float:
    """Observed positions turned into the frame of the rotations.

    Raises
    ------
    GeometryError
        If the positions lie on a line: then their frame is open.
    """
    both = finite_rows(observed_m[pairs.left]) & finite_rows(observed_m[pairs.right])
    ground = observed_m[pairs.right[both]] - observed_m[pairs.left[both]]
    apart = np.linalg.norm(ground, axis=1) > 0
    ground = unit(ground[apart])
    free = np.einsum("nij,nj->ni", rotation[pairs.left[both]], pairs.base[both])[apart]
    spread = np.linalg.svd(ground, compute_uv=False) if len(ground) > 1 else np.zeros(2)
    if len(ground) < 2 or spread[1] < 0.05 * spread[0]:
        raise GeometryError("the observed positions lie on a line", remedy="positions: bases")
    weight = np.ones(len(ground))
    for _ in range(TURNS):
        turn = nearest_rotation((weight[:, None] * free).T @ ground)  # free = turn ground
        weight = robust_weights(np.linalg.norm(free - ground @ turn.T, axis=1), np.ones(len(ground)), absolute=True)
    return np.asarray((observed_m - np.nanmean(observed_m, axis=0)) @ turn.T)


def by_directions(
    rays: ImagePointRows, rotation: Float, centre: Float, images: Bool, *, anywhere: bool
) -> tuple[Float, str]:
    """Projection centres adjusted by the directions of rays; those of other images as they are.

    Parameters
    ----------
    centre : (n, 3) float64
        Start.
    images : (n,) bool
        What is adjusted.
    anywhere : bool
        The start is none.

    Returns
    -------
    centre : (n, 3) float64
    why : str
        Why they are left as they were; empty where they are adjusted.

    Raises
    ------
    GeometryError, ConvergenceError
        If there is no start and no adjustment.
    """
    rows = _well_seen(rays, images)
    u = np.column_stack([rays.xy_mm[rows], -rays.c_mm[rows]])
    direction = unit(np.einsum("nij,nj->ni", rotation[rays.image[rows]], u))
    wide = ~narrow(direction, rays.point[rows], np.ones(len(rows), dtype=bool), int(rays.point.max(initial=-1)) + 1)
    rows, direction = rows[wide[rays.point[rows]]], direction[wide[rays.point[rows]]]
    if not len(rows):
        return centre, "no point is seen in two of the images at an angle"
    names, point = np.unique(rays.point[rows], return_inverse=True)
    place = np.cumsum(images) - 1
    xyz = intersect_rays(centre[rays.image[rows]], direction, point, len(names))
    lost = ~finite_rows(xyz)
    xyz[lost] = (centre[images].mean(axis=0) + _mean(direction, point, len(names)))[lost]
    try:
        adjusted, _ = adjusted_directions(
            direction, place[rays.image[rows]], point, centre[images], xyz, SIGMA_RAD, linear=anywhere
        )
    except (ConvergenceError, GeometryError) as error:
        if anywhere:
            raise
        return centre, error.what
    moved = centre.copy()
    moved[images] = adjusted
    return moved, ""


def _mean(direction: Float, point: Int, n: int) -> Float:
    total = np.zeros((n, 3))
    np.add.at(total, point, direction)
    return unit(total)


def _well_seen(rays: ImagePointRows, images: Bool) -> Int:
    """Rays of the points of most rays in every image, `PER_IMAGE` of each; a point is taken in all its images."""
    use = np.flatnonzero(rays.active & images[rays.image])
    ray_count = np.bincount(rays.point[use], minlength=int(rays.point.max(initial=-1)) + 1)
    order = np.lexsort((rays.point[use], -ray_count[rays.point[use]], rays.image[use]))
    image = rays.image[use][order]
    rank = np.arange(len(order)) - np.searchsorted(image, image)
    points = np.unique(rays.point[use][order][rank < PER_IMAGE])
    points = points[ray_count[points] >= 2]
    return use[np.isin(rays.point[use], points)]
