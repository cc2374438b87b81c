"""Alignment of a solution whose datum is free: what is open of the similarity is fitted before anything is compared.

A free block says nothing of position, attitude or scale but that of its start: compared as it stands, its errors are
those of the start. The similarity X' = T + s R X is fitted to the reference by least squares, with what observations
determine of it held: coordinates of control and positions that took part must not move, distances hold the scale.

    sum |T + s R x_i - X_i|^2  +  w^2 sum (moves of what is determined)^2  ->  min

Positions of a drift group hold what their shift and drift leave. The number of open components is seven less the rank
of what is determined. Theoretical standard deviations belong to the datum of the adjustment: where the fit is over
what carries it, and only there, errors may be divided by them. Source: Kraus, Photogrammetry; Baarda 1973.
"""

from dataclasses import dataclass, replace

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import CHECK, Block
from aatri.artifacts.solution import Solution
from aatri.geometry.similarity import IDENTITY, UNKNOWNS, Similarity, closed_form, jacobian, transform, updated
from aatri.ids import rows_of
from aatri.observations.drift import group_times

HOLDING_WEIGHT = 1e4
"""Weight of what is determined against the reference, as a ratio of standard deviations."""

RANK = 1e-7
"""Singular values below this share of the largest count as zero."""

MOST_ITERATIONS = 50

SCALE_KINDS = ("distance", "relative_distance")


@dataclass(frozen=True)
class Determined:
    """What observations determine of position, attitude and scale."""

    xyz_m: Float
    """(n, 3), m. Coordinates in the solution."""
    weight: Float | None
    """(n, n). Projection that takes shift and drift of each group off; None where there are none."""
    is_determined: Bool
    """(n, 3)."""
    scale: bool

    def rows(self, move: Float) -> Float:
        """Moves of what is determined, (m, ...) of (n, 3, ...)."""
        moved = move if self.weight is None else np.einsum("ij,j...->i...", self.weight, move)
        return np.asarray(moved[self.is_determined])


@dataclass(frozen=True)
class Alignment:
    """A solution fitted to a reference within what is open of its datum."""

    solution: Solution
    components: int
    """Open ones, 0 to 7."""
    over_datum: bool
    """The fit is over what carries the datum: theoretical standard deviations hold for the differences."""


def aligned(block: Block, solution: Solution, point: Int, xyz_m: Float) -> Alignment | None:
    """The solution fitted to given coordinates; itself where its datum is given.

    Parameters
    ----------
    point : (n,) int
        Rows in points.
    xyz_m : (n, 3) float64, m
        Reference; NaN where a coordinate takes no part.

    Returns
    -------
    Alignment, or None
        None where the coordinates cannot carry what is open.
    """
    if solution.datum is None:
        return Alignment(solution, 0, True)
    determined = _determined(block, solution)
    carriers = np.isin(solution.points.id[point], solution.datum.id[solution.datum.kind == "point"])
    compared = np.isfinite(xyz_m) & np.isfinite(solution.points.xyz_m[point])
    over_datum = bool((compared.all(axis=1) & carriers).sum() == (solution.datum.kind == "point").sum() > 0)
    if over_datum:
        compared &= carriers[:, None]
    fit = _fitted(solution.points.xyz_m[point], xyz_m, compared, determined)
    if fit is None:
        return None
    similarity, components = fit
    return Alignment(_moved(solution, similarity), components, over_datum)


def aligned_to_check(block: Block, solution: Solution) -> Alignment | None:
    """The solution fitted to the check points of its block, as `aligned`."""
    ground = block.ground_points
    return aligned(block, solution, ground.point, np.where(ground.role == CHECK, ground.xyz_m, np.nan))


def in_frame_of_check(block: Block, solution: Solution) -> bool:
    """Whether check points compare with the solution as it stands: nothing is open of its datum, or there are none."""
    if not (block.ground_points.role == CHECK).any():
        return True
    alignment = aligned_to_check(block, solution)
    return alignment is not None and alignment.components == 0


