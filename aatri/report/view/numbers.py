"""Numbers as the report prints them. The unit of a metric is the end of its name: `_m`, `_um`, `_rad` ..."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import datetime, timedelta
from math import floor, log10
from typing import Any

from aatri.units import ANGLE_RAD

DASH = "–"

NOUNS = {"control": "control point", "check": "check point", "model_tie": "model point", "zenith": "zenith angle"}
"""What one observation of a kind is called, where that is not the name of the kind."""


@dataclass(frozen=True)
class AngleUnits:
    """In what angles are told: those of orientations, and small ones as standard deviations."""

    angle: str
    small: str
    per_rad: float
    small_per_rad: float


ANGLES = {
    "deg": AngleUnits("deg", "″", 1 / ANGLE_RAD["deg"], 1 / ANGLE_RAD["arcsec"]),
    "gon": AngleUnits("gon", "mgon", 1 / ANGLE_RAD["gon"], 1 / ANGLE_RAD["mgon"]),
}
angle_units: ContextVar[AngleUnits] = ContextVar("angle_units", default=ANGLES["deg"])
"""Of the page that is being written."""


@contextmanager
def angles_in(unit: str) -> Iterator[None]:
    """Tell angles in deg or gon meanwhile."""
    token = angle_units.set(ANGLES[unit])
    try:
        yield
    finally:
        angle_units.reset(token)


def small_angle(value_rad: float) -> str:
    """A small angle to three digits, whole from a thousand on."""
    units = angle_units.get()
    value = value_rad * units.small_per_rad
    return f"{value:{'.0f' if abs(value) >= 1000 else '.3g'}}{'' if units.small == '″' else ' '}{units.small}"


def in_trade_unit(unit: str) -> tuple[float, str]:
    """The unit in which residuals and errors are told, and the factor to it: um, mm, arcseconds or mgon, ppm."""
    units = angle_units.get()
    smaller = {"mm": (1e3, "um"), "m": (1e3, "mm"), "rad": (units.small_per_rad, units.small), "1": (1e6, "ppm")}
    return smaller.get(unit, (1.0, unit))


def number(value: Any) -> str:
    """A value for reading: integers with thin separators, floats to four digits, a dash for what is not determined."""
    if value is None or (isinstance(value, float) and value != value):
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}".replace(",", "\u202f")
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, (list, tuple)):
        return ", ".join(number(item) for item in value) or DASH
    return str(value)


def spoken(kind: str) -> str:
    """One observation of a kind, or a role of a stage, in words: `image point`."""
    return NOUNS.get(kind, kind.replace("_", " "))


def counted(n: int, kind: str) -> str:
    """So many observations of a kind: `1 control point`, `190 image points`."""
    return f"{number(n)} {spoken(kind)}{'' if n == 1 else 's'}"


def moment(written: str) -> str:
    """A time as it is written in files, to the minute: `2026-11-23 23:43 UTC`."""
    try:
        time = datetime.fromisoformat(written)
    except ValueError:
        return written
    return f"{time:%Y-%m-%d %H:%M}{' UTC' if time.utcoffset() == timedelta(0) else ''}"


def metres(value: float | None, missing: str = DASH) -> str:
    """A length in metres: to 0.1 mm, and to two digits where that is too coarse."""
    if value is None or value != value:
        return missing
    return f"{value:.4f}" if value == 0 or abs(value) >= 0.0005 else f"{value:.1e}"


def together(values_m: Iterable[float]) -> str:
    """Sizes of lengths in the unit that suits the largest, to three digits of it: `14, 12 and 33 mm`."""
    texts, unit = alike([abs(value) for value in values_m])
    return f"{' and '.join([', '.join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)} {unit}"


def alike(lengths_m: Iterable[float]) -> tuple[list[str], str]:
    """Lengths as numbers in the unit that suits the largest, to three digits of it, and that unit."""
    lengths = list(lengths_m)
    largest = max((abs(value) for value in lengths if value == value), default=0.0)
    factor, unit = next(((f, u) for f, u in ((1.0, "m"), (1e3, "mm")) if largest * f >= 1.0), (1e6, "um"))
    return [digits(decimals(largest * factor, 3) if largest else 0)(value * factor) for value in lengths], unit


def digits(count: int) -> Callable[[float], str]:
    """A function that writes numbers with so many digits after the point."""
    return lambda value: DASH if value != value else f"{round(value, count) + 0.0:.{count}f}"  # no -0


def decimals(size: float, significant: int = 2) -> int:
    """Digits after the point that show a size with so many significant ones: of a standard deviation, two."""
    if not size > 0 or size == float("inf"):
        return 3
    return min(max(significant - 1 - floor(log10(size)), 0), 9)


def seconds(value: float | None) -> str:
    """A duration."""
    if value is None:
        return DASH
    return f"{value:.2f} s" if value < 60 else f"{int(value // 60)} min {value % 60:.0f} s"
