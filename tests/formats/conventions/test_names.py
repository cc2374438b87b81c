"""Names of images and points are matched step by step, and never where there is a choice."""

from __future__ import annotations

from aatri.formats.conventions.names import OF_POINTS, matched, without_extension


def test_each_step_takes_what_the_steps_before_have_left() -> None:
    found = matched(
        ["a/IMG_1.JPG", "IMG_2.jpg", "img_3", "IMG_4.tif", "x"], ["IMG_1.JPG", "IMG_2.tif", "IMG_3.JPG", "IMG_4.tif"]
    )
    assert found.name == {
        "IMG_4.tif": "IMG_4.tif", "a/IMG_1.JPG": "IMG_1.JPG", "IMG_2.jpg": "IMG_2.tif", "img_3": "IMG_3.JPG",
    }  # fmt: skip
    assert list(found.by_step.values()) == [1, 1, 1, 1]
    assert found.unmatched == ("x",)


def test_two_images_of_one_name_in_two_folders_are_told_and_not_guessed() -> None:
    found = matched(["IMG_1.JPG"], ["flight1/IMG_1.JPG", "flight2/IMG_1.JPG"])
    assert not found.name
    assert found.unmatched == ("IMG_1.JPG",)
    assert found.conflicts[0][1] == ("IMG_1.JPG", "flight1/IMG_1.JPG", "flight2/IMG_1.JPG")
    assert matched(["flight2\\IMG_1.JPG", "flight2/IMG_2.JPG"], ["flight2/IMG_1.JPG", "IMG_2.JPG"]).unmatched == ()


def test_points_have_no_folders_and_no_extensions() -> None:
    assert matched(["a/1", "b.tif"], ["1", "b"], OF_POINTS).unmatched == ("a/1", "b.tif")
    assert matched(["p1"], ["P1"], OF_POINTS).name == {"p1": "P1"}


def test_only_endings_of_images_are_extensions() -> None:
    assert without_extension("strip.12") == "strip.12"
    assert without_extension("DSC_1.NEF") == "DSC_1"
    assert without_extension(".tif") == ".tif"
