"""Geodetic observations and attitudes written otherwise than declared: what their values look like is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.artifacts.block import Block
from aatri.checks.at_start.attitude_convention import _suits_others, attitude_conventions
from aatri.checks.at_start.conventions import other_conventions
from aatri.checks.finding import Finding
from aatri.codes import OBSERVED_VALUE
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import POSE, Poses
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.geodetic_blocks import made
from tests.stages.hand_block import ground_rows, hand, read, start

SURVEY = {
    "survey": {
        "distances": 20,
        "direction_sets": 4,
        "azimuths": 8,
        "angles": 8,
        "zenith_angles": 10,
        "height_differences": 8,
    }
}


def _told(block: Block) -> list[str]:
    given = bundle_input(observation_source(block, calibrated(block), None), BundleOptions())
    return [str(found) for found in other_conventions(block, given)]


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("kind", "written", "said"),
    [
        ("direction", lambda v: -v % (2 * np.pi), "counted counter-clockwise"),
        ("direction", lambda v: v / 0.9, "gon, read as degrees"),
        ("azimuth", lambda v: (v + np.pi) % (2 * np.pi), "counted from south"),
        ("azimuth", lambda v: (np.pi / 2 - v) % (2 * np.pi), "counted from east"),
        ("angle", lambda v: -v % (2 * np.pi), "counted counter-clockwise"),
        ("zenith", lambda v: np.pi / 2 - v, "elevations"),
        ("height_difference", lambda v: -v, "of opposite sign"),
        ("distance", lambda v: v / 0.3048, "in feet"),
        ("distance", lambda v: v / 1000.0, "in m, beside coordinates in mm"),
    ],
)
def test_a_kind_written_otherwise_is_named(kind: str, written: Callable[[np.ndarray], np.ndarray], said: str) -> None:
    block = made(7, 1000.0, **SURVEY)
    g = block.geodetic
    wrong = replace(block, geodetic=replace(g, value=np.where(g.type == kind, written(g.value), g.value)))
    told = [text for text in _told(wrong) if text.startswith(f"{kind}:")]
    assert len(told) == 1
    assert said in told[0]


@pytest.mark.slow(after=1)
def test_an_azimuth_whose_from_and_to_are_exchanged_is_named() -> None:
    """The only azimuth of a textbook network turned it by 180 degrees, with the same sigma0 and without a word."""
    block = made(7, 1000.0, **SURVEY)
    g = block.geodetic
    reversed_row = np.arange(len(g.type)) == np.flatnonzero(g.type == "azimuth")[2]
    start, end = np.where(reversed_row, g.end, g.start), np.where(reversed_row, g.start, g.end)
    (text,) = _told(replace(block, geodetic=replace(g, start=start, end=end)))
    assert "1 of 8 point the other way" in text
    assert f"{start[reversed_row][0]} to {end[reversed_row][0]}" in text


@pytest.mark.slow
def test_control_in_mm_beside_a_portable_frame_in_m_is_named(tmp_path: Path) -> None:
    """The images are oriented in mm, as control is: the distances between the marks of the body alone contradict it."""
    of, marks = hand(), [13, 14, 19, 20]
    more = {"frames": {name: {"axes": ["east", "north", "up"], "crs": "local"} for name in ("map", "pier")}}
    for times in (1.0, 1000.0):
        here = replace(of, position_m=times * of.position_m, xyz_m=times * of.xyz_m)
        control = ground_rows(here, [0, 5, 24, 29], tail=",", head=",frame")
        body = "".join(f"p{p},{x!r},{y!r},{z!r},pier\n" for p, (x, y, z) in zip(marks, of.xyz_m[marks].tolist()))
        block, points = read(tmp_path / str(times), here, ground=control + body, more=more)
        given = bundle_input(observation_source(block, points, start(here, block)), BundleOptions())
        told = [str(finding) for finding in other_conventions(block, given)]
        assert len(told) == (times > 1)
        assert all("values in m, beside coordinates in mm" in text for text in told)


@pytest.mark.slow
def test_what_is_as_declared_is_not_named() -> None:
    for seed in range(1, 5):
        assert not _told(made(seed, 1000.0, **SURVEY))
    assert not _told(made(1, 1000.0, gross_errors={"geodetic": 6, "size_sigmas": (50.0, 500.0)}, **SURVEY))


def _of_attitudes(
    true_deg: np.ndarray, observed_deg: np.ndarray, sigma_deg: tuple[float, ...], *, before: bool = True
) -> list[Finding]:
    """Findings of images of these omega, phi, kappa, of which others were observed."""
    n = len(true_deg)
    exterior = SimpleNamespace(
        image=np.arange(n),
        position_m=np.zeros((n, 3)),
        angles_rad=np.radians(observed_deg),
        angle_sigma_rad=np.radians(np.tile(sigma_deg, (n, 1))),
        angle_use=np.full(n, OBSERVED_VALUE),
    )
    block: Any = SimpleNamespace(
        exterior=exterior,
        images=SimpleNamespace(id=np.arange(n).astype(str), active=np.ones(n, bool), camera=np.zeros(n, int)),
        cameras=SimpleNamespace(id=np.array(["c"]), mount_deg=np.zeros(1), boresight_rad=np.zeros((1, 3))),
        rotation="omega-phi-kappa",
    )
    rotation = Rotation.from_euler("XYZ", true_deg, degrees=True).as_matrix()
    state = {POSE: Poses(np.zeros((n, 3)), rotation)}
    records = SimpleNamespace(active=np.ones(n, bool))
    inputs: Any = SimpleNamespace(
        observed=[SimpleNamespace(kind="attitude", exact=False, row=np.arange(n), records=records, unknowns=())]
    )
    return attitude_conventions(ObservationSource(block, None, np.zeros(3), state), inputs, state, before=before)


def _near_vertical(n: int, heading_deg: float, tilt_deg: float) -> tuple[np.ndarray, np.random.Generator]:
    rng = np.random.default_rng(1)
    return rng.normal(size=(n, 3)) * [tilt_deg, tilt_deg, 0.3] + [0.0, 0.0, heading_deg], rng


def test_poor_headings_of_images_all_turned_alike_are_in_no_other_unit() -> None:
    """Thousandths of any angles are no turn at all: they agree with such images as well as no attitudes would."""
    true, rng = _near_vertical(30, 35.0, 0.3)
    observed = true + rng.normal(size=(30, 3)) * [0.01, 0.01, 4.0]
    (warning,) = _of_attitudes(true, observed, (0.01, 0.01, 0.01), before=False)
    assert (warning.level, "read as" in str(warning)) == ("warning", False)
    assert not _of_attitudes(true, observed, (0.01, 0.01, 4.0))


def test_what_no_reading_explains_is_held_against_adjusted_orientations_alone() -> None:
    """A start of weak strips is off by degrees itself."""
    true, rng = _near_vertical(30, 35.0, 3.0)
    observed = true + rng.normal(size=(30, 3)) * 1.5
    (warning,) = _of_attitudes(true, observed, (0.01, 0.01, 0.01), before=False)
    assert "beyond any common offset" in warning.sentence
    assert not _of_attitudes(true, observed, (0.01, 0.01, 0.01))


def test_a_convention_shows_on_images_all_turned_alike_whatever_their_headings_are_worth() -> None:
    true, rng = _near_vertical(30, 35.0, 3.0)
    noise = rng.normal(size=(30, 3)) * 0.01
    (error,) = _of_attitudes(true, 1000 * (true + noise), (0.01, 0.01, 0.01))
    assert "read as omega-phi-kappa in thousandths" in error.sentence
    (error,) = _of_attitudes(true, (true + noise) * [-1, 1, 1], (0.1, 0.1, 5.0))
    assert "read as omega-phi-kappa with omega of opposite sign" in error.sentence


@pytest.mark.parametrize("n", [4, 6, 9])
def test_one_wrong_attitude_of_few_is_no_convention_of_its_camera(n: int) -> None:
    true, rng = _near_vertical(n, 0.0, 0.3)
    true[2, 0] = 8.0
    observed = true + rng.normal(size=(n, 3)) * 0.01
    observed[2, 0] = -observed[2, 0]
    assert not _of_attitudes(true, observed, (0.01, 0.01, 0.01))


def test_a_strip_in_which_alone_the_convention_shows_is_told_of() -> None:
    """Three strips: of the third alone omega is large enough for its sign to show."""
    true, rng = _near_vertical(9, 0.0, 0.0)
    true[6:, 0] = 8.0
    (error,) = _of_attitudes(true, (true + rng.normal(size=(9, 3)) * 0.01) * [-1, 1, 1], (0.01, 0.01, 0.01))
    assert "read as omega-phi-kappa with omega of opposite sign" in error.sentence


def test_attitudes_that_all_lack_one_turn_too_large_for_a_boresight_are_refused_with_it() -> None:
    true, rng = _near_vertical(9, 30.0, 3.0)
    noise = rng.normal(size=(9, 3)) * 0.01
    (error,) = _of_attitudes(true, true + noise + [0.0, 0.0, 180.0], (0.01, 0.01, 0.01))
    assert error.level == "error"
    assert "add 180 deg to kappa" in error.remedy
    (error,) = _of_attitudes(true, true + noise - [0.0, 0.0, 90.0], (0.01, 0.01, 0.01))
    assert "add 90 deg to kappa" in error.remedy
    assert not _of_attitudes(true, true + noise + [0.0, 0.0, 5.0], (0.01, 0.01, 0.01))


def test_another_reading_suits_the_others_only_if_most_agree_in_it_whatever_one_is_off() -> None:
    rng = np.random.default_rng(7)
    rotation, off = Rotation.random(20, random_state=3), rng.normal(size=(20, 3))
    wrong = np.where(np.arange(20) == 4, 1.0, 0.0)[:, None]

    def turned(sigma_rad: float, gross: bool) -> np.ndarray:
        return (rotation * Rotation.from_rotvec(sigma_rad * off + wrong * gross)).as_matrix()

    observed = turned(0.001, gross=True)
    assert _suits_others(observed, turned(0.001, gross=False), rotation.as_matrix())
    assert not _suits_others(observed, turned(0.05, gross=False), rotation.as_matrix())
