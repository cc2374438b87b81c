"""What is wrong with a block as it was read: one cause after the other."""

from __future__ import annotations

import unicodedata
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import ANTENNA, PROJECTION_CENTRE, Block
from aatri.checks.as_read import screening
from aatri.checks.as_read.cameras import CameraFrames, camera_figures
from aatri.checks.as_read.coverage import coverage, imprecision
from aatri.checks.as_read.lever_arms import impossible_lever_arms
from aatri.checks.finding import Finding
from aatri.errors import AatriError, InputError
from tests.bad_inputs.rows import BadInput
from tests.checks.as_read.test_screening import Written
from tests.made_solutions import made_block
from tests.reading import read_block
from tests.stages.film_blocks import Told
from tests.stages.hand_block import Heard

# Figures of cameras as they are given: a line each, and what no camera and no flight has.


def _camera(c_mm: float = 150.0, pixel_mm: float = 0.02) -> CameraFrames:
    return CameraFrames(["c"], np.array([c_mm]), np.array([[115.0, 115.0]]), np.array([pixel_mm]))


ZERO = np.zeros(3, dtype=np.int64)


def test_a_line_per_camera_tells_what_is_given_and_nothing_of_a_camera_of_which_nothing_is() -> None:
    bare = CameraFrames(
        ["c", "bare"], np.array([150.0, np.nan]), np.array([[115.0, 115.0], [np.nan, np.nan]]), np.array([0.02, np.nan])
    )
    (finding,) = camera_figures(bare, ZERO, np.array([740.0, 750.0, 760.0]))
    # 2 atan(115 sqrt(2) / 150) = 94.6 deg; 750 m away at c = 150 mm: 1 : 5,000, 0.02 mm are 0.1 m
    assert str(finding) == (
        "camera c: 750 m from the control it shows, field of view 94.6 deg, scale 1 : 5,000, "
        "ground sampling distance 0.1 m"
    )


@pytest.mark.parametrize(
    ("camera", "distance_m", "what"),
    [
        (_camera(c_mm=0.15), 750.0, "field of view of 180"),
        (_camera(c_mm=15.0), 75.0, "field of view of 169 deg"),
        (_camera(c_mm=150000.0), 750.0, "field of view of 0.12"),
        (_camera(pixel_mm=21.0), 750.0, "ground sampling distance of 105 m"),
        (_camera(pixel_mm=np.nan), 450e3, "scale of 1 : 3,000,000"),
    ],
)
def test_figures_that_no_camera_has_are_warnings(camera: CameraFrames, distance_m: float, what: str) -> None:
    warned = [str(f) for f in camera_figures(camera, ZERO, np.full(3, distance_m)) if f.level == "warning"]
    assert [text for text in warned if what in text]
    good = camera_figures(_camera(pixel_mm=np.nan), ZERO, np.full(3, 250e3))
    assert not [f for f in good if f.level == "warning"]


@pytest.mark.parametrize(
    ("lever_arm_m", "refers_to", "what"),
    [
        ((120.0, -50.0, 350.0), ANTENNA, "lever arm of 373 m, longer than any aircraft"),
        ((0.0, 0.0, 60.0), ANTENNA, "lever arm of 60 m, though the control it sees is 110 m away"),
        ((0.0, 0.0, 50.0), ANTENNA, ""),
        ((1.2, -0.4, 8.0), ANTENNA, ""),
        ((120.0, -50.0, 350.0), PROJECTION_CENTRE, ""),
    ],
)
def test_lever_arms_in_millimetres_are_errors(lever_arm_m: tuple[float, ...], refers_to: int, what: str) -> None:
    """Of a drone 110 m above its control; a lever arm of which nothing makes use is told elsewhere."""
    block: Any = SimpleNamespace(
        cameras=SimpleNamespace(id=np.array(["drone"]), lever_arm_m=np.array([lever_arm_m])),
        images=SimpleNamespace(camera=ZERO),
        exterior=SimpleNamespace(image=np.arange(3), refers_to=np.full(3, refers_to)),
    )
    told = [f"{f.level}: {f}" for f in impossible_lever_arms(block, ZERO, np.array([100.0, 110.0, 120.0]))]
    assert len(told) == bool(what)
    assert all(text.startswith("error: ") and what in text for text in told)


