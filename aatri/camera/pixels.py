"""Pixel coordinates to millimetres from the image centre, x right, y up.

Origins, for an image of `width` x `height` pixels with y counted downwards:

- top-left-corner: (0, 0) is the outer corner of the first pixel, the image centre is (width/2, height/2)
- top-left-centre: (0, 0) is the centre of the first pixel, the image centre is ((width - 1)/2, (height - 1)/2)
- bottom-left-corner: the outer corner of the lowest left pixel
- image-centre: the image centre is (0, 0)

The direction of y is declared apart from the origin: `bottom-left-corner` with y up is the usual pair, but y counted
down from there is read as it says.
"""

import numpy as np

from aatri.arrays import Bool, Float
from aatri.errors import InputError

ORIGINS = ("top-left-corner", "top-left-centre", "bottom-left-corner", "image-centre")


def mm_from_pixel(pixel_size_mm: Float, origin: str, y_direction: str, format_px: Float) -> Float:
    """Matrix from pixel coordinates to millimetres from the image centre.

    Parameters
    ----------
    pixel_size_mm : (2,) float64, mm
    origin : str
        One of `ORIGINS`.
    y_direction : str
        down or up.
    format_px : (2,) float64, px
        Width and height; not needed for the origin image-centre.

    Returns
    -------
    (2, 3) float64, mm/px and mm
        [A | t] with xy_mm = A (column, row) + t.

    Raises
    ------
    InputError
        If the origin, the direction of y, the pixel size or the format is missing or unknown.

    Examples
    --------
    The centre of the first pixel is the origin, so that a width of 4000 is centred at 1999.5:

    >>> to_mm = mm_from_pixel(np.array([0.004, 0.004]), "top-left-centre", "down", np.array([4000.0, 3000.0]))
    >>> to_mm @ [1999.5, 1499.5, 1.0]
    array([0., 0.])
    """
    size = np.asarray(pixel_size_mm, dtype=np.float64)
    if not (np.isfinite(size).all() and (size > 0).all()):
        raise InputError(f"pixel size is {size.tolist()}", remedy="give pixel: {size: mm}")
    centre = image_centre_px(origin, y_direction, format_px)
    linear = np.diag([size[0], size[1] if y_direction == "up" else -size[1]])
    return np.column_stack([linear, -linear @ centre])


def image_centre_px(origin: str, y_direction: str, format_px: Float) -> Float:
    """Pixel coordinates of the image centre.

    Raises
    ------
    InputError
        If the origin or the direction of y is unknown, or the format is needed and missing.
    """
    if origin not in ORIGINS:
        raise InputError(f"pixel origin is {origin!r}", remedy=f"give pixel: {{origin: one of {', '.join(ORIGINS)}}}")
    if y_direction not in ("down", "up"):
        raise InputError(f"pixel y is {y_direction!r}", remedy="give pixel: {y: down} or {y: up}")
    if origin == "image-centre":
        return np.zeros(2)
    width, height = np.asarray(format_px, dtype=np.float64)
    if not (width > 0 and height > 0):
        raise InputError(f"format is {width} x {height}", remedy="give format: [width, height] in pixels")
    if origin == "top-left-centre":
        # one half pixel from the corner, in either direction of y
        return np.array([(width - 1) / 2, (height - 1) / 2 if y_direction == "down" else -(height - 1) / 2])
    downwards = origin == "top-left-corner"
    return np.array([width / 2, height / 2 if downwards == (y_direction == "down") else -height / 2])


def half_format_mm(digital: Bool, format_mm_or_px: Float, pixel_size_mm: Float) -> Float:
    """Half the image format.

    Parameters
    ----------
    digital : (n,) bool
        Digital cameras, with a format in pixels; the format of film is in mm.
    format_mm_or_px : (n, 2) float64
    pixel_size_mm : (n, 2) float64, mm

    Returns
    -------
    (n, 2) float64, mm
        NaN where the format is not given.
    """
    return np.asarray(np.where(digital[:, None], format_mm_or_px * pixel_size_mm, format_mm_or_px) / 2)
