"""A declared frame is checked on reading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.formats.tables.reader import read_block
from aatri.frames.checks import fault_of_frame, out_of_range
from aatri.frames.conversion import Frame
from tests.formats.tables.block_folder import FILES, replaced, write_folder

ENU, GEO = ("east", "north", "up"), ("latitude", "longitude", "height")


@pytest.mark.parametrize(
    ("axes", "crs", "vertical", "key", "what"),
    [
        (ENU, "EPSG:999999", "", "crs", "is not known"),
        (ENU, "EPSG:4326", "", "axes", "is geographic, in degrees"),
        (GEO, "EPSG:32650", "", "axes", "is not geographic"),
        (ENU, "EPSG:32650", "EPSG:999999", "vertical", "is not known"),
        (ENU, "EPSG:32650", "EPSG:32651", "vertical", "no vertical system"),
    ],
)
def test_what_is_wrong_is_told_with_its_key(axes, crs, vertical, key, what):
    found = fault_of_frame(Frame("f", axes, crs, vertical))
    assert found is not None
    assert found[0] == key
    assert what in found[1]


@pytest.mark.parametrize(
    ("axes", "crs", "vertical"),
    [
        (ENU, "local", ""), (ENU, "EPSG:32650", ""), (("north", "east", "up"), "EPSG:32650", "EPSG:5773"),
        (GEO, "EPSG:4979", ""), (("x", "y", "z"), "EPSG:4978", ""),
        (ENU, "+proj=topocentric +R=6371000 +lat_0=0 +lon_0=0 +h_0=0", ""),
    ],
)  # fmt: skip
def test_sound_frames_pass(axes, crs, vertical):
    assert fault_of_frame(Frame("f", axes, crs, vertical)) is None


def test_a_latitude_beyond_90_degrees_is_out_of_range_in_geographic_frames_only():
    xyz = np.array([[40.0, 117.0, 5.0], [117.0, 40.0, 5.0], [np.nan, 40.0, 5.0]])
    assert out_of_range(xyz, GEO).tolist() == [False, True, False]
    assert not out_of_range(xyz * 1e4, ENU).any()


def test_the_reader_names_file_and_line(tmp_path: Path) -> None:
    changes = replaced("block.yaml", "EPSG:32650", "EPSG:4326")
    with pytest.raises(AatriError, match=r"block.yaml:4:\d+: frame map: EPSG:4326 .* geographic"):
        read_block(write_folder(tmp_path / "a", changes))
    yaml = FILES["block.yaml"].replace("frames:\n", "frames:\n", 1).replace(
        "crs: EPSG:32650}\n",
        "crs: EPSG:32650}\n  geo: {axes: [latitude, longitude, height], crs: EPSG:4979}\n")  # fmt: skip
    ground = ("point,X,Y,Z,frame\nK,4505079.577,446263.976,6.378,\n1,117.1,40.2,7,geo\n2,40.1,117.2,3,geo\n"
              "3,40.1,117.2,9,geo\n0123,40.1,117.2,9.5,geo\n")  # fmt: skip
    with pytest.raises(AatriError, match=r"ground_points.csv:3:\d+: latitude or longitude is out of range"):
        read_block(write_folder(tmp_path / "b", {"block.yaml": yaml, "ground_points.csv": ground}))
