"""A declared frame is checked on reading."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.frames.checks import fault_of_frame, out_of_range, place_outside
from aatri.frames.conversion import Frame
from tests.formats.tables.block_folder import FILES, replaced, write_folder
from tests.reading import read_block

ENU, GEO = ("east", "north", "up"), ("latitude", "longitude", "height")


@pytest.mark.parametrize(
    ("axes", "crs", "vertical", "key", "what"),
    [
        (ENU, "EPSG:999999", "", "crs", "is not known"),
        (ENU, "EPSG:4326", "", "axes", "is geographic, in degrees"),
        (GEO, "EPSG:32650", "", "axes", "is not geographic"),
        (ENU, "EPSG:32650", "EPSG:999999", "vertical", "is not known"),
        (ENU, "EPSG:32650", "EPSG:32651", "vertical", "no vertical system"),
        (ENU, "EPSG:2263", "", "crs", "easting in US survey foot"),
        (ENU, "EPSG:32618", "EPSG:6360", "vertical", "gravity-related height in US survey foot"),
        (ENU, "EPSG:32650", "EPSG:5831", "vertical", "counts downwards"),
        (ENU, "EPSG:5773", "", "crs", "a system of heights alone"),
        (ENU, "EPSG:4978", "", "axes", "is geocentric"),
        (GEO, "EPSG:4807", "", "crs", "in grad"),
    ],
)
def test_what_is_wrong_is_told_with_its_key(axes, crs: str, vertical: str, key: str, what: str) -> None:
    found = fault_of_frame(Frame("f", axes, crs, vertical))
    assert found is not None
    assert found[0] == key
    assert what in found[1]


@pytest.mark.parametrize(
    ("axes", "crs", "vertical"),
    [
        (ENU, "local", ""),
        (ENU, "EPSG:32650", ""),
        (("north", "east", "up"), "EPSG:32650", "EPSG:5773"),
        (GEO, "EPSG:4979", ""),
        (("x", "y", "z"), "EPSG:4978", ""),
        (ENU, "+proj=topocentric +R=6371000 +lat_0=0 +lon_0=0 +h_0=0", ""),
    ],
)
def test_sound_frames_pass(axes, crs: str, vertical: str) -> None:
    assert fault_of_frame(Frame("f", axes, crs, vertical)) is None


def test_a_latitude_beyond_90_degrees_is_out_of_range_in_geographic_frames_only() -> None:
    xyz = np.array([[40.0, 117.0, 5.0], [117.0, 40.0, 5.0], [np.nan, 40.0, 5.0]])
    assert out_of_range(xyz, GEO).tolist() == [False, True, False]
    assert not out_of_range(xyz * 1e4, ENU).any()


def test_the_reader_names_file_and_line(tmp_path: Path) -> None:
    changes = replaced("block.yaml", "EPSG:32650", "EPSG:4326")
    with pytest.raises(AatriError, match=r"block.yaml:4:\d+: frame map: EPSG:4326 .* geographic"):
        read_block(write_folder(tmp_path / "a", changes))
    yaml = (
        FILES["block.yaml"]
        .replace("frames:\n", "frames:\n", 1)
        .replace(
            "crs: EPSG:32650}\n", "crs: EPSG:32650}\n  geo: {axes: [latitude, longitude, height], crs: EPSG:4979}\n"
        )
    )
    ground = (
        "point,X,Y,Z,frame\nK,4505079.577,446263.976,6.378,\n1,117.1,40.2,7,geo\n2,40.1,117.2,3,geo\n"
        "3,40.1,117.2,9,geo\n0123,40.1,117.2,9.5,geo\n"
    )
    with pytest.raises(AatriError, match=r"ground_points.csv:3:\d+: latitude or longitude is out of range"):
        read_block(write_folder(tmp_path / "b", {"block.yaml": yaml, "ground_points.csv": ground}))


def test_a_block_far_from_where_its_system_is_used_is_told() -> None:
    zone_50 = Frame("map", ENU, "EPSG:32650")
    there = np.array([[446263.976, 4505079.577, 6.4], [446287.4, 4504679.4, 4.1], [np.nan, np.nan, 3.0]])
    assert place_outside(zone_50, there) == ""
    assert "far from where that is used" in place_outside(zone_50, there[:, [1, 0, 2]])
    assert "far from where that is used" in place_outside(zone_50, there + np.array([39e6, 0, 0]))
    assert place_outside(Frame("map", ENU, "EPSG:32650+5773"), there) == ""
    assert place_outside(Frame("map", ENU, "EPSG:3857"), there) == ""  # used all over the world
    dateline = Frame("map", ENU, "EPSG:3832")  # the Pacific, from 98 to 69 degrees west across 180
    assert place_outside(dateline, np.array([[0.0, 0.0, 0.0]])) == ""  # 150 degrees east


def test_without_coordinates_nothing_is_told() -> None:
    assert place_outside(Frame("map", ENU, "EPSG:32650"), np.full((2, 3), np.nan)) == ""
