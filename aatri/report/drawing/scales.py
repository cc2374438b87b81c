"""Scales of pictures: round numbers, thinning, plans with equal scales, linear and logarithmic axes."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool, Float, Int
from aatri.units import listed, of_model

MOST_MARKS = 20000
"""At most this many marks of one kind are drawn."""

FAR_EXTENTS = 5.0
LEAST_FOR_MAIN_PART = 5


def round_below(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above the value (> 0)."""
    power = 10.0 ** np.floor(np.log10(value) + 1e-12)
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step <= value / power * (1 + 1e-12)))


def thinned(n: int, most: int = MOST_MARKS) -> Int:
    """Evenly spaced rows, all of them if there are not too many.

    Returns
    -------
    (min(n, most),) int64
    """
    return np.arange(n) if n <= most else np.linspace(0, n - 1, most).astype(np.int64)


def near(xy_m: Float) -> Bool:
    """Points that belong to the main part: not farther from the middle 80 % than five times its extent.

    One point far off would make the rest a dot and the scale bar as long as its distance.

    Returns
    -------
    (n,) bool
    """
    if len(xy_m) < LEAST_FOR_MAIN_PART:
        return np.ones(len(xy_m), dtype=bool)
    low = np.quantile(xy_m[:, :2], 0.1, axis=0, method="higher")
    high = np.quantile(xy_m[:, :2], 0.9, axis=0, method="lower")
    reach = FAR_EXTENTS * float((high - low).max())
    return np.asarray(((xy_m[:, :2] >= low - reach) & (xy_m[:, :2] <= high + reach)).all(axis=1))


def length_text(length_m: float, metric: bool = True) -> str:
    """A length in the unit that suits it; of a block without a scale in units of the model."""
    if not metric:
        return listed(*of_model([length_m]))
    for factor, unit in ((1e3, "km"), (1.0, "m"), (1e-3, "mm"), (1e-6, "um")):
        if length_m >= 0.9999 * factor:
            return f"{length_m / factor:.3g} {unit}"
    return f"{length_m * 1e6:.2g} um"


def tick_text(value: float) -> str:
    """A tick value: plain near 1, else as a power of ten."""
    return (
        f"{value:g}"
        if value == 0 or 1e-3 <= abs(value) < 1e5
        else f"{value:.0e}".replace("e+0", "e").replace("e-0", "e-")
    )


@dataclass(frozen=True)
class GroundPlan:
    """Ground plan to pixels, equal scale in both axes, north up."""

    px_per_m: float
    west_m: float
    north_m: float
    left_px: float
    top_px: float
    width_px: float
    height_px: float

    def px(self, xy_m: Float) -> Float:
        """Pixels of ground coordinates.

        Parameters
        ----------
        xy_m : (n, 2) float64, m

        Returns
        -------
        (n, 2) float64, px
        """
        away = (xy_m[:, :2] - np.array([self.west_m, self.north_m])) * self.px_per_m
        return np.asarray(away * [1.0, -1.0] + [self.left_px, self.top_px])


def plan_of(xy_m: Float, *, width: float = 720.0, margin: float = 30.0, most_height: float = 760.0) -> GroundPlan:
    """Plan that shows all points.

    Parameters
    ----------
    xy_m : (n, 2) float64, m
    width, margin, most_height : float, px
    """
    west, south = xy_m.min(axis=0)[:2]
    east, north = xy_m.max(axis=0)[:2]
    extent = max(east - west, north - south, 1e-9)
    scale = (width - 2 * margin) / max(east - west, 0.2 * extent)
    scale = min(scale, (most_height - 2 * margin) / max(north - south, 0.2 * extent))
    left = (width - scale * (east - west)) / 2
    return GroundPlan(
        float(scale), float(west), float(north), float(left), margin, width, float(scale * (north - south) + 2 * margin)
    )


@dataclass(frozen=True)
class Scale:
    """An axis from value to pixel, linear or logarithmic."""

    low: float
    high: float
    start_px: float
    end_px: float
    logarithmic: bool = False

    def px(self, values: npt.ArrayLike) -> Float:
        """Pixels of values."""
        v, low, high = (np.asarray(x, dtype=np.float64) for x in (values, self.low, self.high))
        if self.logarithmic:
            v, low, high = np.log10(v), np.log10(low), np.log10(high)
        return np.asarray(self.start_px + (v - low) / (high - low) * (self.end_px - self.start_px))

    def ticks(self) -> list[float]:
        """Round values along the axis, about five."""
        if not self.logarithmic:
            step = round_below((self.high - self.low) / 4)
            first = np.ceil(self.low / step - 1e-9)
            return [float(k * step) + 0.0 for k in np.arange(first, self.high / step + 1e-9)]  # no -0
        first, last = np.ceil(np.log10(self.low) - 1e-9), np.floor(np.log10(self.high) + 1e-9)
        stride = max(1, int(np.ceil((last - first) / 6)))
        return [float(10.0**k) for k in np.arange(first, last + 1, stride)]


def log_scale(values: Float, start_px: float, end_px: float) -> Scale:
    """Logarithmic axis of whole decades around positive values."""
    low, high = np.floor(np.log10(values.min())), np.ceil(np.log10(values.max()))
    return Scale(float(10.0**low), float(10.0 ** max(high, low + 1)), start_px, end_px, logarithmic=True)
