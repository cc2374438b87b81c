"""Start values of an absolute orientation: rotation, scale and shift of a component on the ground.

In this order: the closed form of at least three full points that are not on a line; with attitudes their rotation, and
scale and shift by least squares of all coordinates given; otherwise, or where asked for (`two_points`), the component
levelled by the mean viewing direction of its images and fitted in plan: to all points known in plan, or to the two that
lie farthest apart (the frame tp, geometry.two_point). The scale is that of the distances where coordinates tell none.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Bool, Float
from aatri.errors import GeometryError
from aatri.geometry.rotations import levelling, nearest_rotation
from aatri.geometry.similarity import Similarity, robust_closed_form
from aatri.geometry.two_point import two_point_frame
from aatri.orientation.bodies.datum import Datum

COLLINEAR = 0.01
"""Full points count as lying on a line if the ratio of the eigenvalues of their scatter is below this."""

TURNS = 20
"""Reweighted means of rotations."""


def attitude_of(datum: Datum, up: Float, use: Bool) -> tuple[Float, Similarity | None]:
    """Rotation to a levelled frame, and the closed form where full points allow it.

    Parameters
    ----------
    datum : Datum
    up : (3,) float64
        Direction against the mean viewing direction, in the component.
    use : (n,) bool
    """
    full = np.flatnonzero(datum.given.all(1) & use)
    if len(full) >= 3:
        x, X = datum.x[full], datum.xyz_m[full]
        spread = np.linalg.svd(x - x.mean(0), compute_uv=False)
        if spread[1] ** 2 > COLLINEAR * spread[0] ** 2:
            similarity, _ = robust_closed_form(x, X)
            if datum.offset_m[full].any():
                similarity, _ = robust_closed_form(x, X - datum.offset_m[full] @ similarity.rotation.T)
            return similarity.rotation, similarity
    if datum.attitudes is not None:
        return _mean_rotation(datum), None
    return levelling(up), None


def _mean_rotation(datum: Datum) -> Float:
    """The rotation that brings the images to their attitudes, with the least sum of angles."""
    assert datum.attitudes is not None
    each = datum.attitudes.observed_rotation @ datum.attitudes.strip_from_image.swapaxes(1, 2)
    weight = np.ones(len(each))
    for _ in range(TURNS):
        turn = nearest_rotation(np.einsum("n,nij->ij", weight, each))
        weight = 1.0 / np.maximum(np.linalg.norm(each - turn, axis=(1, 2)), 1e-6)
    return turn


def turned_start(datum: Datum, rotation: Float, use: Bool, what: str) -> Similarity:
    """Scale and shift of a component that is turned already, by all coordinates given, and by distances.

    Raises
    ------
    GeometryError
        If they do not tell shift and scale.
    """
    turned = datum.x @ rotation.T
    rows, axis = np.nonzero(datum.given & use[:, None])
    value = (datum.xyz_m - datum.offset_m @ rotation.T)[rows, axis]
    x = turned[rows, axis]
    count = np.bincount(axis, minlength=3)
    if not count.all():
        raise GeometryError(
            f"{what}: no coordinate {'XYZ'[int(np.argmin(count))]} is known",
            remedy="give control or positions with X, Y and Z",
        )
    mean_x, mean_X = (np.bincount(axis, a, 3) / count for a in (x, value))
    dx, dX = x - mean_x[axis], value - mean_X[axis]
    extent = float(np.linalg.norm(turned - turned.mean(axis=0), axis=1).max(initial=0.0))
    scale = distance_scale(datum, datum.x, rotation)
    if float(np.abs(dx).max()) > 1e-6 * extent:
        scale = float(dx @ dX / (dx @ dx))
    if scale is None or scale <= 0:
        raise GeometryError(f"{what}: its scale is not known", remedy="give two known points, or a distance")
    return Similarity(mean_X - scale * mean_x, scale, rotation)


def distance_scale(datum: Datum, x: Float, rotation: Float) -> float | None:
    """Median of given distances over their length in the component; None without distances."""
    ratios = []
    for d in datum.distances:
        line = (x[d.sights.target] - x[d.sights.station]) @ rotation.T
        line[d.plan, 2] = 0.0
        ratios.append(d.sights.value / np.maximum(np.linalg.norm(line, axis=1), 1e-300))
    return float(np.median(np.concatenate(ratios))) if ratios else None


def levelled_start(datum: Datum, rotation: Float, use: Bool, what: str, *, two_points: bool) -> Similarity:
    """Plan similarity of a levelled component by all points or by two, and a mean height."""
    level = datum.x @ rotation.T
    plan = np.flatnonzero(datum.given[:, :2].all(1) & use)
    heights = np.flatnonzero(datum.given[:, 2] & use)
    if len(plan) < 2 or not len(heights):
        raise GeometryError(
            f"{what}: no initial values from {len(plan)} points known in plan and {len(heights)} in height",
            remedy="give two points with X and Y and one with Z",
        )
    if two_points:
        turn, scale, shift = _by_two_points(level[plan], datum.xyz_m[plan])
    else:
        z = level[plan, 0] + 1j * level[plan, 1]
        Z = datum.xyz_m[plan, 0] + 1j * datum.xyz_m[plan, 1]
        dz, dZ = z - z.mean(), Z - Z.mean()
        a = (dZ * dz.conj()).sum() / (abs(dz) ** 2).sum()
        scale, cos, sin = abs(a), a.real / abs(a), a.imag / abs(a)
        turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        shift = Z.mean() - a * z.mean()
    height = float(np.mean(datum.xyz_m[heights, 2] - scale * level[heights, 2]))
    return Similarity(np.array([shift.real, shift.imag, height]), float(scale), turn @ rotation)


def _by_two_points(level: Float, xyz_m: Float) -> tuple[Float, float, complex]:
    """Rotation about Z, scale and shift in plan from a levelled component to the ground, by its two farthest points.

    By way of tp, which is the levelled component: the ground goes to tp, and back.
    """
    first = int(np.argmax(np.linalg.norm((xyz_m - xyz_m.mean(axis=0))[:, :2], axis=1)))
    second = int(np.argmax(np.linalg.norm((xyz_m - xyz_m[first])[:, :2], axis=1)))
    ends = [first, second]
    north_east = np.column_stack([xyz_m[ends, 1], xyz_m[ends, 0], np.zeros(2)])
    tp = two_point_frame(level[ends] * np.array([1.0, 1.0, 0.0]), north_east)
    corner = tp.to_ground(np.array([[0.0, 0, 0], [1.0, 0, 0]]))[:, [1, 0]]  # east, north of the origin and of X
    along = corner[1] - corner[0]
    scale = float(np.hypot(*along))
    cos, sin = along / scale
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return turn, scale, complex(*corner[0])
