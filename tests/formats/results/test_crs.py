"""The coordinate system stands beside exports that have no place for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from aatri.formats.results.crs import write_crs
from tests.made_solutions import made_block


def test_a_declared_system_is_written_and_a_local_one_is_none(tmp_path: Path) -> None:
    block = made_block()
    assert write_crs(block, tmp_path) is None
    assert list(tmp_path.iterdir()) == []
    frames = replace(
        block.frames, crs=np.array(["EPSG:32650"]), vertical=np.array(["EPSG:5773"]), axes=np.array(["north,east,up"])
    )
    path = write_crs(replace(block, frames=frames), tmp_path)
    assert path == tmp_path / "crs.txt"
    assert path.read_text() == "crs: EPSG:32650\nvertical: EPSG:5773\naxes: east,north,up\nunit: m\n"
