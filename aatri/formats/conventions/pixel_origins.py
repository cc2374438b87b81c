"""From where programs count the coordinates of an image, and which way y goes.

A table, held against points of known place: the centre of an image, of its first pixel, of its last. Readers name a
row; what a Block needs of it are `origin` and `y` of its cameras (`aatri.camera.pixels` says what they mean).

A principal point that a program counts from elsewhere than the image centre becomes x0, y0 in millimetres, x right, y
up, by the same matrix as an image point.
"""

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.camera.pixels import mm_from_pixel

PIXEL_MM = 0.001
"""Size given to a pixel where a format knows no millimetres; c = f um."""


@dataclass(frozen=True)
class PixelAxes:
    """Where image coordinates count from, which way y goes, and in what: px, mm, normalised by max(width, height)."""

    origin: str
    y: str = "down"
    unit: Literal["px", "mm", "normalised"] = "px"

    @property
    def name(self) -> str:
        """As a text, see `named`."""
        return f"{self.origin} {self.y} {self.unit}"


def named(name: str) -> PixelAxes:
    """The axes of a `name`."""
    origin, y, unit = name.split()
    return PixelAxes(origin, y, cast(Literal["px", "mm", "normalised"], unit))


PIXEL_AXES = {
    "aatri": PixelAxes("top-left-corner"),
    "bal": PixelAxes("image-centre", "up"),
    "bingo": PixelAxes("image-centre", "up", "mm"),
    "blocksexchange": PixelAxes("top-left-centre"),
    "bundler": PixelAxes("image-centre", "up"),
    "colmap": PixelAxes("top-left-corner"),
    "dbat": PixelAxes("top-left-corner"),
    "metashape": PixelAxes("top-left-corner"),
    "micmac": PixelAxes("top-left-corner"),
    "nvm": PixelAxes("image-centre"),
    "odm_gcp": PixelAxes("top-left-centre"),  # as OpenSfM takes them: (x + 0.5 - W/2) / max(W, H)
    "opencv": PixelAxes("top-left-centre"),
    "opensfm": PixelAxes("image-centre", unit="normalised"),  # (column + 0.5 - W/2) / max(W, H)
    "opf": PixelAxes("top-left-corner"),
    "photomod": PixelAxes("bottom-left-corner", "up"),
    "pix4d": PixelAxes("top-left-corner"),
    "socet": PixelAxes("image-centre"),
}
"""Of image coordinates, by program. Sources: the manuals and samples named on the page of each format."""


def converted(
    xy: npt.ArrayLike, source: PixelAxes, target: PixelAxes, format_px: npt.ArrayLike, pixel_mm: npt.ArrayLike = np.nan
) -> Float:
    """Points (n, 2) of one system in another, for an image of this width and height.

    Parameters
    ----------
    xy : (n, 2) float64
    format_px : (2,) float64, px
    pixel_mm : (2,) float64, mm
        Size of a pixel; where one of the systems is in millimetres.
    """
    size, pixel = np.asarray(format_px, dtype=np.float64), np.broadcast_to(pixel_mm, 2).astype(np.float64)
    to_centre, from_centre = _centred(source, size, pixel), _centred(target, size, pixel)
    centred = np.asarray(xy, dtype=np.float64) @ to_centre[:, :2].T + to_centre[:, 2]
    return np.asarray((centred - from_centre[:, 2]) @ np.linalg.inv(from_centre[:, :2]).T)


PHOTO_MM = PIXEL_AXES["bingo"]
"""Image coordinates of cameras that measure in millimetres: from the image centre, x right, y up."""


def principal_point_mm(centre: npt.ArrayLike, axes: PixelAxes, format_px: npt.ArrayLike, pixel_mm: Float) -> Float:
    """x0, y0 (2,) in mm from the image centre, x right, y up, of a principal point in a pixel system."""
    matrix = _centred(axes, np.asarray(format_px, dtype=np.float64), np.broadcast_to(pixel_mm, 2))
    return np.asarray((matrix[:, :2] @ np.asarray(centre, dtype=np.float64) + matrix[:, 2]) * pixel_mm)


def _centred(axes: PixelAxes, format_px: Float, pixel_mm: Float) -> Float:
    """Matrix (2, 3) to pixels from the image centre, x right, y up.

    Normalised coordinates and millimetres count from the image centre, whatever the pixel that a program gives to it.
    """
    if axes.unit != "px":
        scale = np.full(2, format_px.max()) if axes.unit == "normalised" else 1.0 / pixel_mm
        return np.array([[scale[0], 0.0, 0.0], [0.0, -scale[1] if axes.y == "down" else scale[1], 0.0]])
    return mm_from_pixel(np.ones(2), axes.origin, axes.y, format_px)
