"""Figures of a block folder, just inside and just outside what is allowed; warnings, just below and just above."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.progress import Silent
from tests.formats.tables.block_folder import FILES, replaced, write_folder
from tests.reading import read_block

YAML, POINTS, GROUND, EXTERIOR = "block.yaml", "image_points.csv", "ground_points.csv", "exterior.csv"
GEODETIC, RELATIVE, COVARIANCES = "geodetic.csv", "relative_control.yaml", "covariances.csv"

LIMITS: dict[str, tuple[str, str, str, str, str]] = {
    # case: file, text replaced, a text that is allowed, one that is not, what is said of it
    "principal distance": (YAML, "24.01", "1e-9", "0", "greater than 0"),
    "format": (YAML, "[6000, 4000]", "[6000, 3911]", "[6000, 0]", "greater than 0"),
    "pixel size": (YAML, "size: 0.0033", "size: 1e-9", "size: 0", "greater than 0"),
    "default image sigma": (YAML, "image: 5", "image: 0.5", "image: 0", "greater than 0"),
    "default fiducial sigma": (YAML, "fiducial: 2", "fiducial: 1e-9", "fiducial: 0", "greater than 0"),
    "default control sigma": (YAML, "[2, 3, 4]", "[0, 0, 0]", "[2, 3, -1e-9]", "greater than or equal to 0"),
    "default position sigma": (YAML, "[10, 10, 20]", "[0, 10, 20]", "[-1e-9, 10, 20]", "greater than or equal to 0"),
    "three default sigmas": (YAML, "[2, 3, 4]", "7", "[2, 3]", "3 items"),
    "camera sigma": (YAML, "k2: 0}", "k2: .inf}", "k2: -1e-9}", "greater than or equal to 0"),
    "camera sigma list": (YAML, "[0.01, 0.01]", "0.01", "[0.01]", "2 values"),
    "radius": (YAML, "radius: [0, 50, 100]", "radius: [0, 50, 50.001]", "radius: [-0.001, 50, 100]", "greater"),
    "radii ascend": (YAML, "radius: [0, 50, 100]", "radius: [0, 1e-9, 100]", "radius: [0, 50, 50]", "ascend"),
    "radii and corrections": (YAML, "[0, 1.1, -2.3]", "[0, 1.1, 0]", "[0, 1.1]", "3 radii, but 2 corrections"),
    "image sigma": (POINTS, "4,4", "1e-9,4", "4,0", "more than 0"),
    "fiducial sigma": ("fiducials.csv", "4.3,3", "4.3,1e-9", "4.3,0", "more than 0"),
    "ground sigma": (GROUND, "7.378,1,2,3,0.5", "7.378,1,2,0,0.5", "7.378,1,2,-1e-9,0.5", "0 (exact) or more"),
    "square of a ground sigma": (
        GROUND,
        "7.378,1,2,3,0.5",
        "7.378,1,2,1e-12,",
        "7.378,1,2,1e-200,",
        "too small for a quantity",
    ),
    "square of a geodetic sigma": (
        "geodetic.csv",
        "1,2,141.42,0.003",
        "1,2,141.42,1e-12",
        "1,2,141.42,1e-200",
        "sigma is '1e-200': too small for a quantity",
    ),
    "square of a default sigma": (YAML, "[2, 3, 4]", "[2, 3, 1e-12]", "[2, 3, 1e-200]", "too small for a quantity"),
    "covariance of two coordinates": (GROUND, "1,2,3,0.5", "1,2,3,1.999999", "1,2,3,2.00001", "negative eigenvalue"),
    "position sigma": (EXTERIOR, "385.1,5,5,8", "385.1,5,5,0", "385.1,5,5,-1e-9", "0 (exact) or more"),
    "geodetic sigma": (GEODETIC, "141.42,0.003", "141.42,1e-9", "141.42,0", "more than 0"),
    "row of a covariance": (COVARIANCES, "4,5,1e-6", "5,4,1e-6", "0,5,1e-6", "rows 1 to 7"),
    "last row of a covariance": (COVARIANCES, "4,5,1e-6", "4,5,-1e-6", "4,8,1e-6", "rows 1 to 7"),
    "size of a covariance": (COVARIANCES, "1e-6", "3.999e-6", "4.001e-6", "not positive definite"),
    "sigma of a condition": (RELATIVE, "sigma: 0.0002", "sigma: 1e-9", "sigma: 0", "more than 0"),
    "value of a condition": (RELATIVE, "200.05", "99999999999999999999", "1e101", "too large"),
    "points of a plane": (RELATIVE, '["1", "2", "3"]', '["1", "2", K, "3"]', '["1", "2"]', "at least 3"),
    "points of a distance": (RELATIVE, "[K, 0123]", "[0123, K]", "[K, 0123, 2]", "exactly 2"),
    "points of a sphere": (RELATIVE, "[K, 1, 2, 3]", "[K, 1, 2, 3, 0123]", "[K, 1, 2]", "at least 4"),
    "pairs": (RELATIVE, "[[K, 1], [2, 3]]", "[[K, 2], [1, 3]]", "[[K, 1], [2]]", "4"),
    "a member twice": (RELATIVE, "[K, 1, 2, 3]", "[K, 1, 3, 2]", "[K, 1, 2, 2]", "twice"),
    "axis": (RELATIVE, "axis: X", "axis: Z", "axis: W", "axis is 'W'"),
    "exact": (
        RELATIVE,
        "radius: 1000, sigma: 0.01",
        "radius: 1000, exact: true",
        "radius: 1000, sigma: 0.01, exact: true",
        "either `sigma` or `exact: true`",
    ),
    "longest id": (POINTS, "1,a1,10.5", f"{'b' * 255},a1,10.5", f"{'b' * 256},a1,10.5", "255 bytes"),
    "undulation": (YAML, "terrain_height: 6.1", "undulation: -120.0", "undulation: -120.001", "greater than or equal"),
    "undulation above": (YAML, "terrain_height: 6.1", "undulation: 120.0", "undulation: 120.001", "less than or equal"),
    "mount": (YAML, "lever_arm: [0.1, 0.0, -0.3]", "mount: 270", "mount: 360", "mount"),
}


@pytest.mark.parametrize("case", LIMITS)
def test_a_figure_is_taken_up_to_its_limit_and_no_farther(tmp_path: Path, case: str) -> None:
    name, old, inside, outside, what = LIMITS[case]
    if case == "longest id":  # a point seen in one image goes its own way; here it need only be read
        inside, outside = inside + ",1,,,,\n" + inside.replace("a1", "a2"), outside
    read_block(write_folder(tmp_path / "inside", replaced(name, old, inside)))
    with pytest.raises(AatriError, match=what.replace("(", r"\(").replace(")", r"\)").replace("`", ".")):
        read_block(write_folder(tmp_path / "outside", replaced(name, old, outside)))


class Heard(Silent):
    """Keeps warnings."""

    def __init__(self) -> None:
        self.warned: list[str] = []

    def warn(self, message: str) -> None:
        self.warned.append(message)


def warnings_of(folder: Path, changes: dict[str, str | bytes | None]) -> list[str]:
    heard = Heard()
    read_block(write_folder(folder, changes), heard)
    return heard.warned


@pytest.mark.parametrize(
    ("sigma_cm", "is_odd"), [("0.01", False), ("0.00999", True), ("99999", False), ("100001", True), ("0", False)]
)
def test_sigmas_below_a_tenth_of_a_millimetre_or_above_a_kilometre_are_pointed_out(
    tmp_path: Path, sigma_cm: str, is_odd: bool
) -> None:
    changes = replaced(GROUND, "7.378,1,2,3,0.5", f"7.378,1,2,{sigma_cm},")
    said = [line for line in warnings_of(tmp_path / "block", changes) if "check units.sigma_ground" in line]
    assert len(said) == is_odd
    if is_odd:
        assert "ground_points.csv:3:" in said[0]
        assert f"sZ is {float(sigma_cm) / 100:g} m" in said[0]


@pytest.mark.parametrize(("apart_m", "is_told"), [(0.16, True), (0.162, False)])
def test_control_points_nearer_than_three_sigmas_are_pointed_out(tmp_path: Path, apart_m: float, is_told: bool) -> None:
    """sigmas of 2, 3, 4 cm: sqrt(29) = 5.385 cm each point; the exact one adds none: 3 * 5.385 cm = 0.1616 m."""
    row = f"copy,4505079.577,446263.976,{6.378 + apart_m!r},2,3,4,,,\n"
    said = warnings_of(tmp_path / "block", {GROUND: FILES[GROUND] + row})
    assert any("one place?" in line and "copy" in line and "K" in line for line in said) == is_told


def test_units_reach_every_column(tmp_path: Path) -> None:
    """cm, mgon, gon, ms and dm beside what the folder has; worked out by hand."""
    block = read_block(write_folder(tmp_path / "block"))
    ground = {block.points.id[p]: k for k, p in enumerate(block.ground_points.point)}
    np.testing.assert_allclose(
        block.ground_points.covariance_m2[ground["1"]], [[4e-4, 0.5e-4, 0], [0.5e-4, 1e-4, 0], [0, 0, 9e-4]], atol=1e-18
    )
    assert block.ground_points.xyz_m[ground["K"]].tolist() == [446263.976, 4505079.577, 6.378]  # east, north, up
    assert block.ground_points.role[ground["1"]].tolist() == [1, 1, 2]
    assert block.ground_points.datum.tolist().count(True) == 1
    images = block.images.id.tolist()
    exterior = {images[i]: k for k, i in enumerate(block.exterior.image)}
    gon = np.pi / 200
    np.testing.assert_allclose(block.exterior.angles_rad[exterior["a2"]], np.array([0.1, 0.2, -399.9]) * gon)
    np.testing.assert_allclose(block.exterior.angle_sigma_rad[exterior["d,1"]], np.array([4, 4, 6]) * 1e-3 * gon)
    np.testing.assert_allclose(block.exterior.position_covariance_m2[exterior["a1"]], np.diag([25, 25, 64]) * 1e-4)
    assert np.isnan(block.exterior.position_covariance_m2[exterior["a2"]]).all()  # a start value
    np.testing.assert_allclose(block.exterior.angle_sigma_rad[exterior["d2"]], np.array([5, 5, 10]) * 1e-3 * gon)
    assert block.exterior.position_use[[exterior[i] for i in ("a1", "a2", "d,1", "d2")]].tolist() == [1, 0, 0, 1]
    assert block.exterior.angle_use[[exterior[i] for i in ("a1", "a2", "d,1", "d2")]].tolist() == [0, 0, 1, 1]
    assert block.exterior.refers_to[[exterior[i] for i in ("a1", "a2")]].tolist() == [1, 0]
    geodetic = dict(
        zip(block.geodetic.type.tolist(), zip(block.geodetic.value.tolist(), block.geodetic.sigma.tolist()))
    )
    assert geodetic["angle"] == pytest.approx((100.5 * gon, 0.0003 * gon))
    assert geodetic["height_difference"] == (378.7, 0.01)
    np.testing.assert_allclose(block.image_points.sigma_mm.min(), 0.004)
    np.testing.assert_allclose(block.fiducial_points.sigma_mm[:, 0].max(), 0.003)
    np.testing.assert_allclose(block.cameras.boresight_rad[1], np.array([0.1, 0, -0.05]) * gon)
    np.testing.assert_allclose(block.distortion_table.correction_mm, [0, 1.1e-3, -2.3e-3])
    changes = replaced(
        YAML,
        "ground: m, angle: gon, sigma_image: um, sigma_ground: cm, sigma_angle: mgon, time: s",
        "ground: dm, angle: deg, sigma_image: mm, sigma_ground: mm, sigma_angle: arcsec, time: ms",
    )
    other = read_block(write_folder(tmp_path / "other", changes))
    np.testing.assert_allclose(other.ground_points.xyz_m[ground["K"]], [44626.3976, 450507.9577, 0.6378])
    np.testing.assert_allclose(other.exterior.angles_rad[exterior["a2"]], np.radians([0.1, 0.2, -399.9]))
    np.testing.assert_allclose(other.exterior.angle_sigma_rad[exterior["d,1"]], np.radians(np.array([4, 4, 6]) / 3600))
    np.testing.assert_allclose(other.ground_points.covariance_m2[ground["1"]][0, 0], 4e-6)
    np.testing.assert_allclose(other.image_points.sigma_mm.min(), 4.0)
    assert other.images.time_s[images.index("a1")] == pytest.approx(0.0105)
    lengths = dict(zip(other.geodetic.type.tolist(), other.geodetic.value.tolist()))
    assert lengths["height_difference"] == pytest.approx(37.87)


def test_images_of_a_strip_without_sequence_stand_in_the_order_of_their_times(tmp_path: Path) -> None:
    """a1 was taken ten seconds before a2, whatever their order in the table."""
    changes = replaced("images.csv", "a2,007,s1,2,20.5", "a2,007,s1,,20.5")
    changes["images.csv"] = str(changes["images.csv"]).replace("a1,007,s1,1,10.5", "a1,007,s1,,10.5")
    heard = Heard()
    block = read_block(write_folder(tmp_path / "block", changes), heard)
    of_strip = block.images.strip >= 0
    assert block.images.id[of_strip].tolist() == ["a1", "a2"]
    assert block.images.sequence[of_strip].tolist() == [10.5, 20.5]
    assert not [text for text in heard.warned if "no sequence" in text]
    half = str(changes["images.csv"]).replace("a1,007,s1,,10.5", "a1,007,s1,,")
    assert [
        t for t in warnings_of(tmp_path / "half", {"images.csv": half}) if "2 images of strips have no sequence" in t
    ]
