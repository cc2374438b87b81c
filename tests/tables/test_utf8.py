"""Columns of text against Python's own encoder, text by text."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.tables.utf8 import decoded, encoded, lengths_and_bytes

TEXTS = {
    "ascii": np.array(["0101", "", "GCP 7", "a,b", "x" * 40]),
    "others": np.array(["Zürich", "", "航空", "a", "\U0001f6e9 plane"]),
    "nul inside": np.array(["a\0b", "c", ""]),
    "nothing": np.array(["", "", ""]),
    "none": np.zeros(0, dtype="U3"),
    "table": np.array([["a", "bc"], ["", "d"]]),
    "strided": np.array(["a", "b", "c", "d"])[::2],
    "big-endian": np.array(["ab", "c"]).astype(">U2"),
}


@pytest.mark.parametrize("texts", TEXTS.values(), ids=TEXTS.keys())
def test_bytes_and_lengths_are_those_of_each_text(texts: np.ndarray) -> None:
    each = [str(text).encode() for text in texts.ravel()]
    assert encoded(texts).ravel().tolist() == each
    length, data = lengths_and_bytes(texts)
    assert length.tolist() == [len(text) for text in each]
    assert data == b"".join(each)
    back = decoded(encoded(texts))
    assert back.shape == texts.shape
    assert back.tolist() == texts.tolist()
