"""Values of a result and how far off they are, in units of what is allowed; and what would put them right."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.geometry.rotations import log_rotation

TURN_RAD = 0.01
"""Allowed of rotations; built-in methods are off by a quarter of it at most."""

ROUNDING, SHARE_OF_SIGMA = 1e-6, 0.1
"""Allowed of what is equal but for rounding: as a share of itself; of residuals, as a share of sigma."""

NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable."""


@dataclass(frozen=True)
class Property:
    """Values of a result, and how far off values in their place would be."""

    name: str
    """As in `check.SENTENCES`."""
    where: str
    """Table and column."""
    values: Float
    """(n, ...)."""
    off: Callable[[Float], Float]
    """Values -> (n,) float64: errors over what is allowed, NaN where nothing can be said."""

    def breach(self) -> str:
        """What is wrong, and what would put it right; empty if nothing."""
        off = self.off(self.values)
        wrong = int(np.sum(off > 1))
        if not wrong:
            return ""
        cure = next((text for text, change in _CURES if self._is_put_right(change)), "")
        return f"{self.where}: {wrong} of {off.size} wrong, by up to {np.nanmax(off):.3g} times what is allowed{cure}"

    def _is_put_right(self, change: Callable[[Float], Float]) -> bool:
        off = self.off(change(self.values))
        return bool(np.isfinite(off).any() and np.nanmean(off > 1) < 0.1)


def _transposed(values: Float) -> Float:
    return np.swapaxes(values, -1, -2) if values.ndim == 3 and values.shape[1] == values.shape[2] else values


_CURES: tuple[tuple[str, Callable[[Float], Float]], ...] = (
    ("; transposed they are right", _transposed),
    ("; with the sign changed they are right", lambda values: -values),
    ("; divided by 1000 they are right", lambda values: values / 1e3),
    ("; times 1000 they are right", lambda values: values * 1e3),
)


def no_rotation(matrices: Float) -> Float:
    off = np.abs(matrices @ np.swapaxes(matrices, 1, 2) - np.eye(3)).max(axis=(1, 2), initial=0) / ROUNDING
    return np.where(np.linalg.det(matrices) < 0, np.inf, off)


def no_covariance(matrices: Float) -> Float:
    finite = matrices * 1.0
    finite[~np.isfinite(matrices).all(axis=(1, 2))] = 0.0
    variances = np.abs(np.einsum("nii->ni", finite))
    scale = np.where(variances > 0, variances, 1.0) ** 0.5
    correlations = finite / scale[:, :, None] / scale[:, None, :]
    skew = np.abs(correlations - np.swapaxes(correlations, 1, 2)).max(axis=(1, 2), initial=0)
    least = np.linalg.eigvalsh(correlations)[:, 0] if len(finite) else skew
    off: Float = np.maximum(skew, -least) / ROUNDING
    return off


def near(truth: Float, allowed: float | Float) -> Callable[[Float], Float]:
    """Distance from what is true over what is allowed of the coordinates, a number or one per row or coordinate."""
    scale = np.asarray(allowed, dtype=np.float64)
    scale = scale[:, None] if scale.ndim == 1 and truth.ndim == 2 else scale

    def off(values: Float) -> Float:
        ratios = np.abs(values - truth) / scale
        return np.fmax.reduce(ratios, axis=1) if ratios.ndim == 2 else ratios

    return off


def near_but_for_sign(truth: Float, sigma: Float) -> Callable[[Float], Float]:
    """The same where the convention of the sign is free."""
    off = near(np.abs(truth), SHARE_OF_SIGMA * sigma)
    return lambda values: off(np.abs(values))


def turned(truth: Float) -> Callable[[Float], Float]:
    """Angles from the true rotations over what is allowed."""
    return lambda values: np.linalg.norm(log_rotation(truth @ np.swapaxes(values, 1, 2)), axis=1) / TURN_RAD


def sized(size: float, factor: float) -> Callable[[Float], Float]:
    """Median of the absolute values beside the one that is to be expected: a factor."""

    def off(values: Float) -> Float:
        sizes = np.abs(values)[np.isfinite(values)]
        if not len(sizes) or not size > 0:
            return np.array([np.nan])
        with np.errstate(divide="ignore"):
            ratio: Float = np.abs(np.log([np.median(sizes) / size])) / np.log(factor)
        return ratio

    return off


def sigma_of(errors: Float) -> float:
    """Standard deviation of normal errors by the median of their absolute values."""
    finite = np.abs(errors)[np.isfinite(errors)]
    return float(np.median(finite)) / NORMAL_MEDIAN if len(finite) else np.nan
