"""Pixels of a file as grey values of 8 bits: as they lie there, whatever viewers are to turn.

More than 8 bits are stretched between the 0.5th and the 99.5th percentile (12 bits in 16 fill a sixteenth of the
range, in which no feature is found); CMYK and colours become the brightness of ITU-R BT.601. Of TIFF files a window is
read by the strips or tiles that it touches, so that a scan of 370 million pixels is never whole in memory.
"""

import io
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool
from aatri.errors import InputError
from aatri.extras import of_extra
from aatri.ids import printable
from aatri.regular_file import content_of

Grey = npt.NDArray[np.uint8]
Samples = npt.NDArray[Any]

PERCENTILES = (0.5, 99.5)
SAMPLED = 1_000_000
"""So many pixels tell the percentiles."""
BT601 = np.array([0.299, 0.587, 0.114])
DECODED = (1, 8, 32946)
"""Compressions of TIFF of which tifffile decodes strips and tiles by itself: none and deflate."""
WRAPPED = (5, 32773)
"""LZW and PackBits: a strip or tile goes to Pillow as a file of its own; of other compressions the whole image."""
TIFF = (".tif", ".tiff")


def grey_image(path: str) -> Grey:
    """The whole image (height, width).

    Raises
    ------
    InputError
        If it is not there, is no picture or ends before its time.
    """
    return stretched(whole_image(path))


def grey_and_mask(path: str, mask: str, content: str) -> tuple[Grey, Bool | None]:
    """An image (height, width) and where features may be, None for everywhere.

    Parameters
    ----------
    path, mask : str
        Files; a mask is 0 where no feature is to be, `""` is none.
    content : str
        SHA-256 that the block has of both.

    Raises
    ------
    InputError
        If the files are not those that the block was made with, or their sizes differ.
    """
    check_content(content, path, mask)
    grey, seen = grey_image(path), np.asarray(grey_image(mask) > 0) if mask else None
    if seen is not None and seen.shape != grey.shape:
        what = f"has {seen.shape[1]} x {seen.shape[0]} pixels, its image {grey.shape[1]} x {grey.shape[0]}"
        raise InputError(what, where=mask, remedy="a mask has the size of its image")
    return grey, seen


def check_content(content: str, *paths: str) -> None:
    """A fault where files are not those that the block was made with."""
    digest = content_of(*paths)
    if not digest or digest != content:
        what = "has changed since the block was read" if digest else "is not there"
        raise InputError(what, where=paths[0], remedy="make the stage again that names it: aatri run --force STAGE")


def whole_image(path: str) -> Samples:
    """The whole image (height, width) in its own depth, colours as brightness."""
    if Path(path).suffix.lower() in TIFF:
        width, height = size_px(path)
        return window(path, 0, 0, width, height)
    return whole_by_pillow(path)


def whole_by_pillow(path: str) -> Samples:
    """The whole image, decoded by Pillow."""
    Image = of_extra("PIL.Image", "images")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
            try:
                with Image.open(path) as picture:
                    if picture.format == "JPEG" and picture.mode != "CMYK":
                        picture.draft("L", None)  # brightness alone is decoded
                    deep = picture.mode.startswith(("I", "F"))
                    return np.asarray(picture if deep else picture.convert("L"))
            finally:
                Image.MAX_IMAGE_PIXELS = limit
    except (OSError, SyntaxError, ValueError) as error:
        raise _unreadable(path, error) from error


def size_px(path: str) -> tuple[int, int]:
    """Width and height of a TIFF file."""
    with _tiff(path) as file:
        page = file.pages[0]
        return int(page.imagewidth), int(page.imagelength)


def reads_windows(path: str) -> bool:
    """Whether the windows of a file can be read one by one: of a TIFF file whose compression is decoded by parts."""
    if Path(path).suffix.lower() not in TIFF:
        return False
    with _tiff(path) as file:
        return file.pages[0].compression in DECODED + WRAPPED


