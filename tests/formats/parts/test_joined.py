"""Several sources as one block: names, what comes before what, conflicts with both places, where each row is from."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.codes import APPROXIMATE, CHECK, CONTROL, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import Reading
from aatri.formats.registry.recognised import recognised
from aatri.formats.registry.sources import read_source
from aatri.progress import SILENT
from tests.formats.parts.made_parts import camera, ground, images, positions


class Heard:
    """Keeps what is told."""

    def __init__(self) -> None:
        self.logs: list[str] = []
        self.warnings: list[str] = []

    def log(self, message: str) -> None:
        self.logs.append(message)

    def warn(self, message: str) -> None:
        self.warnings.append(message)

    def progress(self, done: int, total: int, what: str = "") -> None:
        """Nothing."""


def join(*sources: BlockParts) -> tuple[Block, Heard]:
    heard = Heard()
    return assembled(list(sources), reporter=heard), heard


def test_images_are_the_same_without_folder_extension_and_case() -> None:
    block, heard = join(
        images("f/IMG_1.JPG", "f/IMG_2.JPG"), camera("cam"), positions("gps.txt", "img_2.tif", "IMG_1.JPG", "IMG_9.JPG")
    )
    assert block.images.id[block.exterior.image].tolist() == ["f/IMG_1.JPG", "f/IMG_2.JPG"]
    np.testing.assert_array_equal(block.exterior.position_m[:, 0], [10.0, 0.0])
    assert "gps.txt: 1 image names matched by without folder" in heard.logs
    assert "gps.txt: 1 image names matched by without folder and extension, whatever the case" in heard.logs
    assert heard.warnings == ["gps.txt: 1 of its 3 images are not in the block, and are left out: IMG_9.JPG"]


def test_a_name_that_could_be_two_is_matched_with_neither_and_told() -> None:
    block, heard = join(images("a/1.JPG", "b/1.JPG", "2.JPG"), camera("cam"), positions("gps.txt", "1.JPG", "2.JPG"))
    assert block.images.id[block.exterior.image].tolist() == ["2.JPG"]
    assert any("that could be the same without folder: 1.JPG, a/1.JPG, b/1.JPG" in text for text in heard.warnings)


def test_names_that_match_nothing_at_all_are_an_error() -> None:
    with pytest.raises(InputError, match=r"gps.txt: none of its 2 image names is one of the block: X, Y; there: a, b"):
        join(images("a", "b"), camera("cam"), positions("gps.txt", "X", "Y"))


def test_lists_of_image_points_of_one_format_add_their_images_and_others_do_not() -> None:
    """SOCET has a file of an image, IGN one of ties and one of control: the second was refused, or lost rays."""
    lists = [images(*names, file=f"{k}.txt") for k, names in enumerate((("a.tif", "b"), ("A", "c"), ("d",)))]
    for parts in lists:
        parts.images = {}
    block, heard = join(*lists, camera("cam"))
    assert block.images.id.tolist() == ["a.tif", "b", "c", "d"]
    assert np.bincount(block.image_points.image).tolist() == [6, 3, 3, 3]
    assert not heard.warnings
    lists[2].format = "other"
    with pytest.raises(InputError, match=r"2.txt: none of its 1 image names is one of the block"):
        join(*lists, camera("cam"))


def test_control_comes_before_a_start_value_whichever_file_is_first() -> None:
    start = ground("start.txt", "p0", "p1", z=7.0, role=[[APPROXIMATE] * 3] * 2)
    block, heard = join(images("a", "b"), camera("cam"), start, ground("control.txt", "P0", z=5.0, role=CONTROL))
    rows = {str(block.points.id[p]): k for k, p in enumerate(block.ground_points.point)}
    assert block.ground_points.xyz_m[rows["p0"]].tolist() == [0.0, 0.0, 5.0]
    assert block.ground_points.role[rows["p0"]].tolist() == [CONTROL] * 3
    assert block.ground_points.role[rows["p1"]].tolist() == [APPROXIMATE] * 3
    assert not heard.warnings


def test_control_that_is_taken_as_exact_is_told() -> None:
    told = "control without a standard deviation: [0.0, 0.0, 0.0] m is taken (`control_sigma`; 0 is exact)"
    for role in (CONTROL, [[APPROXIMATE] * 3]):
        _, heard = join(images("a", "b"), camera("cam"), ground("control.txt", "p0", role=role))
        assert (told in heard.logs) == (role == CONTROL)


def test_two_controls_of_a_point_that_differ_are_an_error_with_both_places() -> None:
    first, second = ground("a.txt", "p0", role=CONTROL), ground("b.txt", "p0", z=5.25, role=CHECK)
    with pytest.raises(InputError, match=r"b.txt:1: ground point p0 is given otherwise in a.txt:1, by up to 0.25"):
        join(images("a", "b"), camera("cam"), first, second)
    join(images("a", "b"), camera("cam"), first, ground("b.txt", "p0", z=5.00005, role=CHECK))


def test_other_start_values_of_a_later_source_are_told() -> None:
    starts = [ground(f"{k}.txt", "p0", z=z, role=[[APPROXIMATE] * 3]) for k, z in enumerate((5.0, 6.0))]
    block, heard = join(images("a", "b"), camera("cam"), *starts)
    assert block.ground_points.xyz_m[0, 2] == 5.0
    assert heard.warnings == ["1 times ground point has other start values in a later source, which are not taken: p0"]


def test_an_observed_position_and_an_attitude_of_different_sources_are_one_row() -> None:
    turned = positions("eo.txt", "a", "b", ground_from_image=[np.eye(3).tolist()] * 2)
    gps = positions("gps.txt", "b", position_use=OBSERVED_VALUE, sigma_m=[[0.02, 0.03, 0.05]])
    gps.exterior = {**gps.exterior, "position_m": [[55.0, 1.0, 100.0]]}
    block, _ = join(images("a", "b"), camera("cam"), turned, gps)
    assert block.exterior.position_m.tolist() == [[0.0, 1.0, 100.0], [55.0, 1.0, 100.0]]
    assert np.isfinite(block.exterior.angles_rad).all()
    files = [str(block.files.path[f]) for f in block.exterior.file]
    assert files == ["eo.txt", "gps.txt"]


def test_the_only_camera_is_that_of_the_images_unless_theirs_is_given() -> None:
    block, heard = join(images("a", "b"), camera("other"))
    assert block.cameras.id.tolist() == ["cam"]
    assert "camera.txt: camera other is taken for cam, the only one of the images" in heard.logs
    block, heard = join(images("a", "b"), camera("cam"), camera("second", f=1200.0))
    assert dict(zip(block.cameras.id, block.cameras.principal_distance_mm))["cam"] == pytest.approx(1.0)
    assert not heard.warnings


def test_two_cameras_of_a_name_that_differ_are_told_with_both_files() -> None:
    block, heard = join(images("a", "b"), camera("cam", file="1.txt"), camera("cam", f=1200.0, file="2.txt"))
    assert block.cameras.principal_distance_mm.tolist() == [pytest.approx(1.0)]
    assert heard.warnings == ["2.txt: camera cam is another one than that of 1.txt, which is taken"]


def test_two_versions_of_a_list_are_an_error_and_a_repeated_measurement_is_none() -> None:
    again = images("a", "b", file="again.txt")
    xy = np.asarray(again.image_points["xy"])
    again.image_points = {**again.image_points, "xy": xy + 1.5}
    block, _ = join(images("a", "b"), again, camera("cam"))
    assert len(block.image_points) == 12
    again.image_points = {**again.image_points, "xy": xy * 0.0}
    with pytest.raises(
        InputError, match=r"again.txt:\d+: 6 of its image points have other coordinates in points.txt, up to 210 px"
    ):
        join(images("a", "b"), again, camera("cam"))


def test_every_row_keeps_its_file_and_line() -> None:
    block, _ = join(images("a", "b"), camera("cam"), ground("control.txt", "p0", "p1", role=CONTROL))
    assert [str(block.files.path[f]) for f in block.image_points.file] == ["points.txt"] * 6
    assert sorted(block.image_points.line.tolist()) == [2, 3, 4, 5, 6, 7]
    assert [str(block.files.path[f]) for f in block.ground_points.file] == ["control.txt"] * 2
    assert block.ground_points.line.tolist() == [1, 2]


def test_images_without_a_camera_say_so() -> None:
    with pytest.raises(InputError, match=r"points.txt:1: no source gives the camera 'cam'"):
        join(images("a", "b"))
    with pytest.raises(InputError, match=r"which camera took 2 images: a, b; cameras: c, d"):
        join(images("a", "b", camera=""), camera("c"), camera("d"))


def test_the_camera_of_known_numbers_that_a_message_proposes_is_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="and none gives a camera") as refused:
        join(images("a", "b", camera=""))
    lines = re.findall(r"`(\w+ = \w+)`", refused.value.remedy)
    path = tmp_path / "cam.txt"
    path.write_text("\n".join(lines))
    (seen,) = recognised(path)
    block, _ = join(images("a", "b", camera=""), read_source(path, Reading(format=seen.format.name), SILENT))
    assert block.cameras.format.tolist() == [[6000.0, 4000.0]]
    c_px = block.cameras.principal_distance_mm / block.cameras.pixel_size_mm[:, 0]
    np.testing.assert_allclose(c_px, 4100.0)
