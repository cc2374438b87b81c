"""Reading a block folder: units, axes, roles, defaults, canonical order."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import APPROXIMATE, CHECK, CONTROL, NO_ROLE, TRUTH, Block
from aatri.tables.digest import content_digest
from tests.formats.tables.block_folder import FILES, replaced, write_folder
from tests.reading import read_block


@pytest.fixture
def block(tmp_path: Path) -> Block:
    return read_block(write_folder(tmp_path / "block"))


def _digest(block: Block) -> str:
    return content_digest(block, without=TRUTH)


def test_ids_are_text_and_sorted_by_their_bytes(block: Block) -> None:
    assert block.points.id.tolist() == ["0123", "1", "2", "3", "K"]
    assert block.images.id.tolist() == ["a1", "a2", "d,1", "d2"]
    assert block.cameras.id.tolist() == ["007", "uav"]


def test_north_east_axes_come_out_as_east_north_with_their_covariances_and_roles(block: Block) -> None:
    ground = block.ground_points
    row = block.points.id[ground.point].tolist().index("1")
    assert ground.xyz_m[row].tolist() == [446363.976, 4505179.577, 7.378]
    # sX 1 cm is north, sY 2 cm is east, sXY 0.5 cm^2
    np.testing.assert_allclose(ground.covariance_m2[row], [[4e-4, 5e-5, 0], [5e-5, 1e-4, 0], [0, 0, 9e-4]], rtol=1e-15)
    plan = read_block_with_role(Path(str(block.files.path[0])).parent, "X:control Z:check")
    assert plan.ground_points.role[row].tolist() == [NO_ROLE, CONTROL, CHECK]


def read_block_with_role(folder: Path, role: str) -> Block:
    changes = replaced("ground_points.csv", "XY:control Z:check", role)
    return read_block(write_folder(folder.parent / "other", changes))


def test_roles_are_per_coordinate_and_an_empty_coordinate_has_none(block: Block) -> None:
    role = dict(zip(block.points.id[block.ground_points.point].tolist(), block.ground_points.role.tolist()))
    assert role["K"] == [CONTROL] * 3
    assert role["1"] == [CONTROL, CONTROL, CHECK]
    assert role["2"] == [CONTROL, CONTROL, NO_ROLE]
    assert role["3"] == [CHECK] * 3
    assert role["0123"] == [NO_ROLE, NO_ROLE, APPROXIMATE]
    assert np.isnan(block.ground_points.xyz_m[0, :2]).all()


def test_sigma_zero_is_exact_and_an_empty_sigma_takes_the_default(block: Block) -> None:
    covariance = dict(zip(block.points.id[block.ground_points.point].tolist(), block.ground_points.covariance_m2))
    assert not covariance["K"].any()
    # default control: [2, 3, 4] cm for north, east, up
    np.testing.assert_allclose(np.diag(covariance["2"]), [9e-4, 4e-4, 0.0], rtol=1e-15)


def test_image_and_fiducial_sigmas_are_in_mm(block: Block) -> None:
    assert sorted({float(s) for s in block.image_points.sigma_mm.ravel()}) == [0.004, 0.005]
    assert sorted({float(s) for s in block.fiducial_points.sigma_mm.ravel()}) == [0.002, 0.003]


def test_sigma_in_pixels_uses_the_pixel_size_of_the_camera(tmp_path: Path) -> None:
    changes = replaced("block.yaml", "sigma_image: um", "sigma_image: px")
    changes["block.yaml"] = str(changes["block.yaml"]).replace("format: [230, 230]", "pixel: {size: [0.021, 0.02]}")
    block = read_block(write_folder(tmp_path / "block", changes))
    digital = block.image_points.image >= 2
    np.testing.assert_allclose(block.image_points.sigma_mm[digital], 5 * 0.0033, rtol=1e-15)
    np.testing.assert_allclose(block.image_points.sigma_mm[0], [5 * 0.021, 5 * 0.02], rtol=1e-15)


def test_exterior_is_observed_where_a_sigma_is_given_else_approximate(block: Block) -> None:
    rows = block.exterior
    assert rows.position_use.tolist() == [1, 0, 0, 1]
    assert rows.angle_use.tolist() == [0, 0, 1, 1]
    assert rows.refers_to.tolist() == [1, 0, 0, 0]
    np.testing.assert_allclose(rows.angles_rad[3], np.array([1, 2, 3]) * math.pi / 200, rtol=1e-15)
    np.testing.assert_allclose(rows.angle_sigma_rad[3], np.array([5, 5, 10]) * math.pi / 200e3, rtol=1e-15)
    assert np.isnan(rows.angle_sigma_rad[1]).all()


def test_degrees_minutes_seconds(tmp_path: Path) -> None:
    yaml = FILES["block.yaml"].replace("angle: gon", "angle: dms")
    exterior = "image,a1,a2,a3\na1,0-30-00,-1-15-36,90-0-0\n"
    geodetic = "type,from,to,value,sigma\nazimuth,K,1,45-30-0.0,0-0-5\n"
    changes = {
        "block.yaml": yaml,
        "exterior.csv": exterior,
        "geodetic.csv": geodetic,
        "covariances.csv": None,
        "relative_control.yaml": None,
        **replaced("image_points.csv", ",no\n", ",\n"),
    }
    block = read_block(write_folder(tmp_path / "block", changes))
    np.testing.assert_allclose(np.degrees(block.exterior.angles_rad[0]), [0.5, -1.26, 90.0], rtol=1e-14)
    assert math.degrees(block.geodetic.value[0]) == pytest.approx(45.5, rel=1e-15)
    assert math.degrees(block.geodetic.sigma[0]) * 3600 == pytest.approx(5.0, rel=1e-14)


def test_coordinate_differences_follow_the_axes_of_the_frame(block: Block) -> None:
    value = dict(zip(block.geodetic.type.tolist(), block.geodetic.value.tolist()))
    assert (value["dY"], value["dX"]) == (100.001, 100.002)
    rows = block.geodetic_covariances
    types = {str(block.geodetic.type[rows.row_a[0]]), str(block.geodetic.type[rows.row_b[0]])}
    assert types == {"dX", "dY"}
    assert block.relative_control.axis.tolist() == ["", "Y", "", "", "", ""]


def test_camera_parameters_say_what_is_fixed_weighted_and_free(block: Block) -> None:
    rows = block.camera_parameters
    found = {n: (s, bool(f)) for n, s, f in zip(rows.name.tolist(), rows.sigma.tolist(), rows.free)}
    assert found["k1"] == (1e-7, False)
    assert found["k2"] == (0.0, False)
    assert math.isnan(found["principal_distance"][0])
    assert found["principal_distance"][1]
    assert found["principal_point.x"] == (0.01, False)
    np.testing.assert_allclose(block.distortion_table.correction_mm, [0, 0.0011, -0.0023], rtol=1e-15)


def test_a_point_measured_twice_counts_twice_if_equal_within_six_sigma(block: Block) -> None:
    two = (block.image_points.image == 1) & (block.points.id[block.image_points.point] == "2")
    assert two.sum() == 2
    assert block.image_points.active[two].all()


def test_every_row_keeps_its_file_and_line(block: Block) -> None:
    rows = block.images
    assert [Path(str(block.files.path[f])).name for f in rows.file] == ["images.csv"] * 4
    assert rows.line.tolist() == [4, 3, 5, 6]


def test_the_order_of_rows_and_columns_changes_nothing(tmp_path: Path, block: Block) -> None:
    changes: dict[str, str | bytes | None] = {}
    for name in ("images.csv", "image_points.csv", "fiducials.csv", "ground_points.csv", "exterior.csv"):
        lines = [line for line in FILES[name].splitlines() if not line.startswith("#")]
        changes[name] = "\n".join([lines[0], *reversed(lines[1:])]) + "\n"
    changes["relative_control.yaml"] = "\n".join(reversed(FILES["relative_control.yaml"].splitlines()))
    changes["images.csv"] = str(changes["images.csv"]).replace("x_note", "x_remark")
    assert _digest(read_block(write_folder(tmp_path / "again", changes))) == _digest(block)


@pytest.mark.parametrize("ending", ["\r\n", "\r"])
def test_line_ends_and_byte_order_mark_change_nothing(tmp_path: Path, block: Block, ending: str) -> None:
    changes: dict[str, str | bytes | None] = {
        name: b"\xef\xbb\xbf" + text.rstrip("\n").replace("\n", ending).encode()
        for name, text in FILES.items()
        if name.endswith(".csv")
    }
    assert _digest(read_block(write_folder(tmp_path / "again", changes))) == _digest(block)


def test_optional_tables_may_be_absent(tmp_path: Path) -> None:
    only = {name: None for name in FILES if name not in ("block.yaml", "images.csv", "image_points.csv")}
    changes = replaced("image_points.csv", 'K,"d,1",700,900,,,,\n', "")
    changes["image_points.csv"] = str(changes["image_points.csv"]).replace(",no\n", ",\n")
    block = read_block(write_folder(tmp_path / "block", {**only, **changes}))
    assert len(block.ground_points) == len(block.exterior) == len(block.geodetic) == 0
    assert len(block.rejects) == 0


def test_chinese_ids_are_read_from_utf8_and_gb18030(tmp_path: Path) -> None:
    for encoding in ("utf-8", "gb18030"):
        changes: dict[str, str | bytes | None] = {
            name: text.replace("d,1", "像片一").encode(encoding)
            for name, text in FILES.items()
            if name.endswith(".csv")
        }
        block = read_block(write_folder(tmp_path / encoding, changes))
        assert "像片一" in block.images.id.tolist()


def test_a_geodetic_network_needs_no_images(tmp_path: Path) -> None:
    folder = tmp_path / "net"
    folder.mkdir()
    (folder / "block.yaml").write_text("aatri_block: 1\nframes: {f: {axes: [east, north, up]}}\n")
    (folder / "ground_points.csv").write_text("point,X,Y,Z,sX,sY,sZ\nA,0,0,0,0,0,0\nB,,,,,,\n")
    (folder / "geodetic.csv").write_text("type,from,to,value,sigma\ndZ,A,B,1.5,0.001\n")
    block = read_block(folder)
    assert block.geodetic.value.tolist() == [1.5]
    assert block.earth_curvature == "ignore"


def test_what_looks_odd_is_pointed_out(tmp_path: Path) -> None:
    ground = FILES["ground_points.csv"] + "K2,4505079.577,446263.980,6.378,1,1,5e5,,,\n"
    images = FILES["images.csv"] + "A1,uav,,,,,\n"
    points = FILES["image_points.csv"] + "".join(f"{p},A1,{k},5,,,,\n" for k, p in enumerate("123"))
    changes = {"ground_points.csv": ground, "images.csv": images, "image_points.csv": points, "pionts.csv": "a\n"}
    listener = Listener()
    read_block(write_folder(tmp_path / "block", changes), listener)
    warned = "\n".join(listener.warned)
    assert "control points K and K2 are 0.004 m apart" in warned
    assert "sZ is 5000 m; check units.sigma_ground" in warned
    assert "'a1' and 'A1' differ in case only" in warned
    assert "pionts.csv: not a table of a block" in warned
    assert "rejected: ground_point K2: seen in no image" in warned


class Listener:
    """A reporter that keeps its warnings."""

    def __init__(self) -> None:
        self.warned: list[str] = []

    def log(self, message: str) -> None:
        pass

    def warn(self, message: str) -> None:
        self.warned.append(message)

    def progress(self, done: int, total: int, what: str = "") -> None:
        pass


def test_check_points_without_standard_deviations_take_the_default_as_control_does(block: Block) -> None:
    """Point 3 is a check point with empty cells; north, east, up of the table with 2, 3, 4 cm."""
    row = int(np.flatnonzero(block.points.id[block.ground_points.point] == "3")[0])
    sigma = np.sqrt(np.diag(block.ground_points.covariance_m2[row]))
    np.testing.assert_allclose(sigma, [0.03, 0.02, 0.04])
