"""What the film of both images does to a relative orientation: their common errors, by the law of propagation.

The points are weighted as if independent: the estimate is x = -(J'J)^-1 J'v. An error K d of the film of an image
changes v by F d, F = -(dF/dl K) / s_F, and with it x by G d, G = -(J'J)^-1 J'F. The covariance of the orientation is

    (J'J)^-1 + sum over both images of G C_d G'

C_d from the interior orientation. The covariance of the residuals is larger too, but by little: most of what an affine
film error does to a y-parallax is taken up by the orientation. Two models of one image share its film error; their
covariances are those of each alone.
"""

import numpy as np

from aatri.arrays import Float
from aatri.geometry.coplanarity import coplanarity, essential_matrix, sampson
from aatri.geometry.vectors import tangents
from aatri.orientation.relative.orientations import ImagePairs, RelativeOrientations


def film_in_orientations(
    pairs: ImagePairs, orientations: RelativeOrientations, basis: Float, film_covariance: Float
) -> Float:
    """What is to be added to the covariances of the orientations, zero where no film is open.

    Parameters
    ----------
    basis : (n, 2, s) float64
        K of every measurement.
    film_covariance : (n_images, s, s) float64
        C_d.

    Returns
    -------
    (m, 5, 5) float64, rad^2
    """
    added = np.zeros(orientations.covariance.shape)
    open_ = np.einsum("nii->ni", film_covariance).any(axis=1)
    for k in np.flatnonzero(orientations.formed & (open_[pairs.left] | open_[pairs.right])).tolist():
        rows = pairs.rows(k)
        rows = rows[orientations.active[rows]]
        R, b, rays = orientations.left_from_right[k], orientations.base[k], pairs.rays.take(rows)
        _, J = sampson(R, b, tangents(b), rays)
        _, gradient = coplanarity(essential_matrix(R, b), rays.left, rays.right)
        sigma = np.concatenate([rays.left_sigma, rays.right_sigma], axis=1)
        gain = np.linalg.solve(J.T @ J, J.T / np.linalg.norm(gradient * sigma, axis=1))
        for image, measured, part in (
            (pairs.left[k], pairs.left_row, gradient[:, :2]),
            (pairs.right[k], pairs.right_row, gradient[:, 2:]),
        ):
            G = gain @ np.einsum("ni,nis->ns", part, basis[measured[rows]])
            added[k] += G @ film_covariance[image] @ G.T
    return added
