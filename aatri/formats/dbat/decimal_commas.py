"""Decimal commas in lines whose cells are between commas: `1001, a, 10,5, 20, 30` reads as X 10, Y 5, Z 20, sigma 30.

Two cells of digits alone, side by side without a blank, may be one number. They are taken for two unless something
speaks against it: a blank after other commas between numbers of the line, more cells than most lines have, or that no
number of the file has a decimal point or an exponent.
"""

import re
from collections import Counter
from collections.abc import Sequence

_PAIR = re.compile(r"(?<![0-9.])[+-]?[0-9]+,[0-9]+(?![0-9.])")
WITHOUT_SIGMA = 5
"""Cells of a line `id, name, X, Y, Z`: more are standard deviations, or parts of numbers."""


def decimal_commas(lines: Sequence[str]) -> list[str]:
    """For each line the first pair of cells that may be a number with a decimal comma; empty where there is none."""
    numbers = [line.split(",", 2)[2] if line.count(",") > 1 else "" for line in lines]
    cells = [line.count(",") + 1 for line in lines]
    usual = Counter(cells).most_common(1)[0][0] if cells else 0
    with_points = any(sign in text for text in numbers for sign in ".eE")
    commas = []
    for text, count in zip(numbers, cells):
        pair = _PAIR.search(text) if count > WITHOUT_SIGMA else None
        uneven = re.search(r",\s", text) is not None
        suspect = pair is not None and (uneven or count > usual or not with_points)
        commas.append(pair.group() if pair and suspect else "")
    return commas