def _determined(block: Block, solution: Solution) -> Determined:
    """Coordinates of control and positions that took part, from the residuals."""
    r = solution.residuals
    xyz, is_determined, groups, times = (
        [np.zeros((0, 3))],
        [np.zeros((0, 3), dtype=bool)],
        [np.zeros(0, "U1")],
        [np.zeros(0)],
    )
    control, position = r.used("control"), r.used("position")
    if len(control):
        xyz.append(solution.points.xyz_m[rows_of(r.point[control], block.points.id)])
        is_determined.append(np.isfinite(r.residual[control]))
        groups.append(np.full(len(control), ""))
        times.append(np.zeros(len(control)))
    if len(position):
        image = rows_of(r.image[position], block.images.id)
        group = np.full(len(block.images), "", dtype=block.exterior.drift_group.dtype)
        group[block.exterior.image] = block.exterior.drift_group
        xyz.append(solution.images.position_m[image])
        is_determined.append(np.isfinite(r.residual[position]))
        groups.append(group[image])
        times.append(group_times(block.images.time_s[image], block.images.sequence[image], group[image]))
    scale = any(len(r.used(kind)) for kind in SCALE_KINDS)
    weight = _without_drift(np.concatenate(groups), np.concatenate(times))
    return Determined(np.concatenate(xyz), weight, np.concatenate(is_determined), scale)


def _without_drift(group: Float, time: Float) -> Float | None:
    if not (group != "").any():
        return None
    projection = np.eye(len(group))
    for name in np.unique(group[group != ""]):
        rows_of_group = np.flatnonzero(group == name)
        basis = np.column_stack([np.ones(len(rows_of_group)), time[rows_of_group]])
        projection[np.ix_(rows_of_group, rows_of_group)] -= basis @ np.linalg.pinv(basis)
    return projection


def _fitted(x: Float, X: Float, compared: Bool, determined: Determined) -> tuple[Similarity, int] | None:
    """The similarity, with the origin of the coordinates, and how many of its components are open."""
    rows = compared.any(axis=1)
    if not rows.any():
        return None
    origin, reference = x[rows].mean(axis=0), x[rows] - x[rows].mean(axis=0)
    target = X[rows] - origin
    extent = float(np.abs(reference).max()) or 1.0
    determined_x = determined.xyz_m - origin
    J_determined = _design(IDENTITY, determined_x, determined, extent)
    open_ = UNKNOWNS - _rank(J_determined)
    if open_ == 0:
        return IDENTITY, 0
    full = compared[rows].all(axis=1)
    similarity = closed_form(reference[full], target[full]) if open_ == UNKNOWNS and full.sum() >= 3 else IDENTITY
    for _ in range(MOST_ITERATIONS):
        J = np.concatenate(
            [
                _scaled(jacobian(similarity, reference), extent)[compared[rows]],
                HOLDING_WEIGHT * _design(similarity, determined_x, determined, extent),
            ]
        )
        moves = determined.rows(transform(similarity, determined_x) - determined_x)
        of_scale = [np.log(similarity.scale) * extent] if determined.scale else []
        misfit = np.concatenate(
            [
                (transform(similarity, reference) - target)[compared[rows]],
                HOLDING_WEIGHT * np.concatenate([moves, of_scale]),
            ]
        )
        if _rank(J) < UNKNOWNS:
            return None
        step = -np.linalg.lstsq(J, misfit, rcond=None)[0]
        similarity = updated(similarity, step / _factors(extent))
        if np.abs(step).max() <= 1e-12 * extent:
            break
    shift = similarity.translation + origin - similarity.scale * similarity.rotation @ origin
    return Similarity(shift, similarity.scale, similarity.rotation), open_


def _factors(extent: float) -> Float:
    return np.array([1.0, 1.0, 1.0, extent, extent, extent, extent])


def _scaled(J: Float, extent: float) -> Float:
    return J / _factors(extent)


def _design(similarity: Similarity, x: Float, determined: Determined, extent: float) -> Float:
    """Derivatives of the moves of what is determined, in metres."""
    J = determined.rows(_scaled(jacobian(similarity, x), extent))
    if not determined.scale:
        return J
    return np.concatenate([J, np.eye(UNKNOWNS)[6:]])


def _rank(J: Float) -> int:
    if not len(J):
        return 0
    values = np.linalg.svd(J, compute_uv=False)
    return int((values > RANK * values[0]).sum())


def _moved(solution: Solution, similarity: Similarity) -> Solution:
    """Coordinates, orientations and their covariances after the similarity."""
    images, points, R = solution.images, solution.points, similarity.rotation
    turn = np.kron(np.diag([similarity.scale, 1.0]), R)
    return replace(
        solution,
        images=replace(
            images,
            position_m=transform(similarity, images.position_m),
            ground_from_image=R @ images.ground_from_image,
            covariance=turn @ images.covariance @ turn.T,
        ),
        points=replace(
            points,
            xyz_m=transform(similarity, points.xyz_m),
            covariance_m2=similarity.scale**2 * (R @ points.covariance_m2 @ R.T),
        ),
    )
