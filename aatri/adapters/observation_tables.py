"""Adjusted observations as tables: residuals, tests, suspects, what nothing controls, variance components.

Every kind of observation and every stage that adjusts gets them in the same way.

What the stages before the bundle do not control: image points along the base, ties and control that nothing checks.

Two rays of a point meet wherever its error along the epipolar line puts them: the y-parallax does not see it. Only a
second model of the point does, then its scale there differs, or another strip, or control. In the image the epipolar
line has the direction in which the base carries the point X along its ray,

    d = (b_x Z - X b_z, b_y Z - Y b_z),     b and X in the frame of that image.

An error across it has the redundancy number r of its condition, shared by both image points. Image points in no model
take no part at all: their direction is NaN, and no stage before the bundle takes them off the list.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.covariance.gains import Gains
from aatri.adjustment.statistics.reliability import Reliability, independent_reliability, moved, reliability
from aatri.adjustment.statistics.variance_components import GroupSigmas
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import VarianceComponents
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE

WIDTH = 3
"""Components of a row of the tables; records with more, those of parameters, get a row for each component."""


def residual_table(adjusted: AdjustedObservations, state: State) -> Residuals:
    """Residuals of the observations that take part; those of rejected ones are predicted."""
    o, rows = adjusted.observed, adjusted.rows
    v, sigma = adjusted.residuals(state), o.sigmas()[rows]
    v = np.where(np.isfinite(sigma), v, np.nan)
    image, point = o.names(rows)
    active = adjusted.used[rows]
    if not o.components:
        return assemble.residuals(o.kind, o.row[rows], image, point, v, sigma, active, unit=o.unit)
    row, component = np.nonzero(np.isfinite(sigma))
    label = np.array(o.components, dtype=np.str_)[component]
    unit = np.array(o.units, dtype=np.str_)[component] if o.units else o.unit
    return assemble.residuals(
        o.kind,
        o.row[rows][row],
        image[row],
        label,
        v[row, component][:, None],
        sigma[row, component][:, None],
        active[row],
        unit=unit,
    )


def reliability_table(adjusted: AdjustedObservations, state: State, gains: Gains | None = None) -> Tests:
    """Reliability of the observations in the order of `residual_table`; rejected and exact ones have none.

    Tests are those of the adjustment, with the weights that it had.

    Parameters
    ----------
    gains : Gains, optional
        Of the rows that take part.
    """
    o, rows = adjusted.observed, adjusted.rows
    whitener = adjusted.records.whitener[rows]
    observed = adjusted.records.observed_components()[rows] & ~o.demanded()[rows] & adjusted.used[rows][:, None]
    v = np.where(observed, adjusted.residuals(state), 0.0)
    independent = whitener.ndim == 2
    r = independent_reliability(v, whitener, adjusted.covariance[rows]) if independent else _correlated(adjusted, v)
    effects = [_moved(gains, group, whitener, r.detectable, part) for group, part in _MOVED]
    columns = [np.where(observed, x, np.nan) for x in (r.redundancy, r.test, r.detectable, r.external, *effects)]
    if o.components:
        row, component = np.nonzero(np.isfinite(o.sigmas()[rows]))
        columns = [x[row, component][:, None] for x in columns]
    return Tests(*map(_as_wide, columns))


def _as_wide(values: Float) -> Float:
    wide = np.full((len(values), WIDTH), np.nan)
    wide[:, : values.shape[1]] = values
    return wide


_MOVED = ((POINT, slice(0, 3)), (POSE, slice(0, 3)), (POSE, slice(3, 6)))


def _moved(gains: Gains | None, group: str, whitener: Float, detectable: Float, part: slice) -> Float:
    gain = gains.of(group) if gains is not None else None
    return np.full(detectable.shape, np.nan) if gain is None else moved(gain, whitener, detectable, part)


def _correlated(adjusted: AdjustedObservations, v: Float) -> Reliability:
    """Of records with correlated components, from covariances in units of the observation."""
    records, rows = adjusted.records, adjusted.rows
    L, R = records.whitener[rows], adjusted.covariance[rows]
    used = records.observed_components()[rows]
    both: Bool = used[:, :, None] & used[:, None, :]
    back = np.linalg.inv(np.where(both, L, np.eye(records.rows)))
    return reliability(v, back @ back.swapaxes(1, 2), back @ np.where(both, R, 0.0) @ back.swapaxes(1, 2))


def suspect_table(stage: str, o: Observed, rows: Int, error: Float, test: Float, verdict: Text) -> Suspects:
    """Some observations of one kind, as a stage names them.

    Parameters
    ----------
    rows : (k,) int
    error : (k, m) float64
        Estimated gross errors in units of the observations; NaN not known.
    test : (k,) float64
        NaN without test.
    verdict : (k,) str
    """
    n, (image, point) = len(rows), o.names(rows)
    size = np.where(np.isfinite(error).any(axis=1), np.sqrt(np.nansum(error**2, axis=1)), np.nan)
    return Suspects(
        kind=np.full(n, o.kind),
        row=o.row[rows].astype(np.int32),
        image=image,
        point=point,
        stage=np.full(n, stage),
        size=size,
        unit=np.full(n, o.unit),
        sigma=np.where(test > 0, size / np.where(test > 0, test, 1.0), np.nan),
        test=test,
        verdict=verdict,
        error=_as_wide(error[:, :WIDTH]),
    )


def uncontrolled_table(
    o: Observed, rows: Int, least: Float, direction: Float, component: Text | None = None
) -> Uncontrolled:
    """Some observations of one kind that nothing controls.

    Parameters
    ----------
    rows : (k,) int
    least : (k,) float64
        Redundancy number in the direction.
    direction : (k, m) float64
        NaN: any.
    component : (k,) str, optional
        Of parameters, which of them.
    """
    image, point = o.names(rows)
    name = point if component is None else component
    return Uncontrolled(
        np.full(len(rows), o.kind), o.row[rows].astype(np.int32), image, name, least, _as_wide(direction)
    )


def variance_table(names: Sequence[str], sigmas: GroupSigmas, *, applied: bool = False) -> VarianceComponents:
    """Factors on the standard deviations of groups: proposed, or applied to the adjustment."""
    low, high = sigmas.limits
    verdict = np.where(~sigmas.estimable, "not estimable", np.where(sigmas.differs, "proposed", "fits"))
    return VarianceComponents(
        group=np.array(names, dtype=np.str_),
        observations=sigmas.count.astype(np.int32),
        redundancy=sigmas.redundancy,
        factor=sigmas.factor,
        low=low,
        high=high,
        verdict=np.where(sigmas.estimable & applied, "applied", verdict),
    )


def seen_by_one(block: Block, models: Models, rows: Int, redundancy: Float | None = None) -> Uncontrolled:
    """Both image points of model points, in the direction of the base, or across it.

    Parameters
    ----------
    rows : (n,) int
        In the model points.
    redundancy : (n,) float64, optional
        Redundancy numbers of their y-parallaxes: the direction is then across the base.
    """
    p, o = models.model_points, models.orientations
    model, point = p.model[rows], p.point[rows].astype(np.int64)
    R, b, X = o.left_from_right[model], o.base[model], p.xyz[rows]
    left = _along(b, X)
    to_right = R.swapaxes(1, 2)
    right = _along((to_right @ b[:, :, None])[:, :, 0], (to_right @ (X - b)[:, :, None])[:, :, 0])
    image = np.concatenate([o.left[model], o.right[model]]).astype(np.int64)
    direction = np.full((2 * len(rows), 3), np.nan)
    d = np.concatenate([left, right])
    direction[:, :2] = d if redundancy is None else np.stack([-d[:, 1], d[:, 0]], axis=1)
    largest = np.take_along_axis(direction, np.abs(direction[:, :2]).argmax(axis=1)[:, None], axis=1) if len(d) else 1.0
    both = np.tile(point, 2)
    table = Uncontrolled(
        kind=np.full(len(image), IMAGE_POINT),
        row=_rows_in_block(block, image, both),
        image=block.images.id[image],
        point=block.points.id[both],
        redundancy=np.zeros(len(image)) if redundancy is None else np.tile(0.5 * redundancy, 2),
        direction=direction * np.where(largest < 0, -1.0, 1.0),
    )
    return table.take(np.lexsort((image, both)))


def in_no_model(block: Block, used: Bool, in_pairs: Int) -> Uncontrolled:
    """Image points that take no part: their image shares the point with no other that makes a model with it.

    Parameters
    ----------
    used : (n_image_points,) bool
        Image points that a stage may use.
    in_pairs : (k,) int
        Rows of those that are in models.
    """
    left = used.copy()
    left[in_pairs] = False
    rows, m = np.flatnonzero(left), block.image_points
    table = unchecked(IMAGE_POINT, block.images.id[m.image[rows]], block.points.id[m.point[rows]])
    return replace(table, row=rows.astype(np.int32))


def still_in_no_model(before: Uncontrolled | None) -> Uncontrolled:
    """Those that a stage before has listed as in no model."""
    return Uncontrolled.empty() if before is None else before.take(_takes_no_part(before))


def unchecked(kind: str, image: Text, point: Text) -> Uncontrolled:
    """Observations that nothing at all checks: no direction of their own."""
    n = len(point)
    unknown = np.full((n, 3), np.nan)
    return Uncontrolled(np.full(n, kind), np.full(n, -1, dtype=np.int32), image, point, np.zeros(n), unknown)


def not_seen_since(before: Uncontrolled | None, block: Block, seen: Bool) -> Uncontrolled:
    """What an earlier stage listed of image points whose ground point nothing has seen since; those in no model stay.

    Parameters
    ----------
    seen : (n_points,) bool
        Points of several strips, or with control.
    """
    if before is None:
        return Uncontrolled.empty()
    of_images = before.take(before.kind == IMAGE_POINT)
    return of_images.take(_takes_no_part(of_images) | ~np.isin(of_images.point, block.points.id[seen]))


def _takes_no_part(table: Uncontrolled) -> Bool:
    return np.asarray((table.kind == IMAGE_POINT) & np.isnan(table.direction).all(axis=1))


def _along(b: Float, X: Float) -> Float:
    """Unit directions (n, 2) of the epipolar lines in the image."""
    d = b[:, :2] * X[:, 2:] - X[:, :2] * b[:, 2:]
    length = np.linalg.norm(d, axis=1, keepdims=True)
    return np.asarray(np.where(length > 0, d, 1.0) / np.where(length > 0, length, np.sqrt(2.0)))  # on the base: any


def _rows_in_block(block: Block, image: Int, point: Int) -> Int:
    """Rows of image points in the Block; of a point measured twice in an image the first in use."""
    m, n = block.image_points, len(block.points)
    in_block = np.zeros(n, dtype=bool)
    in_block[point] = True
    rows = np.flatnonzero(in_block[m.point] & m.active)
    if not len(rows):
        return np.full(len(image), -1, dtype=np.int32)
    key = m.image[rows].astype(np.int64) * n + m.point[rows]
    order = np.argsort(key, kind="stable")
    place = np.minimum(np.searchsorted(key[order], image * n + point), len(key) - 1)
    matches = key[order][place] == image * n + point
    return np.where(matches, rows[order][place], -1).astype(np.int32)
