"""Flying height from the photo scale at points of known ground coordinates.

In a near-vertical image the spread of points about their centroid is c / h times their spread on the ground, so

    Z0 = mean(Z) + c spread(XY) / spread(xy),     spread(v) = sqrt(sum |v - mean(v)|^2).

Two neighbouring images that are turned alike tell it by their base B and the parallax, the length of the mean
difference of the coordinates of common points, without ground coordinates: h = c B / parallax.

Good to a per cent or so of the flying height: enough for refraction and earth curvature. Points nearer to each other
than a tenth of c tell nothing.
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.orientation.refinement.limits import LEAST_EXTENT


def station_heights_m(image: Int, xy_mm: Float, plan_m: Float, height_m: Float, principal_distance_mm: Float) -> Float:
    """Heights of the stations of images with known points.

    Parameters
    ----------
    image : (m,) int
        Image of each measured point, a row of `principal_distance_mm`.
    xy_mm : (m, 2) float64, mm
        Reduced to the principal point.
    plan_m, height_m : (m, 2), (m,) float64, m
        Ground coordinates of the point.
    principal_distance_mm : (n,) float64, mm

    Returns
    -------
    (n,) float64, m
        In the height system of `height_m`; NaN where the points do not tell.
    """
    station = np.full(len(principal_distance_mm), np.nan)
    for k in np.unique(image):
        in_image, c = image == k, principal_distance_mm[k]
        if np.sqrt((np.ptp(xy_mm[in_image], axis=0) ** 2).sum()) >= LEAST_EXTENT * c:
            station[k] = height_m[in_image].mean() + c * _spread(plan_m[in_image]) / _spread(xy_mm[in_image])
    return station


def heights_by_bases_m(
    first: Int, second: Int, image: Int, point: Int, xy_mm: Float, plan_m: Float, principal_distance_mm: Float
) -> Float:
    """Heights above the ground of pairs of neighbouring images, (k,) float64, m; NaN where they share too little.

    Parameters
    ----------
    first, second : (k,) int
        The images of each pair, turned alike.
    image, point : (m,) int
        Of the measured points; a point is measured once in an image.
    xy_mm : (m, 2) float64, mm
        Reduced to the principal point.
    plan_m : (n, 2) float64, m
        Positions of all images.
    principal_distance_mm : (n,) float64, mm
    """
    above = np.full(len(first), np.nan)
    order = np.argsort(image, kind="stable")
    rows = np.split(order, np.cumsum(np.bincount(image, minlength=len(plan_m)))[:-1])
    for k, (a, b) in enumerate(zip(first, second)):
        _, of_a, of_b = np.intersect1d(point[rows[a]], point[rows[b]], return_indices=True)
        parallax = float(np.hypot(*(xy_mm[rows[a][of_a]] - xy_mm[rows[b][of_b]]).mean(axis=0))) if len(of_a) else 0.0
        if parallax > LEAST_EXTENT * principal_distance_mm[a]:
            above[k] = principal_distance_mm[a] * np.linalg.norm(plan_m[b] - plan_m[a]) / parallax
    return above


def _spread(plane: Float) -> float:
    """Root of the sum of squared distances from the centroid."""
    return float(np.sqrt(((plane - plane.mean(axis=0)) ** 2).sum()))
