"""Adjusted observations as tables: residuals, tests, suspects, what nothing controls, variance components.

Every kind of observation and every stage that adjusts gets them in the same way.
"""

from collections.abc import Sequence

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.covariance.gains import Gains
from aatri.adjustment.statistics.reliability import Reliability, independent_reliability, moved, reliability
from aatri.adjustment.statistics.variance_components import GroupSigmas
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import VarianceComponents
from aatri.artifacts.suspects import Suspects, Uncontrolled
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
