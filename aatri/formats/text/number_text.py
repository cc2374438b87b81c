"""Numbers in text files: ASCII digits with a point and an exponent, and nothing else.

No decimal comma, thousands separator, nan, inf, underscore or full-width digit: Python's `float` takes some of them, so
it alone does not decide. A column is checked whole; only when that fails cell by cell.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from aatri.arrays import Float

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_FOREIGN = re.compile(r"[^0-9+\-.eE\n]")


def number_of(text: str) -> float:
    """The number a text holds.

    Raises
    ------
    ValueError
        If it is none by the rules above.
    """
    if not _NUMBER.fullmatch(text):
        raise ValueError(what_is_wrong(text))
    value = float(text)
    if not np.isfinite(value):
        raise ValueError("too large for a number")
    return value


def numbers_of(cells: Sequence[str]) -> tuple[Float, list[int]]:
    """Values of a column, NaN where a cell is empty, and which cells are no numbers."""
    if not any(cells):
        return np.full(len(cells), np.nan), []
    if not _FOREIGN.search("\n".join(cells)):
        try:
            filled = cells if all(cells) else [cell or "nan" for cell in cells]
            values = np.fromiter(map(float, filled), dtype=np.float64, count=len(cells))
            if not np.isinf(values).any():
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
    if _NUMBER.fullmatch(cell):
        return "too large for a number"
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
    return "not a number"
