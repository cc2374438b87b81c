"""Screening, just inside and just outside each of its limits, on blocks of bare ids and coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import yaml

from aatri.artifacts.block import Block
from aatri.errors import AatriError, Errors, InputError
from aatri.progress import Silent
from tests.reading import read_block

FILM = {"kind": "film", "image_coordinates": "photo", "format": [230, 180], "principal_distance": 150.0}
PIXEL = {"kind": "digital", "image_coordinates": "pixel", "format": [6000, 4000], "principal_distance": 50.0}


@dataclass
class Written:
    """Rows of a block folder: images that all see p0 ... p9; or `halves`, of which the second sees q0 ... q9."""

    camera: Mapping[str, Any] = field(default_factory=lambda: FILM)
    images: list[str] = field(default_factory=lambda: [f"i{k}" for k in range(4)])
    points: list[str] = field(default_factory=list)
    ground: list[str] = field(default_factory=list)
    exterior: list[str] = field(default_factory=list)
    geodetic: list[str] = field(default_factory=list)
    halves: bool = False

    def __post_init__(self) -> None:
        if not self.points:
            half = len(self.images) // 2 if self.halves else len(self.images)
            self.points = [
                f"{image},{'p' if i < half else 'q'}{k},{10 + k},{10 + k - i / 8}"
                for i, image in enumerate(self.images)
                for k in range(10)
            ]

    def read(self, folder: Path, reporter: Any = None) -> Block:
        about = {
            "aatri_block": 1,
            "name": "s",
            "frames": {"map": {"axes": ["east", "north", "up"], "crs": "local"}},
            "earth_curvature": "ignore",
            "units": {"sigma_image": "um", "sigma_ground": "m", "ground": "m", "angle": "deg"},
            "sigma": {"image": 5, "control": [1, 1, 1], "position": [1, 1, 1]},
            "cameras": {"c": {**self.camera, "distortion": {"model": "none"}}},
        }
        (folder / "block.yaml").write_text(yaml.safe_dump(about))
        write(folder / "images.csv", "image,camera", [f"{i},c" for i in self.images])
        write(
            folder / "image_points.csv",
            "image,point,x,y,sx,sy,active",
            [p + "," * (6 - p.count(",")) for p in self.points],
        )
        write(folder / "ground_points.csv", "point,X,Y,Z,role", self.ground)
        if self.exterior:
            write(folder / "exterior.csv", "image,X,Y,Z,use", self.exterior)
        if self.geodetic:
            write(folder / "geodetic.csv", "type,from,to,value,sigma,active", self.geodetic)
        return read_block(folder, reporter or Silent())


def write(path: Path, head: str, rows: Sequence[str]) -> None:
    path.write_text("\n".join([head, *rows]) + "\n")


def rejects(block: Block) -> list[tuple[str, str, str]]:
    return list(zip(block.rejects.kind.tolist(), block.rejects.id.tolist(), block.rejects.reason.tolist()))


def messages(error: pytest.ExceptionInfo[AatriError]) -> list[str]:
    found = error.value
    return [one.what for one in found.errors] if isinstance(found, Errors) else [found.what]


# Rule 1: 5 % of the format beyond it


@pytest.mark.parametrize(("axis", "limit"), [(0, 126.5), (1, 99.0)])  # 115 + 5 % of 230; 90 + 5 % of 180
@pytest.mark.parametrize("sign", [1, -1])
def test_a_photo_point_may_lie_a_twentieth_of_the_format_outside(
    tmp_path: Path, axis: int, limit: float, sign: int
) -> None:
    for beyond, expected in ((-1e-6, []), (1e-6, [("image_point", "i1/p3", "outside the image format")])):
        of = Written()
        xy = [13.0, 12.875]
        xy[axis] = sign * (limit + beyond)
        of.points[13] = f"i1,p3,{xy[0]!r},{xy[1]!r}"
        block = of.read(tmp_path)
        assert rejects(block) == expected
        assert block.image_points.active.sum() == 40 - len(expected)


@pytest.mark.parametrize(
    ("origin", "low", "high"),
    [
        ("top-left-corner", (-300.0, -200.0), (6300.0, 4200.0)),
        ("top-left-centre", (-300.0, -200.0), (6300.0, 4200.0)),
        ("bottom-left-corner", (-300.0, -200.0), (6300.0, 4200.0)),
        ("image-centre", (-3300.0, -2200.0), (3300.0, 2200.0)),
    ],
)
@pytest.mark.parametrize("axis", [0, 1])
def test_a_pixel_point_may_lie_as_much_outside_from_its_own_origin(
    tmp_path: Path, origin: str, low: tuple[float, float], high: tuple[float, float], axis: int
) -> None:
    camera = {**PIXEL, "pixel": {"size": 0.005, "origin": origin, "y": "down"}}
    for value, is_out in (
        (low[axis] + 0.1, False),
        (low[axis] - 0.1, True),
        (high[axis] - 0.1, False),
        (high[axis] + 0.1, True),
    ):
        of = Written(camera)
        of.points[29] = "i2,p9,2500,1500"  # all in a corner would be another unit
        xy = [13.0, 12.875]
        xy[axis] = value
        of.points[13] = f"i1,p3,{xy[0]!r},{xy[1]!r}"
        assert len(rejects(of.read(tmp_path))) == is_out


def test_comparator_coordinates_have_no_outside(tmp_path: Path) -> None:
    of = Written({**FILM, "image_coordinates": "comparator", "fiducials": {"1": [1.0, 1.0], "2": [-1.0, 1.0]}})
    of.points = [p.replace(",1", ",9001", 1) if p.startswith("i1,p3") else p for p in of.points]
    assert rejects(of.read(tmp_path)) == []


def test_what_the_file_has_switched_off_is_no_reject(tmp_path: Path) -> None:
    of = Written()
    of.points[13] = "i1,p3,1000,1000,,,no"
    block = of.read(tmp_path)
    assert rejects(block) == []
    assert block.image_points.active.sum() == 39


@pytest.mark.parametrize(("out", "is_refused"), [(2, False), (3, True)])
def test_a_twentieth_of_the_image_points_may_lie_outside(tmp_path: Path, out: int, is_refused: bool) -> None:
    of = Written()
    for k in range(out):
        of.points[3 + 11 * k] = ",".join([*of.points[3 + 11 * k].split(",")[:2], "500", "0"])
    if not is_refused:
        assert len(rejects(of.read(tmp_path))) == out
        return
    with pytest.raises(AatriError, match="3 of 40 image points: outside the image format; at most 5%") as error:
        of.read(tmp_path)
    assert len(messages(error)) == 1  # not also what follows from it
    assert "i0/p3" in messages(error)[0]
    assert "image_points.csv:5" in messages(error)[0]


# Rule 2: points seen once


def test_a_point_seen_once_goes_unless_something_else_determines_it(tmp_path: Path) -> None:
    of = Written(halves=True)
    of.points += ["i0,once,1,1", "i1,control,2,2", "i2,plan,3,3", "i0,far,8,8", "i0,near,9,9"]
    of.ground = ["control,1,2,3,", "plan,1,2,4,XY:check Z:control"]
    of.geodetic = ["distance,near,far,100,0.01,"]
    block = of.read(tmp_path)
    assert rejects(block) == [("image_point", "i0/once", "seen in one image only")]


@pytest.mark.parametrize("role", ["check", "approximate", "ignore"])
def test_a_check_point_or_a_start_value_does_not_keep_a_point_seen_once(tmp_path: Path, role: str) -> None:
    of = Written(halves=True)
    of.points += ["i0,once,1,1"]
    of.ground = [f"once,1,2,3,{role}"]
    found = rejects(of.read(tmp_path))
    assert ("image_point", "i0/once", "seen in one image only") in found
    assert (("ground_point", "once", "seen in no image") in found) == (role == "check")


def test_a_distance_that_is_switched_off_keeps_no_point(tmp_path: Path) -> None:
    of = Written(halves=True)
    of.points += ["i0,once,1,1"]
    of.geodetic = ["distance,once,p1,100,0.01,no", "distance,p2,p1,100,0.01,"]
    assert ("image_point", "i0/once", "seen in one image only") in rejects(of.read(tmp_path))


def test_twice_in_one_image_is_seen_once(tmp_path: Path) -> None:
    of = Written(halves=True)
    of.points += ["i0,once,1,1", "i0,once,1,1.001"]
    found = rejects(of.read(tmp_path))
    assert found == [("image_point", "i0/once", "seen in one image only")] * 2


@pytest.mark.parametrize("single", [1, 2, 9])
def test_any_number_of_points_may_be_seen_once(tmp_path: Path, single: int) -> None:
    of = Written(halves=True)
    of.points += [f"i2,s{k},{k},{k}" for k in range(single)]
    of.ground = ["unseen,1,2,3,"]
    found = rejects(of.read(tmp_path))
    assert [name for kind, name, _ in found if kind == "image_point"] == [f"i2/s{k}" for k in range(single)]


def test_ids_that_agree_in_no_two_images_leave_no_image_and_are_an_error(tmp_path: Path) -> None:
    of = Written()
    of.points = [of.points[0], *(row.replace(",", f",of_{row.split(',')[0]}_", 1) for row in of.points[1:])]
    with pytest.raises(AatriError, match=r"no image is left: .*seen in one image only") as error:
        of.read(tmp_path)
    assert "same id in all images" in error.value.remedy


# Rule 3: images with too few points


def test_known_points_that_no_image_shows_are_listed_and_keep_their_role(tmp_path: Path) -> None:
    of = Written()
    of.ground = ["a,1,2,3,control", "b,1,2,4,check", "c,1,2,3,approximate", "p1,1,2,5,control", "d,1,2,6,control"]
    of.geodetic = ["distance,d,p1,100,0.01,"]
    block = of.read(tmp_path)
    assert rejects(block) == [("ground_point", "a", "seen in no image"), ("ground_point", "b", "seen in no image")]
    assert block.rejects.line.tolist() == [2, 3]
    assert (block.ground_points.role[:, 0] == [1, 2, 3, 1, 1]).all()


# Repeated measurements


@pytest.mark.parametrize(
    ("sigmas", "limit_mm"),
    [(",,", 0.006 * 5 * 2**0.5), (",3,3", 0.006 * (25 + 9) ** 0.5)],
)
@pytest.mark.parametrize("axis", [0, 1])
def test_two_measurements_may_differ_by_six_sigmas_of_their_difference(
    tmp_path: Path, sigmas: str, limit_mm: float, axis: int
) -> None:
    for factor, is_refused in ((0.999, False), (1.001, True)):
        of = Written()
        xy = [13.0, 12.875]
        xy[axis] += factor * limit_mm
        of.points.append(f"i1,p3,{xy[0]!r},{xy[1]!r}{sigmas if sigmas != ',,' else ''}")
        if not is_refused:
            block = of.read(tmp_path)
            assert block.image_points.active.sum() == 41  # both count
            continue
        with pytest.raises(InputError, match=r"image point i1/p3 measured twice, 0\.0[345]") as error:
            of.read(tmp_path)
        assert error.value.where.endswith("image_points.csv:42")
        assert "image_points.csv:15" in error.value.what


def test_sigmas_of_pixels_are_millimetres_on_the_image(tmp_path: Path) -> None:
    """5 um are one pixel of 0.005 mm: two measurements may be 6 * sqrt(2) pixels apart."""
    camera = {**PIXEL, "pixel": {"size": 0.005, "origin": "top-left-corner", "y": "down"}}
    for apart, is_refused in ((8.48, False), (8.49, True)):
        of = Written(camera)
        of.points[29] = "i2,p9,2500,1500"
        of.points.append(f"i1,p3,{13 + apart},13")
        if is_refused:
            with pytest.raises(InputError, match=r"measured twice, 8\.49 (px|mm) apart"):
                of.read(tmp_path)
        else:
            of.read(tmp_path)


def test_a_measurement_that_is_switched_off_disagrees_with_nothing(tmp_path: Path) -> None:
    of = Written()
    of.points.append("i1,p3,90,90,,,no")
    assert rejects(of.read(tmp_path)) == []


def test_of_many_faults_the_first_twenty_are_shown_and_the_rest_counted(tmp_path: Path) -> None:
    of = Written()
    for k in range(25):
        of.points[k] = ",".join([*of.points[k].split(",")[:2], "500", str(k)])
    with pytest.raises(AatriError, match="25 of 40 image points") as error:
        of.read(tmp_path)
    (what,) = messages(error)
    assert what.count("image_points.csv:") == 20
    assert "and 5 more" in what
