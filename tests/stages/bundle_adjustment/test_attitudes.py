"""Attitudes in the bundle: boresights, offsets, drifts, wrong conventions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.geometry.rotations import angles_from_rotation, exp_rotation
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.film_blocks import Told
from tests.stages.geodetic_blocks import CAMERA, figures, made

BORESIGHT = np.array([0.3, -0.2, 1.0])


def flown(seed: int, options: dict[str, Any] | None = None, **imu: Any) -> Block:
    """Ten images with positions and attitudes, four control points."""
    chosen = {
        "camera": CAMERA | {"mounting_deg": 90},
        "noise": {"image_um": 2.0, "control_m": (0.01, 0.01, 0.01), "gnss_m": (0.02, 0.02, 0.03)},
        "imu": {"observed": True, "boresight_deg": tuple(BORESIGHT)} | imu,
    } | (options or {})
    return made(seed, 1000.0, **chosen)


def start_of(block: Block, off_rad: float = 1e-4) -> Solution:
    """Orientations as an earlier stage would give them, without the attitudes: true ones with small errors."""
    assert block.true_images is not None
    turn = exp_rotation(off_rad * np.random.default_rng(1).standard_normal((len(block.images), 3)))
    e = block.exterior

    angles = angles_from_rotation(turn @ block.true_images.ground_from_image)
    without = replace(
        block,
        rotation="omega-phi-kappa",
        cameras=replace(block.cameras, boresight_rad=np.zeros((1, 3))),
        exterior=replace(e, angles_rad=angles, angle_use=0 * e.angle_use),
    )
    return bundle(without, calibrated(without), options=BundleOptions(max_iterations=30))


def boresight_of(solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    p = solution.parameters
    mine = p.group == "boresight"
    return np.degrees(p.value[mine]), np.degrees(p.sigma[mine])


@pytest.mark.slow
@pytest.mark.parametrize("system", ["omega-phi-kappa", "phi-omega-kappa", "roll-pitch-heading"])
def test_a_free_boresight_is_recovered_within_its_sigma(system: str) -> None:
    w, nees = [], []
    for seed in range(1, 6):
        block = flown(seed, rotation=system, boresight="free")
        solution = bundle(block, calibrated(block), start_of(block))
        value, sigma = boresight_of(solution)
        w.append((value - BORESIGHT) / sigma)
        nees.append(figures(block, solution)["truth_nees"])
        assert sigma.max() < 0.006  # 0.01 deg of one heading over sqrt(10), and the image points
        assert 0.8 < solution.sigma0 < 1.2
    assert np.abs(w).max() < 3.5
    assert 0.307 < np.mean(np.square(w)) < 2.187  # chi-square over 15 degrees of freedom, 99 %
    assert 0.6 < np.mean(nees) < 1.5


def test_a_weighted_boresight_is_observed_at_its_value() -> None:
    block = flown(1, boresight="weighted", boresight_sigma_deg=1e-7)
    value, sigma = boresight_of(
        bundle(block, calibrated(block), start_of(block), options=BundleOptions(max_sigma0=1e9))
    )
    assert np.abs(value).max() < 1e-4
    assert sigma.max() < 2e-7


def test_a_common_offset_of_a_fixed_boresight_is_a_warning_with_its_value() -> None:
    heard = Told()
    block = flown(2, boresight="fixed", boresight_deg=(0.0, 3.0, 0.0))
    bundle(block, calibrated(block), start_of(block), options=BundleOptions(max_sigma0=1e9), context=heard)
    said = [text for text in heard.warnings if "common offset" in text]
    assert said
    assert "boresight: .inf" in said[0]
    values = [float(x.split(" (")[0]) for x in said[0].split("offset of ")[1].split(" deg")[0].split(", ")]
    np.testing.assert_allclose(values, [0.0, 3.0, 0.0], atol=0.02)


@pytest.mark.parametrize(("signs", "turned"), [((-1, -1, -1), "x, y, z"), ((1, 1, -1), "z"), ((1, -1, 1), "y")])
def test_a_boresight_of_opposite_sign_is_told_with_the_reading_that_fits(signs: tuple[int, ...], turned: str) -> None:
    heard, block = Told(), flown(2, boresight="known")
    given = replace(block.cameras, boresight_rad=np.radians([BORESIGHT * signs]))
    block = replace(block, cameras=given)
    bundle(block, calibrated(block), start_of(block), options=BundleOptions(max_sigma0=1e9), context=heard)
    (text,) = [text for text in heard.warnings if "common offset" in text]
    reading = f"the boresight given fits read with the opposite sign of {turned}: give `boresight` so"
    assert f"{reading}, 0.3, -0.2, 1 deg" in text


def test_a_boresight_that_is_wrong_otherwise_has_no_reading() -> None:
    heard, block = Told(), flown(2, boresight="known")
    given = replace(block.cameras, boresight_rad=np.radians([[0.7, -0.2, 1.0]]))
    block = replace(block, cameras=given)
    bundle(block, calibrated(block), start_of(block), options=BundleOptions(max_sigma0=1e9), context=heard)
    assert [text for text in heard.warnings if "common offset" in text]
    assert not [text for text in heard.warnings if "boresight given fits" in text]


@pytest.mark.slow
def test_a_small_offset_is_told_after_the_adjustment_and_a_right_one_is_not() -> None:
    heard = Told()
    block = flown(2, boresight="fixed", boresight_deg=(0.05, 0.0, 0.0))
    bundle(block, calibrated(block), start_of(block), options=BundleOptions(max_sigma0=1e9), context=heard)
    assert any("common offset" in text for text in heard.warnings)
    for seed in range(2, 7):
        heard = Told()
        block = flown(seed, boresight="known")
        bundle(block, calibrated(block), start_of(block), context=heard)
        assert not any("attitudes" in text for text in heard.warnings)


def mirrored(block: Block, how: str) -> Block:
    """The block with attitudes declared or written otherwise than they are."""
    factors = {"kappa": [1, 1, -1], "omega": [-1, 1, 1], "all": -1, "milli": 1000, "degrees": 0.9}
    turn = [0.0, 0.0, np.pi if how == "south" else 0.0]
    e = replace(block.exterior, angles_rad=block.exterior.angles_rad * np.array(factors.get(how, 1)) + turn)
    return replace(block, exterior=e, rotation="omega-phi-kappa" if how == "system" else block.rotation)


@pytest.mark.parametrize(
    ("system", "how", "proposed"),
    [
        ("omega-phi-kappa", "kappa", "kappa of opposite sign"),
        ("omega-phi-kappa", "omega", "omega of opposite sign"),
        ("phi-omega-kappa", "system", "phi-omega-kappa"),
        ("roll-pitch-heading", "system", "roll-pitch-heading"),
        ("roll-pitch-heading", "kappa", "heading of opposite sign"),
        ("roll-pitch-heading", "all", "roll, pitch, heading of opposite sign"),
        ("roll-pitch-heading", "south", "roll-pitch-heading with heading counted from south"),
        ("omega-phi-kappa", "milli", "omega-phi-kappa in thousandths of the unit declared"),
        ("phi-omega-kappa", "degrees", "phi-omega-kappa in degrees, declared as gon"),
    ],
)
def test_a_mirrored_convention_is_recognised_and_the_right_one_proposed(system: str, how: str, proposed: str) -> None:
    tilts = {
        "flight": {
            "strips": 3,
            "images_per_strip": 4,
            "scale_number": 10_000.0,
            "side_overlap": 40.0,
            "cross_strips": int(how != "degrees"),  # without, two strips of three agree
            "tilt_sigma_deg": 5.0,
            "tilt_max_deg": 12.0,
        }
    }
    block = flown(3, tilts, rotation=system, boresight="known")
    wrong = mirrored(block, how)
    with pytest.raises(InputError, match="beyond any common offset") as error:
        bundle(wrong, calibrated(wrong), start_of(block))
    assert f"read as {proposed}" in str(error.value) or f"with {proposed}" in str(error.value)


def test_a_mount_that_is_a_quarter_off_is_refused_with_the_right_one() -> None:
    block = flown(3, rotation="roll-pitch-heading", boresight="known")
    wrong = replace(block, cameras=replace(block.cameras, mount_deg=np.zeros(1, np.int32)))
    with pytest.raises(InputError, match="more than a boresight can be") as error:
        bundle(wrong, calibrated(wrong), start_of(block))
    assert f"`mount: {block.cameras.mount_deg[0]}`" in str(error.value)


@pytest.mark.slow
def test_a_drift_of_the_attitudes_of_each_strip_is_taken_up() -> None:
    w = []
    for seed in range(1, 4):
        block = flown(seed, boresight="known", shift_deg=0.1, drift_deg_per_s=0.002)
        block = replace(block, exterior=replace(block.exterior, position_use=block.exterior.position_use))
        options = BundleOptions.model_validate({"attitudes": {"drift": "linear"}, "positions": {"use": False}})
        solution = bundle(block, calibrated(block), start_of(block), options=options)
        assert (solution.parameters.group == "attitude drift").sum() == 12
        w.append(solution.sigma0)
    assert 0.85 < np.mean(w) < 1.15


def test_gross_errors_of_attitudes_are_found() -> None:
    block = flown(4, {"gross_errors": {"attitudes": 1, "size_sigmas": (40.0, 50.0)}}, boresight="known")
    assert block.gross_errors is not None
    (row,) = block.gross_errors.row[block.gross_errors.kind == "attitude"]
    options = BundleOptions.model_validate({"blunders": {"method": "data_snooping", "max_share": 0.2}})
    solution = bundle(block, calibrated(block), start_of(block), options=options)
    mine = solution.suspects.kind == "attitude"
    assert solution.suspects.row[mine].tolist() == [row]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("turns_deg", "named"), [((180.0,) * 3, True), ((180.0,) * 5, True), ((180.0, 90.0, -60.0), False)]
)
def test_attitudes_of_a_few_images_that_are_turned_alike_are_named_with_their_turn(
    turns_deg: tuple[float, ...], named: bool
) -> None:
    block, rows = flown(4, boresight="known"), list(range(len(turns_deg)))
    angles = block.exterior.angles_rad.copy()
    angles[rows, 2] += np.radians(turns_deg)
    block = replace(block, exterior=replace(block.exterior, angles_rad=angles))
    context = Told()
    solution = bundle(block, calibrated(block), start_of(block), context=context)
    lines = [text for text in context.warnings if "turned beside the others" in text]
    assert bool(lines) == named
    for text in lines:
        x, y, z = (float(part) for part in text.split("rotation of ")[1].split(" deg")[0].split(", "))
        assert abs(x) < 1
        assert abs(y) < 1
        assert abs(z) > 179
    out = solution.suspects.kind == "attitude"
    assert sorted(solution.suspects.row[out].tolist()) == rows


@pytest.mark.slow
def test_a_start_that_is_turned_by_little_in_one_strip_is_not_laid_on_its_attitudes() -> None:
    block = flown(4, boresight="known")
    begin, context = start_of(block), Told()
    rotation = begin.images.ground_from_image.copy()
    rotation[:3] = exp_rotation(np.radians([[0.0, 2.0, 0.0]] * 3)) @ rotation[:3]
    bundle(
        block,
        calibrated(block),
        replace(begin, images=replace(begin.images, ground_from_image=rotation)),
        context=context,
    )
    assert not [text for text in context.warnings if "turned beside the others" in text]


def test_a_free_boresight_is_no_parameter_of_the_camera_model() -> None:
    from aatri.stages.image_refinement.systematic import SystematicOptions, systematic

    lens = {"camera": CAMERA | {"mounting_deg": 90, "distortion": "brown", "brown": {"k1": 1e-8}}}
    block = flown(1, lens, boresight="free")
    refined = systematic(block, calibrated(block), options=SystematicOptions(refraction=False))
    assert "distortion" in refined.corrections.name
    solution = bundle(block, refined, start_of(flown(1, lens | {"camera": CAMERA | {"mounting_deg": 90}})))
    assert set(solution.parameters.group) == {"boresight"}
    assert 0.8 < solution.sigma0 < 1.2
