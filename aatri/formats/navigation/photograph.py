"""What the head of a photograph says: its size, its camera, when and where it was taken. No pixel is decoded.

    focal length in pixels   f35 diagonal_px / 43.27 mm, the diagonal of 36 x 24 mm (CIPA DCG-001)
                             else f width_px / width of the sensor, from the resolution of the focal plane

The orientation with which a viewer turns the picture is read and never applied: pixels count as they lie in the file.

Source: JEITA CP-3451 (Exif 2.32); CIPA DCG-001-2018.
"""

import calendar
import math
import re
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aatri.errors import InputError
from aatri.extras import of_extra
from aatri.ids import printable
from aatri.regular_file import content_of, open_regular

ENDINGS = (".jpg", ".jpeg", ".tif", ".tiff", ".png")
"""Of photographs."""
DIAGONAL_MM = math.hypot(36.0, 24.0)
WITHOUT_EXIF = 1.2
"""Focal length without any word of it, in units of the longer side: a lens of 43 mm on 36 x 24."""
_MM_OF_UNIT = {2: 25.4, 3: 10.0, 4: 1.0}
"""Of FocalPlaneResolutionUnit: inch, cm, mm."""

ANEW = "copy it anew from the card, or take it out"
HOLE_BYTES = 64
"""So many zeros in a row are no pixels: two blocks and more of 63 equal coefficients. Photographs have 5 at most."""
CODES, PROGRESSIVE = b"\xc4", b"\xc2"
CODE_LENGTHS = 16
"""Counts of codes by length, before the symbols of a Huffman table (ITU-T T.81, B.2.4.2)."""
_MARKER = re.compile(rb"\xff[^\x00\xd0-\xd7\xff]")

EXIF, GPS = 0x8769, 0x8825
MAKE, MODEL, ORIENTATION = 271, 272, 274
TIME, SUBSECONDS, FOCAL, FOCAL_35, WIDTH, PLANE_X, PLANE_UNIT, LENS = (
    36867,
    37521,
    37386,
    41989,
    40962,
    41486,
    41488,
    42036,
)


@dataclass(frozen=True)
class Photograph:
    """The head of a photograph."""

    path: Path
    content: str
    size_px: tuple[int, int]
    """Width and height as they lie in the file."""
    orientation: int
    """1 to 8, as a viewer would turn it; 1 where nothing is said."""
    make: str
    model: str
    lens: str
    focal_mm: float
    focal_px: float
    """As `focal_mm` NaN where nothing is said."""
    time_s: float
    """Of the camera's clock, from 1970; NaN where nothing is said."""
    lonlat_deg: tuple[float, float, float]
    """Longitude, latitude in degrees, height in m; NaN where nothing is said."""

    @property
    def camera(self) -> str:
        """Make, model, lens and size: what photographs of one camera have in common."""
        model = self.model if self.model.lower().startswith(self.make.lower()) else f"{self.make} {self.model}"
        return "-".join([*f"{model} {self.lens}".split(), "{}x{}".format(*self.size_px)])


def read_photograph(path: Path) -> Photograph:
    """Read the head of a photograph.

    Raises
    ------
    InputError
        If it is not there, is no picture, ends before its time, or states an impossible position.
    """
    Image = of_extra("PIL.Image", "images")
    try:
        with open_regular(path) as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of size: no pixel is decoded here
            limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
            try:
                with Image.open(file) as picture:
                    size, head = picture.size, picture.getexif()
                    exif, gps = head.get_ifd(EXIF), head.get_ifd(GPS)
            finally:
                Image.MAX_IMAGE_PIXELS = limit
    except (OSError, SyntaxError, ValueError) as error:
        reason = printable(str(error))[:200]
        if isinstance(error, Image.UnidentifiedImageError):  # its text names the open file, not its path
            reason = "its beginning is that of no format that is read" if path.stat().st_size else "the file is empty"
        what = f"cannot be read as a picture: {reason}"
        raise InputError(what, where=str(path), remedy=ANEW) from error
    _check_end(path)
    f_mm, f35 = _positive(exif.get(FOCAL)), _positive(exif.get(FOCAL_35))
    return Photograph(
        path,
        content_of(str(path)),
        size,
        int(head.get(ORIENTATION, 1)) if head.get(ORIENTATION, 1) in range(1, 9) else 1,
        _text(head.get(MAKE)),
        _text(head.get(MODEL)),
        _text(exif.get(LENS)),
        f_mm,
        f35 * math.hypot(*size) / DIAGONAL_MM if f35 == f35 else f_mm * size[0] / _sensor_width_mm(exif, size[0]),
        _time(exif),
        _place(gps, path),
    )


