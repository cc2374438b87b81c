"""Gross errors: which observations get one, and how large.

Each is a random direction over the coordinates observed, times a size drawn evenly between two numbers of standard
deviations.
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.errors import InputError
from aatri.ids import several
from aatri.simulation.settings import refused


def gross_errors(
    much: float, sigma: Float, size: tuple[float, float], rng: np.random.Generator, what: str
) -> tuple[Int, Float]:
    """Rows chosen and errors to add.

    Parameters
    ----------
    much : float
        A share of the rows if below 1, otherwise how many.
    sigma : (n, k) float64
        Standard deviations; 0 where a coordinate is not observed. Rows of zeros are never chosen.
    size : (float, float)
        Smallest and largest size in standard deviations.

    Returns
    -------
    rows : (m,) int64, ascending
    errors : (m, k) float64, unit of sigma

    Raises
    ------
    InputError
        If there are fewer observations than gross errors.
    """
    eligible = np.flatnonzero((sigma > 0).any(axis=1))
    count = round(much * len(eligible)) if much < 1 else int(much)
    if count > len(eligible):
        raise refused(
            f"{several(count, 'gross error')} among {len(eligible)} {what}", f"lower gross_errors.{what}", InputError
        )
    rows = np.sort(rng.choice(eligible, count, replace=False)) if count else np.zeros(0, np.int64)
    direction = rng.standard_normal((count, sigma.shape[1])) * (sigma[rows] > 0)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-300)
    return rows, rng.uniform(*size, (count, 1)) * direction * sigma[rows]
