"""Numbering of the images of a block of strips, as textbooks number them: across the strips, or along them.

In a regular block of N strips of n images with 60 % overlap along and 20 to 40 % across, points tie an image to the
next two of its strip and to those of the neighbouring strips. The reduced normal matrix then has the half bandwidth,
in images and with the diagonal,

    numbered across the strips   m = 2 N + 2
    numbered along the strips    m = n + 3          across is narrower if n > 2 N - 1

Images get a place along the flight, in whole bases, and one across it, that of their strip, so that small differences
of the positions do not mix the columns. Strips at more than 45 degrees to the common direction are cross strips: they
keep their own places, and widen the band.

Source: lecture notes of Wuhan University on bundle block adjustment; docs/formulas.md 4.4.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float, Int
from aatri.orientation.bundle.limits import FEWEST_OF_LINE, LEAST_TURN_DEG, LONGEST_STEP


@dataclass(frozen=True)
class StripNumbering:
    """Places of images for the numbering."""

    place: Float
    """(n, 2). Along the flight in bases, across it in metres; NaN unknown."""
    strips: int
    """Parallel strips N; 0 if there are none."""
    images: int
    """Most images n of one of them."""

    @property
    def textbook(self) -> dict[str, int]:
        """Half bandwidth of the regular block, images with the diagonal, by ordering; empty without strips."""
        if not self.strips:
            return {}
        return {"across_strips": 2 * self.strips + 2, "along_strips": self.images + 3}


def strip_numbering(position_m: Float, strip: Int, sequence: Float) -> StripNumbering:
    """Number the images of a block.

    Parameters
    ----------
    position_m : (n, 2) or (n, 3) float64, m
        Projection centres; NaN unknown.
    strip : (n,) int
        -1 none.
    sequence : (n,) float64
        Place in the strip.
    """
    xy = position_m[:, :2]
    finite = np.isfinite(xy).all(axis=1) & (strip >= 0)
    order = np.lexsort((sequence, strip))
    order = order[finite[order]]
    flown_strip, step, base_m = _steps(xy[order], strip[order])
    if not len(step):
        return StripNumbering(xy.copy(), 0, 0)
    doubled = 2 * np.arctan2(step[:, 1], step[:, 0])
    length = np.hypot(*step.T)
    direction = 0.5 * np.arctan2((length * np.sin(doubled)).sum(), (length * np.cos(doubled)).sum())
    rotated_m = xy @ np.array([[np.cos(direction), -np.sin(direction)], [np.sin(direction), np.cos(direction)]])
    parallel = flown_strip[np.cos(doubled - 2 * direction) > 0]
    place = rotated_m.copy()
    columns = rotated_m[:, 0] / base_m
    in_parallel = finite & np.isin(strip, parallel)
    phase = np.angle(np.exp(2j * np.pi * columns[in_parallel]).mean()) / (2 * np.pi)
    place[:, 0] = np.where(in_parallel, np.round(columns - phase), columns - phase)
    for k in parallel:
        place[in_parallel & (strip == k), 1] = np.median(rotated_m[in_parallel & (strip == k), 1])
    return StripNumbering(place, len(parallel), int(np.bincount(strip[in_parallel]).max()))


def flown_lines(position_m: Float, time_s: Float, sequence: Float, camera: Int) -> list[Int]:
    """Images that a camera took one after the other on a line, where no strips are declared: rows, line by line.

    By time, else by sequence, else as they come. A line ends where the next step turns from the last one by more than
    `LEAST_TURN_DEG`, or is longer than `LONGEST_STEP` median ones.

    Parameters
    ----------
    position_m : (n, 2) or (n, 3) float64, m
        Projection centres; NaN unknown.
    time_s, sequence : (n,) float64
    camera : (n,) int
        Heads that expose together have lines of their own.
    """
    placed = np.isfinite(position_m).all(axis=1)
    of_cameras = [np.flatnonzero(placed & (camera == k)) for k in np.unique(camera)]
    return [line for rows in of_cameras for line in _lines(rows, position_m, time_s, sequence)]


def _lines(placed: Int, position_m: Float, time_s: Float, sequence: Float) -> list[Int]:
    """Lines of the images of a camera whose positions are known."""
    by = next((values for values in (time_s[placed], sequence[placed]) if np.isfinite(values).all()), placed)
    order = placed[np.argsort(by, kind="stable")]
    step = np.diff(position_m[order], axis=0)
    length = np.linalg.norm(step, axis=1)
    longest, least_cosine = LONGEST_STEP * np.median(length) if len(length) else 0.0, np.cos(np.radians(LEAST_TURN_DEG))
    lines = [order[:1].tolist()]
    for k, row in enumerate(order[1:].tolist()):
        turns = len(lines[-1]) > 1 and step[k] @ step[k - 1] < least_cosine * length[k] * length[k - 1]
        if turns or length[k] > longest:
            lines.append([])
        lines[-1].append(row)
    return [np.array(line) for line in lines if len(line) >= FEWEST_OF_LINE]


def _steps(xy: Float, strip: Int) -> tuple[Int, Float, float]:
    """Strips of two images or more, from their first image to the last, and the median base."""
    following = np.flatnonzero(strip[1:] == strip[:-1])
    first = np.flatnonzero(np.append(True, strip[1:] != strip[:-1]))
    last = np.append(first[1:], len(strip)) - 1
    has_step = last > first
    base_m = float(np.median(np.hypot(*(xy[following + 1] - xy[following]).T))) if len(following) else 0.0
    if not base_m > 0:
        has_step = np.zeros_like(has_step)
    return strip[first[has_step]], xy[last[has_step]] - xy[first[has_step]], base_m