def test_an_impossible_lever_arm_is_told_before_images_are_compared_in_their_strips(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What takes longest is not looked for in a block that is refused."""
    compared = list[Block]()
    monkeypatch.setattr(screening, "exchanged_images", lambda block, *_: compared.append(block) or [])
    block = made_block()
    block = replace(block, cameras=replace(block.cameras, format=np.array([[600.0, 600.0]])))
    screening.screened(block)
    assert len(compared) == 1
    finding = Finding("lever_arms", "error", "longer than any aircraft")
    monkeypatch.setattr(screening, "impossible_lever_arms", lambda *_: [finding])
    with pytest.raises(InputError, match="longer than any aircraft"):
        screening.screened(block)
    assert len(compared) == 1


# Control whose ids are written otherwise than in the images, or that is called approximate, is not lost in silence.


def named(old: str, new: str, points: int = 10) -> Written:
    """A block whose points are called `old` in the images and `new` on the ground."""
    of = Written()
    of.points = [row.replace(",p", f",{old}") for row in of.points]
    of.ground = [f"{new}{k},{k},{2 * k},{k * k},control" for k in range(points)]
    return of


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("GCP-", "gcp-"),
        ("Größe", "GRÖSSE"),
        (unicodedata.normalize("NFD", "é"), "é"),
        ("G", "Ｇ"),
        ("P0", "P"),
        ("00", ""),
        ("P_", "P-"),
        ("P ", "P"),
    ],
)
def test_control_under_other_names_is_an_error_that_names_them(tmp_path: Path, old: str, new: str) -> None:
    if old == "P ":
        old, new = "P 1-", "P_1-"
    with pytest.raises(AatriError, match="no control point is measured; did you mean") as caught:
        named(old, new).read(tmp_path)
    assert caught.value.exit_code == 3
    assert "ground_points.csv:2" in str(caught.value)
    assert ("(another Unicode form)" in str(caught.value)) == (unicodedata.normalize("NFC", old) == new)


def test_one_point_under_another_name_is_a_warning(tmp_path: Path) -> None:
    of, heard = named("GCP", "GCP"), Heard()
    of.ground[3] = of.ground[3].replace("GCP", "gcp")
    of.read(tmp_path, heard)
    assert any("did you mean 'GCP3' for 'gcp3'" in w for w in heard.warned)


def test_check_points_under_other_names_are_a_warning_where_there_is_no_control(tmp_path: Path) -> None:
    of, heard = named("GCP", "gcp"), Heard()
    of.ground = [row.replace("control", "check") for row in of.ground]
    of.read(tmp_path, heard)
    assert any("did you mean 'GCP0' for 'gcp0'" in w for w in heard.warned)


def test_control_elsewhere_is_no_error(tmp_path: Path) -> None:
    heard = Heard()
    named("tie", "GCP").read(tmp_path, heard)
    assert not any("did you mean" in w for w in heard.warned)


def test_control_that_is_all_approximate_is_an_error(tmp_path: Path) -> None:
    of = named("p", "p")
    of.ground = [row.replace("control", "approximate") for row in of.ground]  # block.yaml has sigma.control
    with pytest.raises(AatriError, match="no ground point is control or check, all are approximate") as caught:
        of.read(tmp_path)
    assert "ground_points.csv:2" in str(caught.value)
    of.ground[0] = of.ground[0].replace("approximate", "check")
    of.read(tmp_path)


# Units of image coordinates, from what the points cover of the format.

FILM = CameraFrames(["wide"], np.array([153.0]), np.array([[115.0, 115.0]]), np.array([np.nan]))
BARE = CameraFrames(["wide"], np.array([153.0]), np.array([[np.nan, np.nan]]), np.array([np.nan]))
XY = 100.0 * np.random.default_rng(3).uniform(-1, 1, (40, 2))
OF = np.zeros(40, dtype=np.int64)


@pytest.mark.parametrize("cameras", [FILM, BARE])
def test_points_spread_over_the_image_are_no_error_and_no_warning(cameras: CameraFrames) -> None:
    assert not [finding for finding in coverage(cameras, OF, XY) if finding.level != "note"]


@pytest.mark.parametrize(
    ("factor", "what"),
    [
        (1e-3, "its 40 image points lie within"),  # metres
        (1 / 25.4, "its 40 image points lie within"),  # inches
        (1e3, "mm from the middle of the image"),  # micrometres
    ],
)
def test_another_unit_is_an_error_that_names_the_camera(factor: float, what: str) -> None:
    (error,) = coverage(FILM, OF, factor * XY)
    assert error.level == "error"
    assert what in error.sentence
    assert error.where == "camera wide"
    assert "unit of the image coordinates" in error.remedy


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_without_a_format_the_angle_that_points_span_is_a_warning(factor: float) -> None:
    reach = factor * np.linalg.norm(XY, axis=1).max()
    (finding,) = coverage(BARE, OF, factor * XY)
    assert finding.level == "warning"
    assert f"span {np.degrees(2 * np.arctan(reach / 153.0)):.3g} deg" in finding.sentence
    (finding,) = coverage(BARE, OF, factor * (XY - XY.min(axis=0) + 1.0))
    assert finding.sentence.endswith("all in one quarter, as pixels from a corner do")


def test_a_format_in_cm_is_told_as_such_and_not_the_coordinates() -> None:
    (error,) = coverage(replace(FILM, half_format_mm=0.1 * FILM.half_format_mm), OF, XY)
    assert error.level == "error"
    assert "`format`" in error.remedy
    assert "ten times as large it holds them" in error.remedy
    assert "unit of the image coordinates" not in error.remedy


def test_points_of_all_images_in_one_quarter_of_the_format_are_a_warning() -> None:
    """Pixels that count from a corner of an image said to be twice as wide and high: its middle is their corner."""
    (warning,) = coverage(FILM, OF, 0.5 * XY + [-60.0, 60.0])
    assert (warning.level, warning.where) == ("warning", "camera wide")
    assert "one quarter" in warning.sentence
    assert "`format`" in warning.remedy
    assert coverage(FILM, OF, 0.5 * XY + [0.0, 60.0]) == []


def test_a_small_target_in_the_middle_is_a_warning_and_few_points_are_nothing() -> None:
    (finding,) = coverage(FILM, OF, 0.07 * XY)
    assert finding.level == "warning"
    assert coverage(FILM, OF[:19], 1e-3 * XY[:19]) == []


@pytest.mark.parametrize(
    ("sigma_mm", "what"),
    [(2.0, "in units of um 2 um"), (5.0, "in units of um 5 um"), (200.0, "in units of 0.1 um 20 um")],
)
def test_standard_deviations_in_another_unit_than_their_image_are_an_error(sigma_mm: float, what: str) -> None:
    sigma = np.full_like(XY, sigma_mm)
    sigma[:5] = 1e-3  # a few points may have others
    (error,) = imprecision(BARE, OF, XY, sigma)
    assert error.level == "error"
    assert what in error.sentence
    assert error.where == "camera wide"
    assert "sigma_image" in error.remedy


@pytest.mark.parametrize(
    ("size", "sigma_mm", "level"),
    [
        (1.0, (5e-3, 5e-3), []),
        (1.0, (0.5, 0.5), []),
        (1.0, (5e-3, 100.0), []),  # only x is measured
        (2e-3, (5e-3, 5e-3), ["warning"]),  # a target of 0.4 mm in the middle of all images
        (1.0, (1e4, 1e4), ["warning"]),  # usual in no unit
        (1.0, (5e-6, 5e-6), ["warning"]),  # um read as nm
        (0.0, (5e-3, 5e-3), []),  # all points in one place: a matter of `coverage`
    ],
)
def test_standard_deviations_of_a_legal_block_are_no_error(
    size: float, sigma_mm: tuple[float, float], level: list[str]
) -> None:
    told = imprecision(BARE, OF, size * XY, np.full_like(XY, sigma_mm))
    assert [finding.level for finding in told] == level


def test_a_camera_of_little_weight_beside_another_is_a_warning() -> None:
    frames = FILM.principal_distance_mm, FILM.half_format_mm, FILM.pixel_mm
    both = CameraFrames(["wide", "old"], *(np.repeat(of, 2, axis=0) for of in frames))
    sigma = np.repeat([[5e-3], [5.0]], 40, axis=0) * np.ones(2)
    (finding,) = imprecision(both, np.repeat([0, 1], 40), np.vstack([XY, XY]), sigma)
    assert (finding.level, finding.where) == ("warning", "camera old")


# Positions that cannot be: one may always go, more than the share may not, and all go where all are the same.

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
