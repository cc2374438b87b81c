"""Scans of film made up for tests: crosses at known places, drawn by other code than aatri's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from aatri.artifacts.block import Block, Fiducials
from aatri.artifacts.builder import block_of
from aatri.regular_file import content_of

Array = npt.NDArray[Any]
SIZE, PIXEL_MM = 1600, 0.05
MARKS = {"1": (-28.0, -28.0), "2": (28.0, -28.0), "3": (28.0, 28.0), "4": (-26.5, 28.0)}


def stroke(side: int, centre: Array, turn_deg: float, length: float = 40.0, width: float = 3.0) -> Array:
    """A cross (side, side) about a place, turned, antialiased; drawn by other code than the template."""
    fine = 20  # axis-parallel edges are drawn to a fortieth of a pixel
    at = (np.arange(side * fine) + 0.5) / fine - 0.5
    x, y = np.meshgrid(at - centre[0], at - centre[1])
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    along, across = np.abs(c * x + s * y), np.abs(-s * x + c * y)
    inside = ((along < length / 2) & (across < width / 2)) | ((across < length / 2) & (along < width / 2))
    return np.asarray(inside.reshape(side, fine, side, fine).mean(axis=(1, 3)))


def scan(turn_deg: float, noise: float, without: tuple[str, ...] = ()) -> tuple[Array, dict[str, Array]]:
    """A scan of SIZE x SIZE of 0 to 1 and where its marks are, px from the centre of the first pixel."""
    rng = np.random.default_rng(3)
    picture, places = 0.3 + gaussian_filter(rng.normal(0, 1.0, (SIZE, SIZE)), 6), {}
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    for name, (x, y) in MARKS.items():
        centre = (SIZE - 1) / 2 + np.array([c * x - s * -y, s * x + c * -y]) / PIXEL_MM + [3.3, -2.6]
        first = np.round(centre).astype(int) - 45
        window = picture[first[1] : first[1] + 91, first[0] : first[0] + 91]
        window[:] = 0.15
        if name not in without:
            window += 0.5 * gaussian_filter(stroke(91, centre - first, turn_deg), 1.0)
        places[name] = centre
    return np.clip(picture + rng.normal(0, noise / 255, picture.shape), 0, 1), places


def scanned_block(path: Path) -> Block:
    """A block of one film image, its marks not measured."""
    camera = {
        "id": "c",
        "kind": "film",
        "image_coordinates": "pixel",
        "pixel_size_mm": [[PIXEL_MM, PIXEL_MM]],
        "pixel_origin": "top-left-corner",
        "pixel_y": "down",
        "principal_distance_mm": 150.0,
        "format": [[80.0, 80.0]],
    }
    images = {"id": ["a"], "camera": "c", "path": [str(path)], "content": [content_of(str(path))]}
    marks = Fiducials.of(camera=np.zeros(4, int), id=list(MARKS), xy_mm=list(MARKS.values()))
    return block_of(name="film", cameras=camera, images=images, fiducials=marks)
