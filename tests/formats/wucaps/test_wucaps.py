"""WuCAPS files: the real RC-30 block, and what must happen to malformed lines."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import CHECK, CONTROL, NO_ROLE, TRUTH
from aatri.errors import AatriError, InputError
from aatri.stages.block.wucaps import WucapsOptions, wucaps
from aatri.tables.digest import content_digest
from tests.reading import read_wucaps

FOLDER = "rc30_2x3/Data/bundle_ajustment"


@pytest.fixture
def folder(tmp_path: Path, shared_data: Path) -> Path:
    """A copy of the real files."""
    copy = tmp_path / "rc30"
    copy.mkdir()
    for path in (shared_data / FOLDER).iterdir():
        shutil.copyfile(path, copy / path.name)
    return copy


def _edit(folder: Path, name: str, old: str, new: str) -> Path:
    path = folder / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    return path


def test_the_real_block_has_its_published_counts(folder: Path) -> None:
    block = read_wucaps(folder)
    # README of the data set: 22 points, 63 image points, 4 control points exact, 3 check points
    assert (len(block.points), len(block.image_points), len(block.images)) == (22, 63, 6)
    control = (block.ground_points.role == CONTROL).all(axis=1)
    check = (block.ground_points.role == CHECK).all(axis=1)
    ids = block.points.id[block.ground_points.point]
    assert ids[control].tolist() == ["8033401", "831000", "832000", "9033401"]
    assert ids[check].tolist() == ["8031901", "833000", "834000"]
    assert not block.ground_points.covariance_m2.any()
    assert len(block.rejects) == 0


def test_north_comes_out_as_the_second_coordinate(folder: Path) -> None:
    block = read_wucaps(folder)
    row = block.points.id[block.ground_points.point].tolist().index("8031901")
    assert block.ground_points.xyz_m[row].tolist() == [446263.976, 4505079.577, 6.378]


def test_two_strips_of_one_number_are_two_strips_in_file_order(folder: Path) -> None:
    block = read_wucaps(folder)
    assert block.strips.id.tolist() == ["1", "2"]
    members = {
        s: block.images.id[block.images.strip == k][np.argsort(block.images.sequence[block.images.strip == k])].tolist()
        for k, s in enumerate(block.strips.id.tolist())
    }
    assert members == {"1": ["321", "320", "319"], "2": ["332", "333", "334"]}


def test_strips_of_different_numbers_keep_them(folder: Path) -> None:
    path = folder / "PREPHI.DAT"
    head, tail = path.read_text().rsplit("           1   10     25000", 1)
    path.write_text(f"{head}           7   10     25000{tail}")
    assert read_wucaps(folder).strips.id.tolist() == ["1", "7"]


def test_the_camera_is_film_with_photo_coordinates(folder: Path) -> None:
    block = read_wucaps(folder, image_sigma_mm=0.008, control_sigma_m=0.1)
    cameras = block.cameras
    assert (cameras.kind[0], cameras.image_coordinates[0]) == ("film", "photo")
    assert cameras.principal_distance_mm[0] == 153.84
    assert cameras.principal_point_mm[0].tolist() == [0.011, 0.002]
    assert block.fiducials.xy_mm[0].tolist() == [106.002, -106.003]
    assert (block.image_points.sigma_mm == 0.008).all()
    np.testing.assert_allclose(block.ground_points.covariance_m2[0], np.eye(3) * 0.01, rtol=1e-14)


def test_plan_and_height_control(folder: Path) -> None:
    _edit(folder, "PRECPI.DAT", "4    0    0", "1    2    1")
    role = read_wucaps(folder).ground_points.role
    assert role[1].tolist() == [CONTROL] * 3  # 8033401, the first of the list
    assert role[2].tolist() == [CONTROL, CONTROL, NO_ROLE]
    assert role[6].tolist() == [NO_ROLE, NO_ROLE, CONTROL]


def test_line_ends_encoding_and_case_of_names_change_nothing(folder: Path) -> None:
    expected = content_digest(read_wucaps(folder), without=TRUTH)
    for path in list(folder.iterdir()):
        text = path.read_text().replace("\n", "\r\n") + "\x1a"
        path.unlink()
        (folder / path.name.swapcase()).write_bytes(text.encode("gb18030"))
    assert content_digest(read_wucaps(folder), without=TRUTH) == expected


def test_a_point_in_the_ground_file_without_a_role_keeps_its_coordinates(folder: Path) -> None:
    _edit(folder, "PRECPI.DAT", "      834000\n", "")
    block = read_wucaps(folder)
    row = block.points.id[block.ground_points.point].tolist().index("834000")
    assert block.ground_points.role[row].tolist() == [NO_ROLE] * 3
    assert np.isfinite(block.ground_points.xyz_m[row]).all()


@pytest.mark.parametrize(
    ("name", "old", "new", "line", "what"),
    [
        ("PRECAI.dat", "153.8400", "153,8400", ":2", "decimal comma"),
        ("PRECAI.dat", "153.8400", "-153.84", ":2", "principal distance -153.84"),
        ("PRECAI.dat", "1    4", "1    5", ":1", "5 fiducials announced, 4 found"),
        ("PRECAI.dat", "1    4", "2    4", ":1", "2 cameras"),
        ("PREPHI.DAT", "8.8199     76.0231", "8.8199", ":3", "2 words in photo 321"),
        ("PREPHI.DAT", "8.8199     76.0231", "8.8l99 76.0231", ":3", "not a number"),
        ("PREPHI.DAT", "        -319    0", "        -320    0", ":28", "photo 320 twice"),
        ("PREPHI.DAT", "        -319    0", "         319    0", ":40", "no last photo"),
        ("PRECKI.DAT", "   831000", "  8031901", ":4", "point 8031901 twice, first in line 1"),
        ("PRECKI.DAT", "446018.619", "446018.619 1 2", ":4", "6 words"),
        ("PRECPI.DAT", "8033401", "8033402", ":2", "did you mean '8033401'"),
        ("PRECPI.DAT", "4    0    0", "9    0    0", ":1", "9 control points announced, 7 ids follow"),
    ],
)
def test_a_malformed_line_is_named(folder: Path, name: str, old: str, new: str, line: str, what: str) -> None:
    path = _edit(folder, name, old, new)
    with pytest.raises(AatriError) as caught:
        read_wucaps(folder)
    assert caught.value.exit_code == 3
    assert f"{path}{line}: " in str(caught.value)
    assert what in str(caught.value)


def test_missing_files_and_folders_name_the_nearest(folder: Path) -> None:
    (folder / "PRECPI.DAT").rename(folder / "PRECPI_.DAT")
    with pytest.raises(InputError, match=r"did you mean 'PRECPI_\.DAT'"):
        read_wucaps(folder)
    with pytest.raises(InputError, match="did you mean 'rc30'"):
        read_wucaps(folder.parent / "rc31")


def test_the_stage_takes_its_options(folder: Path) -> None:
    block = wucaps(options=WucapsOptions(path=folder, image_sigma_um=8.0, control_sigma=0.2))
    assert (block.image_points.sigma_mm == 0.008).all()
    assert block.metrics()["control_points"] == 4
