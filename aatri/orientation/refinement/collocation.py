"""A-posteriori compensation of systematic image errors: least-squares collocation of image residuals on the plate.

After an adjustment the residuals of all images of one camera (or session) are laid over each other. What they have in
common at a place of the image is signal, the rest noise:

    v(x, y) = s(x, y) + n,    Cov(s, s') = C(d),  d distance on the plate, C the same in x and y, x and y independent
    C(d) = C0 exp(-d/L)       or C0 exp(-(d/L)^2)

    s^ = c' (C + D)^-1 v,     variance of its error  C0 - c' (C + D)^-1 c

v is residual = adjusted minus observed, so the predicted signal is the correction to *add* to the measurement. C0 and L
are fitted to the empirical covariances, means of products v v' by classes of distance. Many residuals are gathered in
cells (weighted means, noise variance divided by their weight): the matrix has the size of the cells, not of the points.

Residuals hold only the part of the image errors that the adjustment did not take up in orientations and points, so that
one pass corrects that part; adjust again and repeat, or let self-calibration take the smooth part first. Gross errors
must be out before: they are noise to no covariance function.

Source: Kraus & Mikhail 1972, Linear least-squares interpolation; Moritz 1972; Masson d'Autume 1972 for residuals of
aerial triangulation.
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from aatri.arrays import Bool, Float, Int
from aatri.errors import SpecError
from aatri.orientation.refinement.limits import FEWEST_CELLS
from aatri.orientation.refinement.residual_covariance import (
    MODELS,
    CovarianceFunction,
    empirical_covariance,
    fit_covariance,
    gathered,
)

NUGGET = 1e-9
"""Share of C0 added to the diagonal: a Gaussian covariance matrix of near points is singular to rounding."""


@dataclass(frozen=True)
class Collocation:
    """Signal on the plate of one camera or session, ready to be predicted anywhere."""

    function: CovarianceFunction | None
    """None if the residuals have no correlated part: nothing is corrected."""
    cells_mm: Float
    """(m, 2), mm. Mean place of the residuals of each cell."""
    factor: Float
    """(m, m). Cholesky factor of C + D, lower."""
    weights: Float
    """(m, 2). (C + D)^-1 v."""


def collocate(
    xy_mm: Float,
    residual_mm: Float,
    *,
    model: str = "best",
    cells_per_side: int = 20,
    function: CovarianceFunction | None = None,
) -> Collocation:
    """Estimate the common signal of the residuals of one camera or session.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm
        Measured image points of all its images, from the principal point.
    residual_mm : (n, 2) float64, mm
        Adjusted minus observed, gross errors left out.
    model : str
        exponential, gaussian or best: the one that fits better.
    cells_per_side : int
        Cells along the longer side of the occupied area; the matrix has at most their square.
    function : CovarianceFunction, optional
        Known covariance function, not fitted then.

    Raises
    ------
    SpecError
        If the model is unknown or there are no residuals.
    """
    if model not in (*MODELS, "best"):
        raise SpecError(f"covariance model {model!r} is unknown", remedy=f"one of best, {', '.join(MODELS)}")
    if not len(xy_mm):
        raise SpecError("collocation of no residuals", remedy="give a camera or session with active image points")
    cells = gathered(xy_mm, residual_mm, cells_per_side)
    if function is None and len(cells.weight) >= FEWEST_CELLS:
        function = fit_covariance(empirical_covariance(cells, float((residual_mm**2).mean())), model)
    if function is None:
        empty = np.zeros((0, 2))
        return Collocation(None, empty, np.zeros((0, 0)), empty)
    C = function(_distances(cells.xy_mm, cells.xy_mm))
    noise = function.noise_mm2 / cells.weight + NUGGET * function.variance_mm2
    factor = linalg.cholesky(C + np.diag(noise), lower=True)
    weights = linalg.cho_solve((factor, True), cells.mean_mm)
    return Collocation(function, cells.xy_mm, factor, np.asarray(weights))


def predict(collocation: Collocation, xy_mm: Float) -> tuple[Float, Float]:
    """Correction to add to measurements, and the standard deviation of what stays uncorrected.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm

    Returns
    -------
    correction_mm : (n, 2) float64, mm
    sigma_mm : (n,) float64, mm
        Of the remaining signal, each coordinate; zero where there is no signal.
    """
    function = collocation.function
    correction, variance = np.zeros((len(xy_mm), 2)), np.zeros(len(xy_mm))
    if function is None:
        return correction, variance
    for first in range(0, len(xy_mm), 4096):
        part = slice(first, first + 4096)
        c = function(_distances(xy_mm[part], collocation.cells_mm))
        correction[part] = c @ collocation.weights
        reduced = linalg.solve_triangular(collocation.factor, c.T, lower=True)
        variance[part] = function.variance_mm2 - (reduced**2).sum(axis=0)
    return correction, np.sqrt(np.maximum(variance, 0.0))


def collocate_groups(
    group: Int,
    xy_mm: Float,
    residual_mm: Float,
    active: Bool,
    *,
    model: str = "best",
    cells_per_side: int = 20,
) -> tuple[Float, Float, dict[int, Collocation]]:
    """Collocation by camera or session: corrections of all image points, also of those set aside.

    Parameters
    ----------
    group : (n,) int
        Camera or session of each image point.
    active : (n,) bool
        False for residuals that must not take part: gross errors.

    Returns
    -------
    correction_mm : (n, 2) float64, mm
    sigma_mm : (n,) float64, mm
    dict of int to Collocation
        Of the groups with active residuals, ascending.
    """
    correction, sigma = np.zeros_like(xy_mm), np.zeros(len(xy_mm))
    of_group: dict[int, Collocation] = {}
    for number in np.unique(group):
        rows = np.flatnonzero(group == number)
        used = rows[active[rows]]
        if not len(used):
            continue
        one = collocate(xy_mm[used], residual_mm[used], model=model, cells_per_side=cells_per_side)
        correction[rows], sigma[rows] = predict(one, xy_mm[rows])
        of_group[int(number)] = one
    return correction, sigma, of_group


def _distances(a: Float, b: Float) -> Float:
    return np.asarray(np.sqrt(((a[:, None, :] - b[None, :, :]) ** 2).sum(axis=2)))
