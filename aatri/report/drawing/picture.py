"""A picture as data: marks in the units of its axes. The page draws it as SVG (`svg`), `aatri plot` by matplotlib."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from aatri.arrays import Float, Int

Shape = Literal["dots", "triangles", "circles", "crosses", "segments", "line", "areas", "texts"]

COLOURS = {
    "ink": "#1c2126",
    "soft": "#5a646e",
    "line": "#d5dae0",
    "blue": "#1f6feb",
    "red": "#c62828",
    "green": "#1a7f37",
    "amber": "#9a6700",
    "violet": "#7b3fbf",
    "step0": "#78cbbb",
    "step1": "#41b0c4",
    "step2": "#1d83bf",
    "step3": "#2254a3",
    "step4": "#0c2070",
}
"""Colours by name, on paper; style.css has them for dark screens too. step0 to step4 go from little to much,
by their lightness; red is for what is out of order."""

STEPS = [name for name in COLOURS if name.startswith("step")]


@dataclass(frozen=True, eq=False)
class Marks:
    """Marks of one kind."""

    shape: Shape
    """dots, triangles, circles, crosses or texts at places; segments, areas; one line."""
    xy: Float
    """In the units of the axes: (n, 2), of segments (n, 2, 2), of areas their corners (n, k, 2)."""
    colour: str
    """One of COLOURS."""
    name: str = ""
    """In the legend; empty: not there."""
    width: float = 1.2
    """px. Of lines; of dots their diameter."""
    fill: float = 0.0
    """Opacity of what an area encloses."""
    dashed: bool = False
    ids: Sequence[str] = ()
    """What each mark is, as the pointer shows it; texts are ids."""
    tells: Sequence[str] = ()
    """The figures of each mark, likewise."""
    labelled: bool = False
    """Ids are written beside the marks, as far as there is room."""
    seen_from: Sequence[Sequence[int]] = ()
    """Of points: the marks with `sees` that they are seen from."""
    sees: bool = False
    """These are the images."""


@dataclass(frozen=True, eq=False)
class Backdrop:
    """A photograph behind the marks of a plan."""

    jpeg: bytes
    low: Float
    """(2,). Its lower left corner, in the units of the axes."""
    high: Float
    """(2,). Its upper right corner, likewise."""


@dataclass(frozen=True)
class ChartAxis:
    """An axis of a chart; `names` are written at places instead of round values."""

    title: str
    low: float
    high: float
    logarithmic: bool = False
    names: dict[float, str] = field(default_factory=dict)
    grid: bool = True


@dataclass(frozen=True)
class Picture:
    """A picture; without axes a plan: both coordinates to one scale, the second upwards."""

    name: str
    """By which `aatri plot` knows it."""
    title: str
    """What it is."""
    caption: str
    """What it says, and how it is drawn."""
    marks: Sequence[Marks]
    """In the order in which they are drawn."""
    across: ChartAxis | None = None
    up: ChartAxis | None = None
    """Of a chart, as `across`; a plan has none."""
    key: tuple[float, str] | None = None
    """A vector of round length, drawn to scale: its length in the units of the plan, and what it means."""
    ground: bool = True
    """A plan is of the ground, in m: it has a bar of its scale and an arrow to the north."""
    metric: bool = True
    """Something gives the scale of the ground; else the bar is in units of the model."""
    backdrops: Sequence[Backdrop] = ()
    """Of a plan."""
    width: float = 540.0
    height: float = 240.0
    """px on the page, as `width`; the height of a plan follows from what it shows."""
    on_screen: str = ""
    """What the reader can do with it, which paper leaves out."""


def steps_of(
    values: Float, edges: Sequence[float], names: Sequence[str], rows: Int | None = None
) -> list[tuple[Int, str, str]]:
    """Rows of values by class, with colour and name of it; empty classes are left out.

    Parameters
    ----------
    values : (n,) float64
    edges : sequence of float
        Between the classes, ascending; one less than names.
    names : sequence of str
        Of the classes.
    rows : (m,) int, optional
        Of the values that are shown; by default those that are finite.
    """
    rows = np.flatnonzero(np.isfinite(values)) if rows is None else rows
    number = np.searchsorted(np.asarray(edges), values[rows], side="right")
    at = np.linspace(0, len(STEPS) - 1, max(len(names), 2)).round().astype(int)
    return [(rows[number == k], STEPS[at[k]], name) for k, name in enumerate(names) if (number == k).any()]
