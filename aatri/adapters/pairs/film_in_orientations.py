"""What the film of both images does to a relative orientation: their common errors, by the law of propagation.

The points are weighted as if independent: the estimate is x = -(J'J)^-1 J'v. An error K d of the film of an image
changes v by F d, F = -(dF/dl K) / s_F, and with it x by G d, G = -(J'J)^-1 J'F. The covariance of the orientation is

    (J'J)^-1 + sum over both images of G C_d G'

C_d from the interior orientation. The covariance of the residuals is larger too, but by little: most of what an affine
film error does to a y-parallax is taken up by the orientation. Two models of one image share its film error; their
covariances are those of each alone.
"""

from __future__ import annotations

import numpy as np

from aatri.adapters.film_errors import film_errors
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.geometry.coplanarity import RayPairs, coplanarity, essential_matrix, sampson
from aatri.geometry.vectors import tangents
from aatri.orientation.relative.orientations import RelativeOrientations


def film_in_orientations(
    block: Block, image_points: ImagePoints, rays: RayPairs, start: Int, left: tuple[Int, Int], right: tuple[Int, Int],
    found: RelativeOrientations,
) -> Float:  # fmt: skip
    """What is to be added to the covariances of the orientations, zero where no film is open.

    Parameters
    ----------
    block : Block
    image_points : ImagePoints
    rays : RayPairs
        Points of all pairs, pair by pair.
    start : (m + 1,) int
        First point of each pair.
    left, right : ((m,) int, (n,) int)
        Rows in images of each pair, rows of the measurements of each point.
    found : RelativeOrientations

    Returns
    -------
    (m, 5, 5) float64, rad^2
    """
    added = np.zeros(found.covariance.shape)
    film = film_errors(block, image_points)
    if film is None:
        return added
    some = np.asarray(film.open.any(axis=1))
    for k in np.flatnonzero(found.formed & (some[left[0]] | some[right[0]])).tolist():
        rows = int(start[k]) + np.flatnonzero(found.active[int(start[k]) : int(start[k + 1])])
        R, b, of_pair = found.left_from_right[k], found.base[k], rays.take(rows)
        _, J = sampson(R, b, tangents(b), of_pair)
        _, gradient = coplanarity(essential_matrix(R, b), of_pair.left, of_pair.right)
        sigma = np.concatenate([of_pair.left_sigma, of_pair.right_sigma], axis=1)
        gain = np.linalg.solve(J.T @ J, J.T / np.linalg.norm(gradient * sigma, axis=1))
        for (image, measured), part in ((left, gradient[:, :2]), (right, gradient[:, 2:])):
            G = gain @ np.einsum("ni,nis->ns", part, film.basis[measured[rows]])
            added[k] += G @ film.covariance[image[k]] @ G.T
    return added