def window(path: str, column: int, row: int, width: int, height: int) -> Samples:
    """A window (height, width) of a TIFF file in its own depth; only the strips or tiles that it touches are read.

    Parameters
    ----------
    column, row : int
        First pixel; the window lies within the image.
    """
    with _tiff(path) as file:
        page = file.pages[0]
        made: Samples | None = None
        deep, down = (page.tilewidth, page.tilelength) if page.is_tiled else (page.imagewidth, page.rowsperstrip)
        across = -(-page.imagewidth // deep)
        if page.compression not in DECODED + WRAPPED:
            return whole_by_pillow(path)[row : row + height, column : column + width]
        try:
            for k, (offset, count) in enumerate(zip(page.dataoffsets, page.databytecounts)):
                x, y = k % across * deep, k // across * down
                if x >= column + width or x + deep <= column or y >= row + height or y + down <= row:
                    continue
                file.filehandle.seek(offset)
                data = file.filehandle.read(count)
                if page.compression in DECODED:
                    segment = np.asarray(page.decode(data, k)[0])[0]
                else:
                    segment = _wrapped(data, page, deep, down if page.is_tiled else min(down, page.imagelength - y))
                part = _brightness(segment, page)
                if made is None:
                    made = np.zeros((height, width), part.dtype)
                top, left = max(y, row), max(x, column)
                bottom, right = min(y + part.shape[0], row + height), min(x + part.shape[1], column + width)
                made[top - row : bottom - row, left - column : right - column] = part[
                    top - y : bottom - y, left - x : right - x
                ]
        except (ValueError, IndexError, TypeError, RuntimeError, OSError) as error:
            raise _unreadable(path, error) from error
    if made is None:
        what = f"no pixels at column {column}, row {row}"
        raise InputError(what, where=path, remedy="copy the file anew")
    return made


def reduced_jpeg(path: str, longest_px: int) -> bytes:
    """An image in brightness as a JPEG file whose longer side has at most so many pixels.

    Raises
    ------
    InputError
        As `grey_image`.
    """
    Image = of_extra("PIL.Image", "images")
    picture = Image.fromarray(grey_image(path))
    picture.thumbnail((longest_px, longest_px))
    file = io.BytesIO()
    picture.save(file, "JPEG", quality=75)
    return file.getvalue()


def range_of(samples: Samples) -> tuple[float, float]:
    """The two percentiles between which samples are stretched."""
    step = max(1, int((samples.size / SAMPLED) ** 0.5))
    low, high = np.percentile(samples[::step, ::step], PERCENTILES)
    return float(low), float(high)


def stretched(samples: Samples, between: tuple[float, float] | None = None) -> Grey:
    """Samples of any depth as 8 bits: as they are, or between two percentiles, their own or those of the whole."""
    if samples.dtype == np.uint8:
        return samples
    low, high = between or range_of(samples)
    made: Grey = np.empty(samples.shape, np.uint8)
    for first in range(0, len(samples), 256):  # by rows: no second image in floating point
        part = (samples[first : first + 256].astype(np.float32) - low) * (255.0 / max(high - low, 1e-9))
        made[first : first + 256] = np.clip(part, 0, 255)
    return made


def _wrapped(data: bytes, page: Any, width: int, height: int) -> Samples:
    """Samples (rows, columns, bands) of a strip or tile, decoded by Pillow as a TIFF file of one strip."""
    Image = of_extra("PIL.Image", "images")
    bands, order = int(page.samplesperpixel), page.parent.byteorder
    bits = struct.pack(f"{order}{bands}H", *[int(page.bitspersample)] * bands)
    tags = {  # code: value of the type LONG
        256: width,
        257: height,
        259: int(page.compression),
        262: 1 if bands == 1 else int(page.photometric),
        273: 8,
        277: bands,
        278: height,
        279: len(data),
        284: 1,
        317: int(page.predictor),
    }
    if bands == 1:
        tags[258] = int(page.bitspersample)
    head = 8 + len(data) + len(data) % 2
    entries = {code: struct.pack(f"{order}HHII", code, 4, 1, value) for code, value in tags.items()}
    if bands > 1:
        entries[258] = struct.pack(f"{order}HHII", 258, 3, bands, head)
        data += b"\0" * (len(data) % 2) + bits
    data += b"\0" * (len(data) % 2)
    table = b"".join(entries[code] for code in sorted(entries))
    mark = b"II" if order == "<" else b"MM"
    file = mark + struct.pack(f"{order}HI", 42, 8 + len(data)) + data
    file += struct.pack(f"{order}H", len(entries)) + table + b"\0" * 4
    with Image.open(io.BytesIO(file)) as picture:
        return np.asarray(picture).reshape(height, width, bands)


def _brightness(segment: Samples, page: Any) -> Samples:
    """Samples (rows, columns) of a segment (rows, columns, bands)."""
    photometric = int(page.photometric)
    if segment.shape[2] == 1 or photometric in (0, 1):
        return segment[:, :, 0] if photometric != 0 else np.iinfo(segment.dtype).max - segment[:, :, 0]
    bands = segment[:, :, :4].astype(np.float32)
    if photometric == 5:  # CMYK: ink takes light away
        full = float(np.iinfo(segment.dtype).max)
        bands = (full - bands[:, :, :3]) * (1.0 - bands[:, :, 3:4] / full)
    return np.asarray((bands[:, :, :3] @ BT601).round()).astype(segment.dtype)


def _tiff(path: str) -> Any:
    tifffile = of_extra("tifffile", "images")
    try:
        file = tifffile.TiffFile(path)
    except (OSError, tifffile.TiffFileError) as error:
        raise _unreadable(path, error) from error
    try:
        _ = file.pages[0]
    except IndexError as error:
        file.close()
        raise _unreadable(path, error) from error
    return file


def _unreadable(path: str, error: Exception) -> InputError:
    if not Path(path).exists():
        remedy = "put it back, or make the stage again that names it: aatri run --force STAGE"
        return InputError("is not there", where=path, remedy=remedy)
    what = f"cannot be read as a picture: {printable(str(error))[:200]}"
    return InputError(what, where=path, remedy="copy it anew from its source")
