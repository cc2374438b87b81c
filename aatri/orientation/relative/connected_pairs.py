"""Pairs connected along their strips: each model with its scale in units of the model before as an unknown.

Model coordinates by the rules of the lecture notes: two point projection coefficients and a mean.

    N1 = (Bx Z2 - Bz X2) / (X1 Z2 - X2 Z1),   N2 = (Bx Z1 - Bz X1) / (X1 Z2 - X2 Z1)
    X = N1 X1,   Y = (N1 Y1 + By + N2 Y2) / 2,   Z = N1 Z1

(X1, Y1, Z1) the left ray, (X2, Y2, Z2) the right one, turned, in the frame of the left image with its X axis nearest to
the base (turned by a multiple of 90 degrees about its Z axis, where the camera is mounted across). The rays are those
measured: what remains of the y-parallax is halved, X and Z rest on x alone. The rigorous intersection
(geometry.intersection) shares the correction among all four coordinates.

A connection point, which the model before has too, keeps the height Z that it has there, counted from the common
projection centre and in the unit of this model; the right image gives the rest (By and Bz are those of the base B):

    N2 = (Z - Bz) / Z2,    X = Bx + N2 X2,   Y = By + N2 Y2        Z = N2a Z2a of the model before, over the scale

Source: lecture notes A401, A403.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.connected import Before, Connected, connected_orientation
from aatri.orientation.relative.orientations import ImagePairs, RelativeOrientations, refresh_points


@dataclass(frozen=True)
class Connection:
    """A pair connected with the pair before it."""

    pair: int
    before: int
    orientation: Connected
    point: Int
    """(c,) int32. The connection points."""


def connected_pairs(
    pairs: ImagePairs, orientations: RelativeOrientations, limit: float, orients: Bool | None = None
) -> tuple[tuple[Connection, ...], tuple[int, ...]]:
    """Connect pairs with those that end where they begin, and put the connected orientations in their place.

    Parameters
    ----------
    pairs : ImagePairs
        Along strips: an image is the right one of one pair at most.
    orientations : RelativeOrientations
        Changed.
    limit : float
        A connection point with a larger test statistic is rejected.
    orients : (n,) bool, optional
        Points that orient beside those that connect; None: all.

    Returns
    -------
    connections : tuple of Connection
    loose : tuple of int
        Pairs with one before them that cannot be connected with it.
    """
    ends_at = {int(j): k for k, j in enumerate(pairs.right)}
    connections, loose = list[Connection](), list[int]()
    for pair, left in enumerate(pairs.left.tolist()):
        before = ends_at.get(left)
        if before is None or not (orientations.formed[pair] and orientations.formed[before]):
            continue
        connection = _connected(pairs, orientations, before, pair, limit, orients)
        if connection is None:
            loose.append(pair)
        else:
            connections.append(connection)
    return tuple(connections), tuple(loose)


def _connected(
    pairs: ImagePairs, orientations: RelativeOrientations, before: int, pair: int, limit: float, orients: Bool | None
) -> Connection | None:
    a, b = (slice(int(pairs.start[k]), int(pairs.start[k + 1])) for k in (before, pair))
    common, at_a, at_b = np.intersect1d(pairs.point[a], pairs.point[b], return_indices=True)
    good = (
        orientations.active[a][at_a]
        & orientations.active[b][at_b]
        & np.isfinite(orientations.point_covariance[a][at_a]).all(axis=(1, 2))
    )
    common, at_a, at_b = common[good], at_a[good], at_b[good]
    rays = pairs.rays.take(np.arange(b.start, b.stop))
    takes_part = np.ones(b.stop - b.start, dtype=bool) if orients is None else orients[b].copy()
    takes_part[at_b] = True
    one = connected_orientation(
        rays,
        orientations.active[b] & takes_part,
        orientations.left_from_right[pair],
        orientations.base[pair],
        Before(
            orientations.left_from_right[before],
            orientations.base[before],
            orientations.covariance[before],
            at_b,
            orientations.xyz[a][at_a],
            orientations.point_covariance[a][at_a],
        ),
        limit=limit,
    )
    if one is None:
        return None
    orientations.left_from_right[pair], orientations.base[pair] = one.left_from_right, one.base
    orientations.covariance[pair], orientations.sigma0[pair] = one.covariance, one.sigma0
    orientations.redundancy[pair], orientations.iterations[pair] = (
        one.redundancy,
        orientations.iterations[pair] + one.iterations,
    )
    refresh_points(orientations, pairs, pair)
    return Connection(pair, before, one, common)


def classical_model_points(
    pairs: ImagePairs, orientations: RelativeOrientations, connections: tuple[Connection, ...] = ()
) -> Float:
    """Model points by projection coefficients, (n, 3); connection points keep the height of the model before."""
    xyz, connection_of = orientations.xyz.copy(), {c.pair: c for c in connections}
    for pair in np.flatnonzero(orientations.formed).tolist():
        rows, R, base = pairs.rows(pair), orientations.left_from_right[pair], orientations.base[pair]
        rays = pairs.rays.take(rows)
        xyz[rows] = classical_points(R, base, rays)
        connection = connection_of.get(pair)
        if connection is None:
            continue
        one, before = connection.orientation, connection.before
        used = connection.point[one.connects]
        previous_rows = int(pairs.start[before]) + np.searchsorted(pairs.point[pairs.rows(before)], used)
        previous_xyz = (xyz[previous_rows] - orientations.base[before]) @ orientations.left_from_right[before]
        rows_of_model = np.searchsorted(pairs.point[rows], used)
        xyz[rows[rows_of_model]] = connection_points(R, base, rays.take(rows_of_model), previous_xyz[:, 2] / one.scale)
    return xyz


def classical_points(left_from_right: Float, base: Float, rays: RayPairs) -> Float:
    """Points of a model.

    Parameters
    ----------
    left_from_right : (3, 3) float64
    base : (3,) float64

    Returns
    -------
    (n, 3) float64, unit of the base, frame of the left image
    """
    quarter = np.round(np.arctan2(base[1], base[0]) / (0.5 * np.pi)) * 0.5 * np.pi
    c, s = np.cos(quarter), np.sin(quarter)
    along = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # from the left image to the frame along the base
    X1, Y1, Z1 = (rays.left @ along.T).T
    X2, Y2, Z2 = (rays.right @ left_from_right.T @ along.T).T
    Bx, By, Bz = along @ base
    D = X1 * Z2 - X2 * Z1
    N1, N2 = (Bx * Z2 - Bz * X2) / D, (Bx * Z1 - Bz * X1) / D
    return np.asarray(np.column_stack([N1 * X1, 0.5 * (N1 * Y1 + By + N2 * Y2), N1 * Z1]) @ along)


def connection_points(left_from_right: Float, base: Float, rays: RayPairs, height: Float) -> Float:
    """Points of a model that keep the height of the model before.

    Parameters
    ----------
    left_from_right : (3, 3) float64
    base : (3,) float64
    height : (n,) float64, unit of the base
        Z in the frame of the left image.

    Returns
    -------
    (n, 3) float64, unit of the base, frame of the left image
    """
    ray = rays.right @ left_from_right.T
    return np.asarray(base + ((height - base[2]) / ray[:, 2])[:, None] * ray)
