"""Swapped numbers: two image points of an image, two points of control, two positions that fit each other's place.

Two image points a, b of one image are swapped if each is where the block expects the other,

    p_a = x_a + v_a,    |p_a - x_b|, |p_b - x_a| within the limit of their standard deviations.

A point of two rays alone predicts nothing once both are left out: then the ray of the other image tells, which must
meet the exchanged one. The standardised parallax of rays d1, d2 over the base b is t / sigma_t, t = b . (d1 x d2). Two
control points, or observed positions of two images, a, b are swapped if the block finds a at the coordinates of b, and
b at those of a.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.statistics.exchanged import exchanged_pairs
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.blunders.limits import MOST_IN_AN_IMAGE
from aatri.orientation.bundle.result import BundleResult


@dataclass(frozen=True)
class Swap:
    """Two observations with each other's number: place of their observations, rows."""

    place: int
    first: int
    second: int


def swaps(result: BundleResult, rays: ImagePointRows | None, rejected: tuple[Bool, ...], limit: float) -> list[Swap]:
    """Swapped numbers among what was rejected.

    Parameters
    ----------
    rays : ImagePointRows, optional
        The image points.
    rejected : tuple of (n,) bool
        Rejected, kind by kind.
    limit : float
        In standard deviations.
    """
    pairs: list[Swap] = []
    for i, o in enumerate(result.observations):
        groups = {group for group, _ in o.observed.records.touches}
        if not rejected[i].any():
            continue
        if rays is not None and are_image_points(o.observed, rays):
            pairs += [Swap(i, a, b) for a, b in _of_rays(result, o, rays, rejected[i], limit)]
        elif groups in ({POINT}, {POSE}) and o.observed.records.rows == 3:
            pairs += [Swap(i, a, b) for a, b in _of_coordinates(result, o, rejected[i], limit)]
    return pairs


def are_image_points(observed: Observed, rays: ImagePointRows) -> bool:
    """Whether these are the image points themselves."""
    return {POSE, POINT} <= {group for group, _ in observed.records.touches} and len(observed) == len(rays.image)


def _of_rays(
    result: BundleResult, o: AdjustedObservations, rays: ImagePointRows, rejected: Bool, limit: float
) -> Iterator[tuple[int, int]]:
    rows = np.flatnonzero(rejected & result.image_adjusted[rays.image])
    expected, sigma = _expected(result, o, rays, rows)
    index_of = {int(r): k for k, r in enumerate(rows)}
    rows_by_point: dict[int, list[int]] = {}
    for r in rows.tolist():
        rows_by_point.setdefault(int(rays.point[r]), []).append(r)

    def fits(a: int, b: int) -> bool:
        """The point of a is where b was measured, as far as the other rays of a's point can tell."""
        k = index_of[a]
        if np.isfinite(expected[k]).all():
            s = np.sqrt(sigma[k] ** 2 + rays.sigma_mm[b] ** 2)
            return bool((np.abs(expected[k] - rays.xy_mm[b]) <= limit * s).all())
        other_rows = [r for r in rows_by_point[int(rays.point[a])] if r != a]
        return bool(other_rows) and all(abs(_parallax(result, rays, b, r)) <= limit for r in other_rows)

    order = np.argsort(rays.image[rows], kind="stable")
    for image_rows in np.split(rows[order], np.flatnonzero(np.diff(rays.image[rows][order])) + 1):
        exchanged: set[int] = set()
        for a, b in combinations(image_rows.tolist(), 2) if len(image_rows) <= MOST_IN_AN_IMAGE else ():
            if a not in exchanged and b not in exchanged and fits(a, b) and fits(b, a):
                exchanged |= {a, b}
                yield a, b


def _expected(result: BundleResult, o: AdjustedObservations, rays: ImagePointRows, rows: Int) -> tuple[Float, Float]:
    """Where the block expects rejected image points, and standard deviations, (k, 2) mm; NaN where it does not."""
    records, state = o.observed.records, result.adjusted.state
    place, sigma = np.full((len(rows), 2), np.nan), np.full((len(rows), 2), np.nan)
    has_covariance = np.isfinite(o.covariance[rows]).all(axis=(1, 2)) & np.isin(rows, o.rows)
    predicted = rows[has_covariance]
    if len(predicted):
        place[has_covariance] = rays.xy_mm[predicted] + records.evaluate(state, predicted)[0]
        sigma[has_covariance] = records.sigmas()[predicted] * np.sqrt(np.einsum("nii->ni", o.covariance[predicted]))
    return place, sigma


