"""One odd thing about one file, for every reader: read to the same Block, or refused with the name of the file."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from tests.campaigns.fuzz_numbers import figures
from tests.campaigns.fuzz_seeds import OF_BLOCKS, READERS

HTML = b"<!DOCTYPE html>\n<html><head><title>Sign in</title></head><body>Please sign in</body></html>\n"

SAME: dict[str, Callable[[bytes], bytes]] = {
    "byte order mark": lambda data: b"\xef\xbb\xbf" + data,
    "CRLF": lambda data: data.replace(b"\n", b"\r\n"),
    "no last line end": lambda data: data.rstrip(b"\n"),
    "blanks at the end": lambda data: data + b"\n",
}
REFUSED: dict[str, Callable[[bytes], bytes]] = {
    "nothing": lambda _: b"",
    "HTML": lambda _: HTML,
    "a workbook": lambda _: b"PK\x03\x04" + bytes(100),
    "a picture": lambda _: b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
    "zero bytes": lambda data: data + b"\0" * 20,
    "Windows-1252": lambda data: data.replace(b"\n", " Größe\n".encode("cp1252"), 2),
    "a decimal comma": lambda data: re.sub(rb"([0-9]{2,})\.([0-9])", rb"\1,\2", data),
    "1e400": lambda data: re.sub(rb"[0-9]{2,}\.[0-9]+", b"1e400", data),
}


def files() -> list[tuple[str, str]]:
    return [(name, file) for name in OF_BLOCKS for file in READERS[name].files]


@pytest.mark.parametrize("how", SAME)
@pytest.mark.parametrize(("name", "file"), files())
def test_what_does_not_matter_changes_nothing(tmp_path: Path, name: str, file: str, how: str) -> None:
    reader = READERS[name]
    reader.write(tmp_path)
    before, path = figures(reader.read(tmp_path)), tmp_path / file
    path.write_bytes(SAME[how](path.read_bytes()))
    after = figures(reader.read(tmp_path))
    for column, values in before.items():
        np.testing.assert_array_equal(values, after[column], err_msg=column)


@pytest.mark.parametrize("how", REFUSED)
@pytest.mark.parametrize(("name", "file"), files())
def test_what_is_no_such_file_is_refused_by_its_name(tmp_path: Path, name: str, file: str, how: str) -> None:
    reader = READERS[name]
    reader.write(tmp_path)
    path = tmp_path / file
    good = path.read_bytes()
    path.write_bytes(REFUSED[how](good))
    if path.read_bytes() == good:
        pytest.skip("this file has no such numbers")
    with pytest.raises(AatriError) as caught:
        reader.read(tmp_path)
    assert caught.value.exit_code == 3
    assert str(path) in str(caught.value)
