"""What the sketches are drawn with: marks of few words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aatri.report.drawing.picture import Marks


def line(colour: str, *places: Sequence[float], name: str = "", **more: Any) -> Marks:
    return Marks("line", np.array(places, float), colour, name, **more)


def dots(colour: str, places: Any, ids: Sequence[str] = (), name: str = "", **more: Any) -> Marks:
    more = {"shape": "dots", "width": 1.6 if "shape" in more else 5.0} | more
    return Marks(
        xy=np.atleast_2d(np.array(places, float)), colour=colour, name=name, ids=ids, labelled=bool(ids), **more
    )


def segments(colour: str, starts: Any, ends: Any, name: str = "", **more: Any) -> Marks:
    ends = np.array(ends, float)
    return Marks(
        "segments", np.stack([np.broadcast_to(np.array(starts, float), ends.shape), ends], 1), colour, name, **more
    )


def area(colour: str, *corners: Sequence[float], name: str = "", fill: float = 0.12) -> Marks:
    return Marks("areas", np.array([corners], float), colour, name, fill=fill)


def rectangle(
    colour: str, x: float, y: float, width: float, height: float, name: str = "", turn_deg: float = 0.0
) -> Marks:
    turn, half = np.radians(turn_deg), np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (width / 2, height / 2)
    corners = half @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + (x, y)
    return area(colour, *corners.tolist(), name=name, fill=0.1)


def words(*said: tuple[float, float, str]) -> Marks:
    return Marks("texts", np.array([s[:2] for s in said], float), "ink", ids=[s[2] for s in said])


GROUND = np.stack([np.linspace(-1.2, 3.2, 60), 0.08 * np.sin(4 * np.linspace(-1.2, 3.2, 60))], 1)


def ground_at(x: float) -> tuple[float, float]:
    return x, 0.08 * float(np.sin(4 * x))