def _check_end(path: Path) -> None:
    """The pixels of a JPEG file end with a marker, previews and notes may follow; nothing in them is long zero."""
    with open_regular(path) as file:
        data = file.read() if file.read(2) == b"\xff\xd8" else b""
    at, zeros_are_pixels = 0, False
    while data and at >= 0:
        marker, length = data[at + 1 : at + 2], int.from_bytes(data[at + 2 : at + 4], "big")
        if marker == b"\xd9":
            return
        codes = data[at + 4 : at + 2 + length] if marker == CODES else b""
        zeros_are_pixels |= marker == PROGRESSIVE or _plain_is_zeros(codes)
        at += 2 + length
        if marker == b"\xda":  # pixels: up to the next marker that is none of their own
            following, hole = _MARKER.search(data, at), data.find(bytes(HOLE_BYTES), at)
            if following and at <= hole < following.start() and not zeros_are_pixels:
                what = f"the file has a hole: zeros in the place of pixels from byte {hole + 2}"
                raise InputError(what, where=str(path), remedy=ANEW)
            at = following.start() if following else -1
        elif data[at : at + 1] != b"\xff":
            at = -1
    if at < 0:
        raise InputError("the file is truncated: it ends within the picture", where=str(path), remedy=ANEW)


def _plain_is_zeros(tables: bytes) -> bool:
    """Whether some Huffman table ends a block without detail by zero bits alone: that is its first code."""
    while len(tables) > CODE_LENGTHS:
        if tables[0] >> 4 and tables[1 + CODE_LENGTHS] == 0:
            return True
        tables = tables[1 + CODE_LENGTHS + sum(tables[1 : 1 + CODE_LENGTHS]) :]
    return False


def _sensor_width_mm(exif: Any, width_px: int) -> float:
    """Width of the sensor by the resolution of its focal plane, which counts in pixels of the picture as taken."""
    resolution = _positive(exif.get(PLANE_X))
    width = _positive(exif.get(WIDTH))
    return (width if width == width else width_px) / resolution * _MM_OF_UNIT.get(exif.get(PLANE_UNIT, 2), math.nan)


def _positive(value: Any) -> float:
    """A number above zero; NaN for any other, and for what is none."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return math.nan
    return number if 0 < number < math.inf else math.nan


def _text(value: Any) -> str:
    return printable(str(value or "").split("\0")[0]).strip()


def _time(exif: Any) -> float:
    try:
        seconds = calendar.timegm(time.strptime(_text(exif.get(TIME)), "%Y:%m:%d %H:%M:%S"))
    except ValueError:
        return math.nan
    parts = _text(exif.get(SUBSECONDS))
    return seconds + (float(f"0.{parts}") if parts.isdecimal() else 0.0)


def _place(gps: Any, path: Path) -> tuple[float, float, float]:
    """Longitude, latitude, height; a receiver without a fix writes zeros, or 0/0."""
    try:
        latitude, longitude = (sum(float(v) / 60**k for k, v in enumerate(gps[tag])) for tag in (2, 4))
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return (math.nan,) * 3
    if math.isnan(latitude + longitude) or latitude == longitude == 0:
        return (math.nan,) * 3
    for name, tag, value, most in (("latitude", 2, latitude, 90), ("longitude", 4, longitude, 180)):
        if not 0 <= value <= most or any(not 0 <= float(part) <= 60 for part in gps[tag][1:]):
            stated = " ".join(f"{float(part):g}" for part in gps[tag])
            what = f"its GPS {name} is {stated}, which are no degrees, minutes and seconds"
            raise InputError(what, where=str(path), remedy="write the position anew, or take it out of the EXIF data")
    latitude, longitude = (
        -v if _text(gps.get(t)) in "SW" and _text(gps.get(t)) else v for v, t in ((latitude, 1), (longitude, 3))
    )
    try:
        height = float(gps[6]) * (-1 if gps.get(5) in (b"\x01", 1) else 1)
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        height = math.nan
    return longitude, latitude, height
