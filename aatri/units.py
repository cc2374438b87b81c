"""Units at the border. Inside: metres, millimetres on the image, radians, seconds.

Factors turn a value in the named unit into the inner unit: `value * ANGLE_RAD["deg"]`.
"""

import math
from collections.abc import Callable, Iterable, Sequence

ANGLE_RAD = {
    "rad": 1.0,
    "mrad": 1e-3,
    "deg": math.pi / 180.0,
    "gon": math.pi / 200.0,
    "mgon": math.pi / 200e3,
    "arcmin": math.pi / 10800.0,
    "arcsec": math.pi / 648000.0,
}
LENGTH_M = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "km": 1e3}
LENGTH_MM = {"mm": 1.0, "um": 1e-3}
TIME_S = {"s": 1.0, "ms": 1e-3}

ROUNDING_M = 1e-8
"""Lengths below are what arithmetic leaves of 0, at coordinates of some thousand kilometres."""

NEGLIGIBLE = 1e-3
"""Beside the largest of several lengths: it has no digits of its own."""

UNITS_OF_MODEL = "units of the model"
"""What lengths of a block without a scale are in."""

METRES_OF_MODEL = "m and mm"
"""Key of the fact that a report states only of a block without a scale."""

DASH = "–"
"""For what is not determined."""

EARTH_RADIUS_M = 6_371_000.0
"""Radius of the spherical earth used for the curvature correction."""


SMALLEST, LARGEST = 1e-100, 1e100
"""No quantity is larger, or smaller without being 0: squares and products of what lies between are still numbers."""

FOOT_M = 0.3048
"""The international foot."""


def beyond_range(text: str, value: float) -> str:
    """What keeps the number of a text from being a quantity; empty where nothing does."""
    if not abs(value) <= LARGEST:
        return "too large for a quantity"
    if abs(value) < SMALLEST and any(digit in "123456789" for digit in text.lower().partition("e")[0]):
        return "too small for a quantity, and not 0"
    return ""


def length(metres: float) -> str:
    """A distance for a message."""
    value, unit = (metres / 1000, "km") if metres >= 1000 else (metres, "m")
    return f"{value:,.0f} {unit}" if value >= 100 else f"{value:.3g} {unit}"


def together(values_m: Iterable[float]) -> str:
    """Sizes of lengths in the unit that suits the largest, to three digits of it: `14.3, 12.1 and 33.4 mm`.

    Examples
    --------
    >>> together([0.0143, 0.0121, 0.0334])
    '14.3, 12.1 and 33.4 mm'
    """
    return listed(*alike([abs(value) for value in values_m]))


def about(value_m: float) -> str:
    """A length to two digits, in the unit that suits it: `41 mm`.

    Examples
    --------
    >>> about(0.0412)
    '41 mm'
    """
    return listed(*alike([value_m], abs(value_m) / 10))


def listed(texts: Sequence[str], unit: str) -> str:
    """Numbers of one unit in a sentence."""
    return f"{' and '.join([', '.join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)} {unit}"


def alike(lengths_m: Iterable[float], last_m: float = 0.0) -> tuple[list[str], str]:
    """Lengths as numbers in the unit that suits the largest, and that unit.

    Parameters
    ----------
    lengths_m : iterable of float, m
    last_m : float, m
        The first digit of this length is the last one written; 0: three digits of the largest.
    """
    lengths = list(lengths_m)
    largest = max((abs(value) for value in lengths if value == value), default=0.0)
    if largest < ROUNDING_M:
        return [digits(0)(0.0 * value) for value in lengths], "mm"
    factor, unit = next(((f, u) for f, u in ((1.0, "m"), (1e3, "mm")) if largest * f >= 1.0), (1e6, "um"))
    places = decimals(last_m * factor, 1) if last_m > 0 else decimals(largest * factor, 3)
    return [digits(places)(value * factor) for value in lengths], unit


def rms_alike(lengths_m: Iterable[float], n: float) -> tuple[list[str], str]:
    """Root mean squares of n errors each, to the digit that chance leaves: s(RMS) = RMS / sqrt(2 n).

    The variance of chi-square is twice its degrees of freedom, that of its root a quarter over the mean. The digit is
    that of the largest, or the first one of the smallest if that comes later. Of n not known, 0: three of the largest.
    """
    lengths = list(lengths_m)
    sizes = [abs(value) for value in lengths if value == value]
    largest = max(sizes, default=0.0)
    smallest = min((size for size in sizes if size > NEGLIGIBLE * largest), default=0.0)
    return alike(lengths, min(largest / math.sqrt(2 * n), smallest) if n else 0.0)


def of_model(lengths: Iterable[float]) -> tuple[list[str], str]:
    """Lengths of a block without a scale, to three digits each."""
    return [DASH if value != value else f"{value:.3g}" for value in lengths], UNITS_OF_MODEL


def digits(count: int) -> Callable[[float], str]:
    """A function that writes numbers with so many digits after the point."""
    return lambda value: DASH if value != value else f"{round(value, count) + 0.0:.{count}f}"  # no -0


def decimals(size: float, significant: int = 2) -> int:
    """Digits after the point that show a size with so many significant ones: of a standard deviation, two.

    Examples
    --------
    >>> decimals(0.0234)
    3
    """
    if not size > 0 or size == float("inf"):
        return 3
    return min(max(significant - 1 - math.floor(math.log10(size)), 0), 9)
