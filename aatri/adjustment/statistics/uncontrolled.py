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


def uncontrolled_directions(redundancy: Float, observed: Bool, whitener: Float) -> tuple[Int, Float, Float]:
    """Records with a direction that is not controlled.

    Parameters
    ----------
    redundancy : (n, m, m) float64
        I - J Q J' of whitened records; NaN where not known.
    observed : (n, m) bool
        Components that are observed.
    whitener : (n, m) or (n, m, m) float64

    Returns
    -------
    rows : (k,) int64
        Of such records.
    least : (k,) float64
        Redundancy number in that direction.
    direction : (k, m) float64
        The direction, of length 1 in units of the observation, its largest component positive; zero where not observed.
    """
    complete = np.asarray(observed.any(axis=1) & np.isfinite(redundancy).all(axis=(1, 2)))
    candidates = np.flatnonzero(complete)
    used = observed[candidates]
    R = np.where(used[:, :, None] & used[:, None, :], redundancy[candidates], np.eye(redundancy.shape[1]))
    R = 0.5 * (R + R.swapaxes(1, 2))
    doubtful = ~(_least_bound(R) > BELOW)
    candidates = candidates[doubtful]
    values, vectors = np.linalg.eigh(R[doubtful])
    open_direction = values[:, 0] < BELOW
    rows = candidates[open_direction]
    direction = np.where(observed[rows], vectors[open_direction, :, 0], 0.0)
    direction = _in_units(direction, whitener[rows], observed[rows])
    length = np.linalg.norm(direction, axis=1)
    largest = np.take_along_axis(direction, np.abs(direction).argmax(axis=1)[:, None], axis=1)[:, 0]
    return rows, values[open_direction, 0], direction / (np.where(largest < 0, -1.0, 1.0) * length)[:, None]


def _least_bound(R: Float) -> Float:
    """The smallest eigenvalue of matrices without negative ones is at least det ((m - 1) / trace)^(m - 1).

    That is enough for the many records that are well controlled.
    """
    m, trace = R.shape[1], np.einsum("nii->n", R)
    det = R[:, 0, 0] * R[:, 1, 1] - R[:, 0, 1] ** 2 if m == 2 else np.linalg.det(R)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(det * ((m - 1) / trace) ** (m - 1))


def _in_units(direction: Float, whitener: Float, observed: Bool) -> Float:
    if whitener.ndim == 2:
        return np.asarray(direction / np.where(observed, whitener, 1.0))
    m = whitener.shape[1]
    both = observed[:, :, None] & observed[:, None, :]
    return np.asarray(np.linalg.solve(np.where(both, whitener, np.eye(m)), direction[:, :, None])[:, :, 0])
