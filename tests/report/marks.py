"""Marks of a picture read back from its SVG."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Text:
    """A line of text: where, and its anchor."""

    x: float
    y: float
    anchor: str
    text: str


def size(picture: str) -> tuple[float, float]:
    """Width and height."""
    found = re.search(r'viewBox="0 0 (\S+) (\S+)"', picture)
    assert found
    return float(found[1]), float(found[2])


def paths(picture: str, class_: str) -> list[np.ndarray]:
    """Points of every path of a class, (n, 2) each, in the order they are drawn."""
    found = re.findall(rf'<path d="([^"]*)" class="{class_}"', picture)
    return [
        np.array([[float(v) for v in pair.split()] for pair in re.findall(r"[ML]([-\d.]+ [-\d.]+)", d)]) for d in found
    ]


def texts(picture: str) -> list[Text]:
    """All text."""
    pattern = r'<text x="([-\d.]+)" y="([-\d.]+)" class="[^"]*" text-anchor="(\w+)">([^<]*)</text>'
    return [Text(float(x), float(y), anchor, text) for x, y, anchor, text in re.findall(pattern, picture)]
