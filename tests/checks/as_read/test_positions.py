"""Positions that cannot be: one may always go, more than the share may not, and all go where all are the same."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.errors import InputError
from tests.bad_inputs.rows import BadInput
from tests.reading import read_block
from tests.stages.film_blocks import Told

THERE = {"X": "446000.0", "Y": "4505000.0", "Z": "390.0"}


def _read(folder: Path, **change: Any) -> tuple[Block, list[str]]:
    """The film block with other positions, and the warnings."""
    BadInput(folder, {"base": "film", "changes": [{"file": "exterior.csv", **change}]}).write(folder)
    heard = Told()
    return read_block(folder / "block", heard), heard.warnings


def test_one_of_eight_is_set_aside_by_name_and_the_others_stay(tmp_path: Path) -> None:
    block, warned = _read(tmp_path, rows={"image": "0103"}, set={"Z": "0"})
    assert [w for w in warned if "rejected: exterior 0103: height of 0 m" in w]
    known = np.isfinite(block.exterior.position_m).all(axis=1)
    assert block.images.id[block.exterior.image[~known]].tolist() == ["0103"]


def test_two_of_eight_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="2 of 8 positions cannot be right"):
        _read(tmp_path, rows={"image": ["0103", "0202"]}, set={"Z": "0"})


def test_positions_that_are_all_the_same_are_set_aside_in_one_line(tmp_path: Path) -> None:
    block, warned = _read(tmp_path, set=THERE)
    assert not np.isfinite(block.exterior.position_m).any()
    assert len([w for w in warned if "rejected: 8 of kind exterior: position is that of all 8 images: 0101" in w]) == 1
