"""Start of a resection without approximate values: the three-point problem, closed.

Three rays with known ground points P1 P2 P3 give the distances s1, s2 = u s1, s3 = v s1 from the projection centre by
Grunert's quartic in v; the orientation follows by turning the triangle of the image onto that of the ground. Several
well-spread triples are tried, and the solution with the smallest median residual over all points is taken.

Symbols: a, b, c the sides opposite P1, P2, P3; alpha, beta, gamma the angles between the rays opposite them.

Source: Grunert 1841, in the form of Haralick, Lee, Ottenberg and Noelle 1994.
"""

from __future__ import annotations

import itertools

import numpy as np

from aatri.arrays import Float
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.vectors import unit

MAX_TRIPLES = 20


def start_orientation(xy_mm: Float, c_mm: float, xyz_m: Float) -> tuple[Float, Float] | None:
    """Orientation of one image from at least four ground points, good enough to start a resection.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    c_mm : float, mm
    xyz_m : (n, 3) float64, m

    Returns
    -------
    position_m : (3,) float64, m
    ground_from_image : (3, 3) float64
        None if there are fewer than four points or no solution has all points in front of the camera.
    """
    if len(xy_mm) < 4:
        return None
    origin = xyz_m.mean(axis=0)
    ground = xyz_m - origin
    rays = unit(np.column_stack([xy_mm, np.full(len(xy_mm), -c_mm)]))
    best, best_size = None, np.inf
    for triple in _triples(xy_mm):
        for position, rotation in three_point(rays[triple], ground[triple]):
            u = in_image_axes(position[None], rotation[None], ground)
            if (u[:, 2] >= 0).any():
                continue
            residual = project(u, np.full(len(u), c_mm)) - xy_mm
            size = float(np.median(np.hypot(residual[:, 0], residual[:, 1])))
            if size < best_size:
                best, best_size = (position + origin, rotation), size
    return best


def _triples(xy: Float) -> list[list[int]]:
    """The triples of largest area among the points farthest out, in a fixed order."""
    outer = np.argsort(-np.linalg.norm(xy - xy.mean(axis=0), axis=1), kind="stable")[:9]
    triples = [list(t) for t in itertools.combinations(sorted(outer), 3)]
    sides = [(xy[t[1]] - xy[t[0]], xy[t[2]] - xy[t[0]]) for t in triples]
    areas = np.array([abs(p[0] * q[1] - p[1] * q[0]) for p, q in sides])
    return [triples[k] for k in np.argsort(-areas, kind="stable")[:MAX_TRIPLES]]


def three_point(rays: Float, ground: Float) -> list[tuple[Float, Float]]:
    """All orientations that see three ground points along three rays.

    Parameters
    ----------
    rays : (3, 3) float64
        Unit vectors in the axes of the image.
    ground : (3, 3) float64

    Returns
    -------
    list of (position (3,), ground_from_image (3, 3))
    """
    a, b, c = (float(np.linalg.norm(ground[i] - ground[j])) for i, j in ((1, 2), (0, 2), (0, 1)))
    ca, cb, cg = (float(rays[i] @ rays[j]) for i, j in ((1, 2), (0, 2), (0, 1)))
    if min(a, b, c) == 0:
        return []
    p, q, r = (a**2 - c**2) / b**2, (a**2 + c**2) / b**2, c**2 / b**2
    quartic = [
        (p - 1) ** 2 - 4 * r * ca**2,
        4 * (p * (1 - p) * cb - (1 - q) * ca * cg + 2 * r * ca**2 * cb),
        2 * (p**2 - 1 + 2 * p**2 * cb**2 + 2 * (1 - r) * ca**2 - 4 * q * ca * cb * cg + 2 * (1 - a**2 / b**2) * cg**2),
        4 * (-p * (1 + p) * cb + 2 * a**2 / b**2 * cg**2 * cb - (1 - q) * ca * cg),
        (1 + p) ** 2 - 4 * a**2 / b**2 * cg**2,
    ]
    found = []
    for root in np.roots(quartic):
        v = float(root.real)
        denominator = 2 * (cg - v * ca)
        if abs(root.imag) > 1e-4 * (1 + abs(v)) or v <= 0 or abs(denominator) < 1e-12:
            continue
        u = ((p - 1) * v**2 - 2 * p * cb * v + 1 + p) / denominator
        s1_squared = b**2 / (1 + v**2 - 2 * v * cb)
        if u > 0 and s1_squared > 0:
            s1 = np.sqrt(s1_squared)
            found.append(_aligned(rays * np.array([s1, u * s1, v * s1])[:, None], ground))
    return found


def _aligned(image: Float, ground: Float) -> tuple[Float, Float]:
    """Orientation that carries points in the axes of the image to the ground, least squares without scale."""
    mean_image, mean_ground = image.mean(axis=0), ground.mean(axis=0)
    rotation = nearest_rotation((ground - mean_ground).T @ (image - mean_image))
    return mean_ground - rotation @ mean_image, rotation
