"""From where programs count the coordinates of an image, and which way y goes.

A table, held against points of known place: the centre of an image, of its first pixel, of its last. Readers name a
row; what a Block needs of it are `origin` and `y` of its cameras (`aatri.camera.pixels` says what they mean).

A principal point that a program counts from elsewhere than the image centre becomes x0, y0 in millimetres, x right, y
up, by the same matrix as an image point.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.camera.pixels import mm_from_pixel

PIXEL_MM = 0.001
"""Size given to a pixel where a format knows no millimetres; c = f um."""


@dataclass(frozen=True)
class PixelAxes:
    """Where image coordinates count from, and which way y goes; `normalised`: divided by max(width, height)."""

    origin: str
    y: str = "down"
    normalised: bool = False

    @property
    def name(self) -> str:
        """As a text, see `named`."""
        return f"{self.origin} {self.y}{' normalised' if self.normalised else ''}"


def named(name: str) -> PixelAxes:
    """The axes of a `name`."""
    origin, y, *normalised = name.split()
    return PixelAxes(origin, y, bool(normalised))


PIXEL_AXES = {
    "aatri": PixelAxes("top-left-corner"),
    "bal": PixelAxes("image-centre", "up"),
    "bingo": PixelAxes("image-centre", "up"),  # mm
    "blocksexchange": PixelAxes("top-left-centre"),
    "bundler": PixelAxes("image-centre", "up"),
    "colmap": PixelAxes("top-left-corner"),
    "dbat": PixelAxes("top-left-corner"),
    "metashape": PixelAxes("top-left-corner"),
    "micmac": PixelAxes("top-left-corner"),
    "nvm": PixelAxes("image-centre"),
    "odm_gcp": PixelAxes("top-left-centre"),  # as OpenSfM takes them: (x + 0.5 - W/2) / max(W, H)
    "opencv": PixelAxes("top-left-centre"),
    "opensfm": PixelAxes("image-centre", normalised=True),  # (column + 0.5 - W/2) / max(W, H)
    "opf": PixelAxes("top-left-corner"),
    "photomod": PixelAxes("bottom-left-corner", "up"),
    "pix4d": PixelAxes("top-left-corner"),
    "socet": PixelAxes("image-centre"),
}
"""Of image coordinates, by program. Sources: the manuals and samples named on the page of each format."""


def between(source: PixelAxes, target: PixelAxes, format_px: npt.ArrayLike) -> Float:
    """Matrix [A | t] (2, 3) from one pixel system to another, for an image of this width and height.

    Parameters
    ----------
    source, target : PixelAxes
    format_px : (2,) float64, px
    """
    size = np.asarray(format_px, dtype=np.float64)
    to_centre, from_centre = _centred(source, size), _centred(target, size)
    inverse = np.linalg.inv(from_centre[:, :2])
    return np.column_stack([inverse @ to_centre[:, :2], inverse @ (to_centre[:, 2] - from_centre[:, 2])])


def converted(xy: npt.ArrayLike, source: PixelAxes, target: PixelAxes, format_px: npt.ArrayLike) -> Float:
    """Points (n, 2) of one pixel system in another."""
    matrix = between(source, target, format_px)
    return np.asarray(np.asarray(xy, dtype=np.float64) @ matrix[:, :2].T + matrix[:, 2])


def principal_point_mm(centre: npt.ArrayLike, axes: PixelAxes, format_px: npt.ArrayLike, pixel_mm: Float) -> Float:
    """x0, y0 (2,) in mm from the image centre, x right, y up, of a principal point in a pixel system."""
    matrix = _centred(axes, np.asarray(format_px, dtype=np.float64))
    return np.asarray((matrix[:, :2] @ np.asarray(centre, dtype=np.float64) + matrix[:, 2]) * pixel_mm)


def centre_px(principal_point_mm: npt.ArrayLike, axes: PixelAxes, format_px: npt.ArrayLike, pixel_mm: Float) -> Float:
    """The principal point (2,) in a pixel system, of x0, y0 in mm: the inverse of `principal_point_mm`."""
    matrix = _centred(axes, np.asarray(format_px, dtype=np.float64))
    from_centre = np.asarray(principal_point_mm, dtype=np.float64) / pixel_mm
    return np.asarray(np.linalg.solve(matrix[:, :2], from_centre - matrix[:, 2]))


def _centred(axes: PixelAxes, format_px: Float) -> Float:
    """Matrix (2, 3) to pixels from the image centre, x right, y up.

    Normalised coordinates count from the image centre, whatever the pixel that the program gives to it.
    """
    if axes.normalised:
        scale = float(format_px.max())
        return np.array([[scale, 0.0, 0.0], [0.0, -scale if axes.y == "down" else scale, 0.0]])
    return mm_from_pixel(np.ones(2), axes.origin, axes.y, format_px)
