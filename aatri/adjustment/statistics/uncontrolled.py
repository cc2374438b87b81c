"""Directions of observations that nothing controls: where a gross error changes no residual at all.

The residual cofactor of a whitened record, R = I - J Q J' (J whitened), has redundancy numbers on its diagonal, axis by
axis. Its smallest eigenvalue is the redundancy number of the direction that the others control least,

    R d = r_min d,    |d| = 1,        in units of the observation  L^-1 d,   L the whitener.

A point of two rays has one redundant observation for both: R of each ray has rank one, and an error along d (x, where
the base is parallel to x) moves the point and shows nowhere, even where neither axis has the redundancy number 0.

Source: Baarda 1968; Foerstner 1983 (whole observations instead of single coordinates).
"""

import numpy as np

from aatri.arrays import Bool, Float, Int

BELOW = 0.01
"""Redundancy number below which no gross error can be seen: one of 41 standard deviations is found in 80 %."""


def uncontrolled_directions(
    redundancy: Float, observed: Bool, whitener: Float, below: float = BELOW
) -> tuple[Int, Float, Float]:
    """Records with a direction that is not controlled.

    Parameters
    ----------
    redundancy : (n, m, m) float64
        I - J Q J' of whitened records; NaN where not known.
    observed : (n, m) bool
        Components that are observed.
    whitener : (n, m) or (n, m, m) float64
    below : float

    Returns
    -------
    rows : (k,) int64
        Of such records.
    least : (k,) float64
        Redundancy number in that direction.
    direction : (k, m) float64
        The direction, of length 1 in units of the observation, its largest component positive; zero where not observed.
    """
    known = np.asarray(observed.any(axis=1) & np.isfinite(redundancy).all(axis=(1, 2)))
    candidates = np.flatnonzero(known)
    candidates = candidates[_may_be_below(redundancy[candidates], observed[candidates], below)]
    m, used = redundancy.shape[1], observed[candidates]
    both = used[:, :, None] & used[:, None, :]
    R = np.where(both, redundancy[candidates], np.eye(m))
    values, vectors = np.linalg.eigh(0.5 * (R + R.swapaxes(1, 2)))
    found = values[:, 0] < below
    rows = candidates[found]
    direction = np.where(observed[rows], vectors[found, :, 0], 0.0)
    direction = _in_units(direction, whitener[rows], observed[rows])
    length = np.linalg.norm(direction, axis=1)
    largest = np.take_along_axis(direction, np.abs(direction).argmax(axis=1)[:, None], axis=1)[:, 0]
    return rows, values[found, 0], direction / (np.where(largest < 0, -1.0, 1.0) * length)[:, None]


def _may_be_below(R: Float, observed: Bool, below: float) -> Bool:
    """A cheap bound for the many records that are well controlled: of two components (a - t)(b - t) > c^2."""
    if R.shape[1] != 2 or not observed.all():
        return np.ones(len(R), dtype=bool)
    a, b, c = R[:, 0, 0] - below, R[:, 1, 1] - below, 0.5 * (R[:, 0, 1] + R[:, 1, 0])
    return np.asarray(~((a > 0) & (b > 0) & (a * b > c * c)))


def _in_units(direction: Float, whitener: Float, observed: Bool) -> Float:
    if whitener.ndim == 2:
        return np.asarray(direction / np.where(observed, whitener, 1.0))
    m = whitener.shape[1]
    both = observed[:, :, None] & observed[:, None, :]
    return np.asarray(np.linalg.solve(np.where(both, whitener, np.eye(m)), direction[:, :, None])[:, :, 0])
