"""Numbers in text files: ASCII digits with a point and an exponent, and nothing else.

No decimal comma, thousands separator, nan, inf, underscore or full-width digit: Python's `float` takes some of them, so
it alone does not decide. A column is checked whole; only when that fails cell by cell.
"""

import math
import re
from collections.abc import Sequence

import numpy as np

from aatri.arrays import Float
from aatri.units import LARGEST, SMALLEST, beyond_range

MAX_LENGTH = 400
"""Longest text of a number: the smallest double takes some 330 digits."""

_NUMBER = re.compile(r"[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?")
_WHOLE = re.compile(r"[+-]?[0-9]+")
_DMS = re.compile(r"([+-]?)([0-9]+)[-:° ] ?([0-9]{1,2})(?:[-:' ] ?([0-9]{1,2}(?:\.[0-9]*)?)\"?|(\.[0-9]*)?'?)")
_FOREIGN = re.compile(r"[^0-9+\-.eE\n]")


def number_of(text: str) -> float:
    """The number a text holds.

    Raises
    ------
    ValueError
        If it is none by the rules above.
    """
    if len(text) > MAX_LENGTH or not _NUMBER.fullmatch(text):
        raise ValueError(what_is_wrong(text))
    value = float(text)
    if beyond := beyond_range(text, value):
        raise ValueError(beyond)
    return value


def is_number(text: str) -> bool:
    """Whether a text holds a number by the rules above."""
    try:
        number_of(text)
    except ValueError:
        return False
    return True


def whole_number_of(text: str, largest: int = 2**63 - 1) -> int:
    """The whole number a text holds: digits with a sign, no point and no exponent.

    Raises
    ------
    ValueError
        If it is none, or beyond +-`largest`.
    """
    if len(text) > MAX_LENGTH or not _WHOLE.fullmatch(text):
        raise ValueError("not a whole number")
    if abs(value := int(text)) > largest:
        raise ValueError(f"beyond {largest}")
    return value


def rad_from_dms(text: str) -> float:
    """Angle in radians of `d-m-s`, `d:m:s`, `d m s`, the same without seconds, or a plain number of degrees.

    The sign leads. Seconds may be 60, as programs that round them print.

    Raises
    ------
    ValueError
        If the text is none of these, or minutes or seconds are 60 and more.
    """
    body = " ".join(text.split())
    if len(body) > MAX_LENGTH or (angle := _DMS.fullmatch(body)) is None:
        return math.radians(number_of(body))
    sign, degrees, minutes, seconds, part = angle.groups()
    m, s = float(minutes + (part or "")), float(seconds or 0)
    if m >= 60 or s > 60:
        raise ValueError(f"{text!r} is not an angle in degrees, minutes and seconds")
    return math.radians((-1 if sign == "-" else 1) * (number_of(degrees) + m / 60 + s / 3600))


def numbers_of(cells: Sequence[str]) -> tuple[Float, list[int]]:
    """Values of a column, NaN where a cell is empty, and which cells are no numbers."""
    if not any(cells):
        return np.full(len(cells), np.nan), []
    if max(map(len, cells)) <= MAX_LENGTH and not _FOREIGN.search("\n".join(cells)):
        try:
            filled = cells if all(cells) else [cell or "nan" for cell in cells]
            values = np.fromiter(map(float, filled), dtype=np.float64, count=len(cells))
            extreme = np.flatnonzero((np.abs(values) > LARGEST) | (np.abs(values) < SMALLEST))
            if not any(beyond_range(filled[k], float(values[k])) for k in extreme.tolist()):
                return values, []
        except ValueError:
            pass
    values = np.full(len(cells), np.nan)
    bad = []
    for k, cell in enumerate(cells):
        if cell:
            try:
                values[k] = number_of(cell)
            except ValueError:
                bad.append(k)
    return values, bad


def what_is_wrong(cell: str) -> str:
    """Why a text is no number, in words."""
    if len(cell) > MAX_LENGTH:
        return f"a text of {len(cell)} characters"
    if _NUMBER.fullmatch(cell):
        return beyond_range(cell, float(cell))
    if re.fullmatch(r"[+-]?(nan|inf|infinity)", cell, re.IGNORECASE) or cell.startswith(("#", "1.#")):
        return "not a finite number"
    if any(sign in cell for sign in "\u2212\u2013\uff0d"):
        return "a minus sign that is not the ASCII one"
    if any(sign.isdigit() and not sign.isascii() for sign in cell):
        return "a digit that is not ASCII (full-width?)"
    if re.fullmatch(r"[+-]?[0-9]+,[0-9]+", cell):
        return "a decimal comma"
    if re.fullmatch(r"[+-]?[0-9]{1,3}([ _,'][0-9]{3})+(\.[0-9]*)?", cell):
        return "a thousands separator"
    degrees = _ANGLE.fullmatch(cell)
    return "not a number" if degrees is None else _as_decimal(degrees)


_ANGLE = re.compile(
    r"""([+-]?)([0-9]{1,3}(?:\.[0-9]{0,20})?)                                   # degrees
        (?:°?\s?([NSEWnsew])                                                   # with a letter, or minutes and seconds
          |[-°:\s]([0-5]?[0-9])[-'′:\s]([0-5]?[0-9](?:\.[0-9]{0,20})?)["″]?\s?([NSEWnsew])?)""",
    re.VERBOSE,
)


def _as_decimal(angle: re.Match[str]) -> str:
    """An angle as people write it, and its decimal form."""
    sign, degrees, letter, minutes, seconds, last = angle.groups()
    letter = (letter or last or "").upper()
    value = float(degrees) + float(minutes or 0) / 60 + float(seconds or 0) / 3600
    value = -value if sign == "-" or letter in ("S", "W") else value
    what = {"": "an angle", "N": "a latitude", "S": "a latitude"}.get(letter, "a longitude")
    return f"{what}, {value:.9g} degrees as a decimal"
