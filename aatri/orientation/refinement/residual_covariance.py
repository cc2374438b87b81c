"""Covariance of image residuals as a function of their distance on the plate: empirical, and fitted.

Residuals v of all images of one camera are gathered in square cells of the plate. Products v v' of different residuals,
averaged over the pairs of cells of a class of distance (and over x and y), estimate the covariance of what they have in
common; the first class is that of different residuals within one cell. To the classes a function

    C(d) = C0 exp(-d/L)    or    C0 exp(-(d/L)^2)

is fitted by least squares, L by search, C0 in closed form. Without common signal the covariance of a class of N
products in x and N in y has the variance s^4 / (2 N); a C0 below `CLEAR_SIGMAS` of its standard deviations is no
signal.

Source: Kraus & Mikhail 1972, Linear least-squares interpolation; Moritz 1980, Advanced Physical Geodesy.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from aatri.adjustment.statistics.limits import CLEAR_SIGMAS
from aatri.arrays import Float

MODELS: dict[str, Callable[[Float], Float]] = {
    "exponential": lambda q: np.asarray(np.exp(-q)),
    "gaussian": lambda q: np.asarray(np.exp(-(q**2))),
}
"""Correlation as a function of d/L."""


@dataclass(frozen=True)
class EmpiricalCovariance:
    """Covariances of residuals by classes of distance on the plate."""

    distance_mm: Float
    """(k,), mm. Mean distance of each class."""
    covariance_mm2: Float
    """(k,), mm^2."""
    weight: Float
    """(k,). Weight of the class: number of products."""
    total_mm2: float
    """Mean square of the residuals, per coordinate, mm^2."""


@dataclass(frozen=True)
class CovarianceFunction:
    """Fitted covariance function of the signal, and the noise beside it."""

    model: str
    """One of `MODELS`."""
    variance_mm2: float
    """C0, mm^2."""
    length_mm: float
    """L."""
    noise_mm2: float
    """Variance of one residual about the signal, mm^2."""

    def __call__(self, distance_mm: Float) -> Float:
        return np.asarray(self.variance_mm2 * MODELS[self.model](distance_mm / self.length_mm))


@dataclass(frozen=True)
class Cells:
    """Residuals gathered by cells of the plate."""

    xy_mm: Float
    mean_mm: Float
    """(m, 2), mm. Mean place and mean residual."""
    weight: Float
    """(m,). Number of residuals."""
    within_mm2: Float
    """(m,), mm^2. Mean product of two different residuals of the cell; NaN with one residual."""
    size_mm: float


def gathered(xy_mm: Float, residual_mm: Float, cells_per_side: int) -> Cells:
    """Gather residuals in cells, `cells_per_side` along the longer side of the area they occupy.

    Parameters
    ----------
    xy_mm, residual_mm : (n, 2) float64, mm
    """
    xy, v = xy_mm, residual_mm
    low = xy.min(axis=0)
    size = float(max((xy.max(axis=0) - low).max() / cells_per_side, 1e-9))
    column = np.minimum(((xy - low) / size).astype(np.int64), cells_per_side - 1)
    cell, inverse = np.unique(column[:, 1] * cells_per_side + column[:, 0], return_inverse=True)
    count = np.bincount(inverse, minlength=len(cell)).astype(np.float64)

    def total(values: Float) -> Float:
        return np.stack([np.bincount(inverse, values[:, k], len(cell)) for k in (0, 1)], axis=1)

    summed, squares = total(v), total(v**2)
    several = count > 1
    products = (summed**2 - squares).mean(axis=1) / np.where(several, count * (count - 1), 1.0)
    within = np.where(several, products, np.nan)
    return Cells(total(xy) / count[:, None], summed / count[:, None], count, within, size)


def empirical_covariance(cells: Cells, total_mm2: float) -> EmpiricalCovariance:
    """Covariances by classes of distance, as wide as a cell, up to half the extent of the plate.

    Parameters
    ----------
    total_mm2 : float, mm^2
        Mean square of the residuals.
    """
    several = np.isfinite(cells.within_mm2)
    pairs = (cells.weight * (cells.weight - 1) / 2)[several]
    first = float(pairs @ cells.within_mm2[several] / pairs.sum()) if several.any() else np.nan
    i, j = np.triu_indices(len(cells.weight), 1)
    d = np.linalg.norm(cells.xy_mm[i] - cells.xy_mm[j], axis=1)
    product = (cells.mean_mm[i] * cells.mean_mm[j]).mean(axis=1)
    weight = cells.weight[i] * cells.weight[j]
    near = d <= d.max(initial=0.0) / 2
    number = np.floor(d / cells.size_mm).astype(np.int64)[near]
    d, product, weight = d[near], product[near], weight[near]
    per_class = np.bincount(number, weight)
    filled = per_class > 0
    distance = np.bincount(number, weight * d)[filled] / per_class[filled]
    covariance = np.bincount(number, weight * product)[filled] / per_class[filled]
    if np.isfinite(first):
        # mean distance of two random points of a unit square is 0.5214
        distance = np.concatenate([[0.5214 * cells.size_mm], distance])
        covariance = np.concatenate([[first], covariance])
        weights = np.concatenate([[pairs.sum()], per_class[filled]])
    else:
        weights = per_class[filled]
    return EmpiricalCovariance(distance, covariance, weights, total_mm2)


def fit_covariance(empirical: EmpiricalCovariance, model: str = "best") -> CovarianceFunction | None:
    """Fit C0 and L by least squares, classes weighted with their number of products over distance.

    Returns
    -------
    CovarianceFunction or None
        None if C0 does not exceed zero significantly.
    """
    d, c = empirical.distance_mm, empirical.covariance_mm2
    # near classes decide the prediction, far ones have most of the products
    w = empirical.weight / np.maximum(d, d[d > 0].min(initial=np.inf)) ** 2 if (d > 0).any() else empirical.weight
    best: tuple[float, CovarianceFunction] | None = None
    for name in MODELS if model == "best" else (model,):
        shape = MODELS[name]

        def misfit(log_length: float, shape: Callable[[Float], Float] = shape) -> tuple[float, float]:
            f = shape(d / np.exp(log_length))
            variance = float((w * f) @ c / max((w * f) @ f, 1e-300))
            return float(w @ (c - variance * f) ** 2), variance

        grid = np.linspace(np.log(d.max() / 50), np.log(2 * d.max()), 60)
        start = int(np.argmin([misfit(g)[0] for g in grid]))
        bounds = (grid[max(start - 1, 0)], grid[min(start + 1, len(grid) - 1)])
        length = float(optimize.minimize_scalar(lambda g: misfit(g)[0], bounds=bounds, method="bounded").x)
        cost, variance = misfit(length)
        variance = min(variance, 0.99 * empirical.total_mm2)
        f = shape(d / np.exp(length))
        spread = empirical.total_mm2 * np.sqrt(((w * f) ** 2 / (2 * empirical.weight)).sum()) / float((w * f) @ f)
        if variance > CLEAR_SIGMAS * spread and (best is None or cost < best[0]):
            noise = empirical.total_mm2 - variance
            best = cost, CovarianceFunction(name, variance, float(np.exp(length)), noise)
    return None if best is None else best[1]