def _parallax(result: BundleResult, rays: ImagePointRows, a: int, b: int) -> float:
    """Standardised parallax of two rays of different images."""
    base = result.poses.position_m[rays.image[b]] - result.poses.position_m[rays.image[a]]
    R = [result.poses.ground_from_image[rays.image[r]] for r in (a, b)]
    d = [R[k] @ np.array([*rays.xy_mm[r], -rays.c_mm[r]]) for k, r in enumerate((a, b))]
    by = [*(base @ np.cross(R[0][:, c], d[1]) for c in (0, 1)), *(base @ np.cross(d[0], R[1][:, c]) for c in (0, 1))]
    sigma = np.linalg.norm(np.array(by) * np.concatenate([rays.sigma_mm[a], rays.sigma_mm[b]]))
    return float(base @ np.cross(d[0], d[1]) / sigma) if sigma > 0 else float("inf")


def exchanged_coordinates(
    observed: tuple[Observed, ...], suspected_by_kind: tuple[Bool, ...], state: State, points_m: Float
) -> list[Bool]:
    """Given coordinates that are exchanged beyond doubt: each is where the other should be.

    Parameters
    ----------
    suspected_by_kind : tuple of (n,) bool
        Suspected, kind by kind.
    state : mapping
        Of an adjustment.
    points_m : (n_points, 3) float64, m
        Points where their rays see them, reduced.
    """
    exchanged_by_kind = [np.zeros_like(suspected) for suspected in suspected_by_kind]
    for o, suspected, exchanged in zip(observed, suspected_by_kind, exchanged_by_kind):
        if [group for group, _ in o.records.touches] != [POINT] or o.records.rows != 3:
            continue
        rows = np.flatnonzero(suspected & o.records.observed_components().all(axis=1))
        point = dict(o.records.touches)[POINT][rows]
        observed_m, intersected_m = state[POINT][point] - o.records.evaluate(state, rows)[0], points_m[point]
        for pair in exchanged_pairs(intersected_m, observed_m, range(len(rows))):
            exchanged[rows[[pair.first, pair.second]]] = True
    return exchanged_by_kind


def _of_coordinates(
    result: BundleResult, o: AdjustedObservations, rejected: Bool, limit: float
) -> Iterator[tuple[int, int]]:
    records, state = o.observed.records, result.adjusted.state
    rows = np.flatnonzero(rejected & np.isin(np.arange(len(rejected)), o.rows))
    rows = rows[np.isfinite(o.covariance[rows]).all(axis=(1, 2))]
    between_two = any(
        group in (POINT, POSE) for group, _ in records.touches[1:]
    )  # differences have no place of their own
    if len(rows) < 2 or between_two:
        return
    used = records.observed_components()[rows]
    group, block = records.touches[0]
    if group == POSE:
        rows, used = rows[used.all(axis=1)], used[used.all(axis=1)]
    v, (by_block, *_) = records.evaluate(state, rows)
    adjusted_m = state[POINT][block[rows]] if group == POINT else state[POSE].position_m[block[rows]]
    observed_m = adjusted_m - (v if group == POINT else np.linalg.solve(by_block[:, :, :3], v[:, :, None])[:, :, 0])
    sigma = np.nan_to_num(records.sigmas()[rows])
    spread = sigma * np.sqrt(1.0 + np.einsum("nii->ni", o.covariance[rows]))
    for a, b in combinations(range(len(rows)), 2):
        common = used[a] & used[b]
        s = np.sqrt(spread[a] ** 2 + spread[b] ** 2)
        far = np.abs(observed_m[a] - observed_m[b])[common] > limit * s[common]
        near = [np.abs(adjusted_m[k] - observed_m[m])[common] <= limit * s[common] for k, m in ((a, b), (b, a))]
        if common.any() and far.any() and near[0].all() and near[1].all():
            yield int(rows[a]), int(rows[b])
