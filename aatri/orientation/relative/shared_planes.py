"""Which of two orientations over a plane is right: neighbouring pairs see the same plane.

Points in a plane have two orientations, each with a plane of its own, m'X = 1 in the frame of the left image. That of
the right one is the ground, whose normal in an image is the same in all pairs of this image; the other one lies along
the base (m2 = |b|^2 m - 2 b), elsewhere in each pair. So of an ambiguous pair the orientation counts whose normals are
nearer to those of the other pairs of both its images, of an ambiguous one the nearer of its two.

Source: Longuet-Higgins, Proc. R. Soc. B 227 (1986) 399; Malis & Vargas 2007, Deeper understanding of the homography
decomposition for vision-based control, INRIA RR-6303 (choice by the normal).
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.vectors import unit
from aatri.orientation.relative.limits import NEARER, OTHER_PLANE_RAD
from aatri.orientation.relative.orientations import EssentialOrientations

PARTNERS = 8
"""Pairs of an image, before and behind in their order, with which each is compared."""


def rotations_by_planes(
    left: Int, right: Int, rays: RayPairs, start: Int, essential: EssentialOrientations
) -> tuple[Float, int]:
    """Rotations of ambiguous pairs as the planes of their neighbours tell them, (m, 3, 3), and how many are not the
    first ones; NaN where nothing tells.

    Parameters
    ----------
    left, right : (m,) int
        Images of the pairs.
    rays, start
        As of `essential_orientations`.
    """
    first = np.concatenate([essential.orientations.left_from_right, essential.orientations.base[:, :, None]], axis=2)
    both = np.stack([first, essential.second], axis=1)
    ambiguous, image = np.isfinite(essential.second[:, 0, 0]), np.concatenate([left, right])
    off = _off_neighbours(image, np.concatenate(_normals(both, rays, start, essential.orientations.active)))
    off = off.reshape(2, -1, 2)
    count = np.isfinite(off).sum(axis=0)
    mean = np.nansum(off, axis=0) / np.where(count > 0, count, np.nan)
    decided = [ambiguous & (mean[:, k] < NEARER * mean[:, 1 - k]) for k in (0, 1)]
    rotation = np.full((len(left), 3, 3), np.nan)
    for k in (0, 1):
        rotation[decided[k]] = both[decided[k], k, :, :3]
    return rotation, int(decided[1].sum())


def _normals(poses: Float, rays: RayPairs, start: Int, active: np.ndarray) -> tuple[Float, Float]:
    """Normals of the planes of two orientations of each pair, in both of its images, (m, 2, 3); NaN unknown.

    With the inverse lengths q of the rays u1 in the left image, m'u1 = q is linear in m.
    """
    m = len(poses)
    pair = np.repeat(np.arange(m), np.diff(start))[active]
    u1, u2 = unit(rays.left[active]), unit(rays.right[active])
    in_left, in_right = np.full((m, 2, 3), np.nan), np.full((m, 2, 3), np.nan)
    for k in (0, 1):
        R, b = poses[pair, k, :, :3], poses[pair, k, :, 3]
        w = np.einsum("nij,nj->ni", R, u2)
        across = np.cross(u1, w)
        with np.errstate(divide="ignore", invalid="ignore"):
            q = (across**2).sum(axis=1) / np.einsum("ni,ni->n", np.cross(b, w), across)
        use = np.isfinite(q)
        N, g = np.zeros((m, 3, 3)), np.zeros((m, 3))
        np.add.at(N, pair[use], u1[use, :, None] * u1[use, None, :])
        np.add.at(g, pair[use], u1[use] * q[use, None])
        determined = np.bincount(pair[use], minlength=m) >= 3
        determined[determined] = np.linalg.cond(N[determined]) < 1.0 / np.finfo(np.float64).eps
        plane = np.linalg.solve(N[determined], g[determined][:, :, None])[:, :, 0]
        in_left[determined, k] = unit(plane)
        turned = np.einsum("nji,nj->ni", poses[determined, k, :, :3], plane)
        side = 1.0 - np.einsum("ni,ni->n", plane, poses[determined, k, :, 3])
        in_right[determined, k] = unit(turned * np.sign(side)[:, None])
    return in_left, in_right


def _off_neighbours(image: Int, normal: Float) -> Float:
    """Mean angle between each normal and the nearest one of other pairs of the image, (n, 2), rad; NaN without any."""
    order = np.argsort(image, kind="stable")
    row_image, n = image[order], normal[order]
    total, count = np.zeros((len(row_image), 2)), np.zeros((len(row_image), 2))
    for step in range(1, PARTNERS + 1):
        neighbours = np.flatnonzero(row_image[step:] == row_image[:-step])
        for a, b in ((neighbours, neighbours + step), (neighbours + step, neighbours)):
            cosine = np.einsum("nki,nji->nkj", n[a], n[b])
            with np.errstate(invalid="ignore"):
                angle = np.arccos(np.clip(cosine, -1.0, 1.0))
            angle = np.fmin(angle[:, :, 0], angle[:, :, 1])
            finite = np.isfinite(angle)
            total[a] += np.where(finite, np.minimum(angle, OTHER_PLANE_RAD), 0.0)
            count[a] += finite
    off = np.full((len(row_image), 2), np.nan)
    off[order] = total / np.where(count > 0, count, np.nan)
    return off
