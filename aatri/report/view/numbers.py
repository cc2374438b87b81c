"""Numbers as the report prints them. The unit of a metric is the end of its name: `_m`, `_um`, `_rad` ..."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import datetime, timedelta
from math import floor, log10
from typing import Any

from aatri.units import ANGLE_RAD, DASH, decimals, digits

SMALL = 1e-4
"""Standard deviations below are written with a power of ten, and so are values below 1 that have them."""

NOUNS = {
    "control": "control point",
    "check": "check point",
    "model_tie": "model point",
    "zenith": "zenith angle",
    "film_prior": "film correction",
}
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
    """A small angle to three digits, whole from a thousand on; beyond a degree in deg or gon."""
    units = angle_units.get()
    if abs(value_rad) > ANGLE_RAD["deg"]:
        return f"{value_rad * units.per_rad:.3g} {units.angle}"
    value = value_rad * units.small_per_rad
    return f"{value:{'.0f' if abs(value) >= 1000 else '.3g'}}{'' if units.small == '″' else ' '}{units.small}"


def in_trade_unit(unit: str) -> tuple[float, str]:
    """The unit in which residuals and errors are told, and the factor to it: um, mm, arcseconds or mgon, ppm."""
    units = angle_units.get()
    smaller = {"mm": (1e3, "um"), "m": (1e3, "mm"), "rad": (units.small_per_rad, units.small), "1": (1e6, "ppm")}
    return smaller.get(unit, (1.0, unit))


def estimate(value: float, sigma: float, unit: str) -> tuple[str, str, str]:
    """A value, its standard deviation and their unit of the trade, written to two digits of the standard deviation.

    Angles beyond a degree, as orientations of sets of directions, are told in degrees or gon.
    """
    units, factor = angle_units.get(), 1.0
    if unit == "rad" and abs(value) > ANGLE_RAD["deg"]:
        factor, unit = units.per_rad, units.angle
    else:
        factor, unit = in_trade_unit(unit)
    value, sigma = factor * value, factor * sigma
    if not sigma > 0:
        return f"{value:.6g}", number(sigma), unit
    return rounded(value, sigma), rounded(sigma, sigma), unit


def rounded(value: float, sigma: float) -> str:
    """A value to two digits of its standard deviation, from 1 on with fixed decimals."""
    if sigma < SMALL and abs(value) < 1:
        places = max(floor(log10(abs(value))) - floor(log10(sigma)) + 1, 0) if value else 0
        return f"{value:.{places}e}"
    return digits(decimals(sigma))(value)


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


def seconds(value: float | None) -> str:
    """A duration."""
    if value is None:
        return DASH
    return f"{value:.2f} s" if value < 60 else f"{int(value // 60)} min {value % 60:.0f} s"
