"""Texts of 8 bits are not taken for Chinese, and Chinese is; texts larger than memory are refused before."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from aatri.errors import InputError, ResourceError
from aatri.formats.text.text_file import read_lines

WESTERN = [
    "Größe",
    "Übersicht,über,Öl",
    "45°30'N",
    "µm",
    "Straße;GRÖßE",
    "café,naïve",
    "São Paulo,Ñandú",
    "Ærø,Åse",
    "x²,£5",
    "Müller,Jürgen",
]


@pytest.mark.parametrize("text", WESTERN)
@pytest.mark.parametrize("encoding", ["cp1252", "latin-1"])
def test_western_text_is_refused_as_what_it_is(tmp_path: Path, text: str, encoding: str) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(f"point,x\n{text},1\n".encode(encoding))
    with pytest.raises(InputError, match="Windows-1252") as caught:
        read_lines(path)
    assert caught.value.where.endswith("t.csv:2")


@pytest.mark.parametrize("text", ["点号", "控制点1,外业检查点", "像片，比例尺", "武汉大学", "GCP点1", "航线 1"])
def test_chinese_text_is_read(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(f"{text}\n".encode("gbk"))
    assert read_lines(path) == [text]


def test_a_file_that_memory_cannot_hold_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "image_points.csv"
    path.write_bytes(b"image,point,x,y\n")
    os.truncate(path, os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))  # a hole as large as memory
    with pytest.raises(ResourceError, match="GB of memory to read, and this machine has less"):
        read_lines(path)
