"""Columns of text as UTF-8 bytes and back: ASCII, which nearly all ids are, as arrays of numbers, else text by text."""

from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Text

_ASCII = 128


def encoded(texts: Text) -> npt.NDArray[Any]:
    """UTF-8 of each text, as bytes of fixed length."""
    width = texts.dtype.itemsize // 4
    if texts.size and width and texts.dtype.isnative:
        codes = np.ascontiguousarray(texts).view(np.uint32)
        if codes.max() < _ASCII:
            return codes.astype(np.uint8).view(f"S{width}")
    return np.char.encode(texts, "utf-8") if texts.size else np.zeros(texts.shape, "S1")


def decoded(data: npt.NDArray[Any]) -> Text:
    """Texts of their UTF-8."""
    width = data.dtype.itemsize
    if data.size and width:
        codes = np.ascontiguousarray(data).view(np.uint8)
        if codes.max() < _ASCII:
            return np.asarray(codes.astype(np.uint32).view(f"U{width}"))
    return np.asarray(np.char.decode(data, "utf-8"))


def lengths_and_bytes(texts: Text) -> tuple[npt.NDArray[np.int64], bytes]:
    """Length in bytes of each text's UTF-8, and all of it together."""
    data = np.ascontiguousarray(encoded(texts).ravel())
    codes = data.view(np.uint8).reshape(len(data), data.dtype.itemsize)
    backwards = codes[:, ::-1] != 0  # a text ends with its last character that is not NUL
    length = np.where(backwards.any(axis=1), codes.shape[1] - backwards.argmax(axis=1), 0)
    return length, codes[np.arange(codes.shape[1]) < length[:, None]].tobytes()
