"""The stage block/simulate: presets, switches, noise, gross errors, determinism."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from aatri.adjustment import threads
from aatri.artifacts.block import CHECK, CONTROL, NO_ROLE, TRUTH
from aatri.errors import GeometryError, InputError
from aatri.formats.tables.writer import write_block
from aatri.simulation import rays
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.tables import hdf5
from aatri.tables.digest import content_digest
from tests.reading import read_block


def made(seed: int = 1, **options):
    return simulate(options=SimulateOptions(**options), rng=np.random.default_rng(seed))


@pytest.fixture(scope="module")
def rc30():
    return made(preset="rc30")


def test_rc30_has_the_counts_of_the_notes(rc30) -> None:
    metrics = rc30.metrics()
    assert (metrics["images"], metrics["strips"], metrics["control_points"]) == (255, 11, 72)
    assert metrics["check_points"] == 36
    assert len(rc30.points) - 72 == 3632
    control = (rc30.ground_points.role == CONTROL).any(axis=1)
    assert (rc30.ground_points.role[control] == CONTROL).all()
    np.testing.assert_array_equal(np.bincount(rc30.images.strip), [25] * 9 + [15] * 2)
    assert rc30.strips.id.tolist() == [*"123456789", "C1", "C2"]
    assert rc30.images.id[0] == "0101"
    assert rc30.images.id[-1] == "C215"


def test_rc30_has_the_scale_overlaps_and_sigmas_of_the_notes(rc30) -> None:
    ground = rc30.true_images.position_m[:, 2].mean() - rc30.terrain_height_m
    assert ground == pytest.approx(2500 * 0.15384, abs=1.0)
    first = rc30.true_images.position_m[rc30.images.strip == 0]
    assert np.diff(first[:, 0]).mean() == pytest.approx(0.39 * 0.23 * 2500, abs=2)
    rows = [rc30.true_images.position_m[rc30.images.strip == s, 1].mean() for s in range(9)]
    np.testing.assert_allclose(np.diff(rows), 0.68 * 0.23 * 2500, atol=8)
    assert (rc30.image_points.sigma_mm == 0.005).all()
    assert (rc30.fiducial_points.sigma_mm == 0.002).all()
    variances = np.diagonal(rc30.ground_points.covariance_m2, axis1=1, axis2=2)
    assert (variances == np.array([0.01 * 0.01, 0.01 * 0.01, 0.015 * 0.015])).all()
    tilt = np.rad2deg(np.arccos(rc30.true_images.ground_from_image[:, 2, 2]))
    assert 1.0 < tilt.max() <= 2.0


def test_rc30_flies_to_and_fro(rc30) -> None:
    x_axis = rc30.true_images.ground_from_image[:, :2, 0]
    for strip, direction in ((0, (1, 0)), (1, (-1, 0)), (9, (0, 1)), (10, (0, -1))):
        mine = rc30.images.strip == strip
        np.testing.assert_allclose(x_axis[mine], np.broadcast_to(direction, (mine.sum(), 2)), atol=0.1)
        steps = np.diff(rc30.true_images.position_m[mine][np.argsort(rc30.images.sequence[mine])][:, :2], axis=0)
        assert (steps @ direction > 150).all()


def test_rc30_ties_every_pair_and_triple_with_points_well_spread(rc30) -> None:
    sees = np.zeros((255, 3704), dtype=bool)
    sees[rc30.image_points.image, rc30.image_points.point] = True
    assert sees.sum(axis=0).min() >= 2
    for strip in range(11):
        mine = np.flatnonzero(rc30.images.strip == strip)
        order = mine[np.argsort(rc30.images.sequence[mine])]
        for left, right in itertools.pairwise(order):
            assert (sees[left] & sees[right]).sum() >= 12
            assert spread_across(rc30, sees[left] & sees[right], strip) > 300
        for a, b, c in zip(order, order[1:], order[2:]):
            assert (sees[a] & sees[b] & sees[c]).sum() >= 9
            assert spread_across(rc30, sees[a] & sees[b] & sees[c], strip) > 300
    for below, above in itertools.pairwise(range(9)):
        in_both = sees[rc30.images.strip == below].any(axis=0) & sees[rc30.images.strip == above].any(axis=0)
        assert in_both.sum() > 100


def spread_across(block, common, strip):
    """Extent of common points across the strip, m: near 400 with all three rows of standard positions."""
    return np.ptp(block.true_points.xyz_m[common, 0 if strip >= 9 else 1])


def test_control_is_at_the_corners_and_everywhere(rc30) -> None:
    g = rc30.ground_points
    control = rc30.true_points.xyz_m[g.point[(g.role == CONTROL).any(axis=1)], :2]
    everything = rc30.true_points.xyz_m[:, :2]
    for sx, sy in itertools.product((-1, 1), (-1, 1)):
        corner = np.array([np.quantile(sx * everything[:, 0], 1) * sx, np.quantile(sy * everything[:, 1], 1) * sy])
        assert np.linalg.norm(control - corner, axis=1).min() < 350
    nearest = np.linalg.norm(everything[:, None] - control[None], axis=2).min(axis=1)
    assert nearest.max() < 600


def test_uav_is_a_pixel_block() -> None:
    block = made(preset="uav")
    assert len(block.images) == 200
    assert block.cameras.image_coordinates[0] == "pixel"
    assert len(block.fiducials) == len(block.fiducial_points) == 0
    assert block.image_points.xy.min() > 0
    assert (block.image_points.xy < [5472, 3648]).all()
    assert (np.diagonal(block.exterior.position_covariance_m2, axis1=1, axis2=2) == 0.03 * 0.03).all()
    assert np.bincount(block.image_points.image).mean() > 200


def test_what_the_user_gives_is_laid_over_the_preset() -> None:
    options = SimulateOptions(preset="rc30", flight={"strips": 3}, noise=False, earth="flat")
    assert options.flight.strips == 3
    assert options.flight.images_per_strip == 25
    assert options.noise.factor == 0
    assert options.noise.image_um == 5.0
    assert options.earth == "flat"
    assert SimulateOptions(**options.model_dump()) == options


def test_options_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ValidationError):
        SimulateOptions(preset="rc31")
    with pytest.raises(ValidationError):
        SimulateOptions(flight={"stripes": 3})
    with pytest.raises(ValidationError):
        SimulateOptions(camera={"table_radius_mm": (0, 10), "table_correction_um": (0, 1, 2)})
    with pytest.raises(ValidationError):
        SimulateOptions(gross_errors={"control": 1.5})
    with pytest.raises(ValidationError):
        SimulateOptions(gross_errors={"size_sigmas": (9, 3)})
    with pytest.raises(GeometryError):
        made(ties={"new_points": 10}, known={"check_full": 20})
    with pytest.raises(GeometryError):
        made(flight={"forward_overlap": 5, "side_overlap": 5})
    with pytest.raises(InputError):
        made(gross_errors={"control": 9}, known={"full": 8})


def test_the_same_seed_gives_the_same_block_and_another_seed_another() -> None:
    assert content_digest(made(7)) == content_digest(made(7)) != content_digest(made(8))


def test_images_taken_in_pieces_and_threads_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    at_once = made(3)
    monkeypatch.setattr(rays, "CHUNK", 2)
    monkeypatch.setattr(threads, "default_threads", lambda: 3)
    assert content_digest(made(3)) == content_digest(at_once)


def test_noise_has_the_size_of_the_sigmas_and_changes_nothing_else(rc30) -> None:
    exact = made(preset="rc30", noise=False)
    noisy = frozenset({"image_points", "fiducial_points", "ground_points", "exterior"})
    assert content_digest(rc30, without=noisy) == content_digest(exact, without=noisy)
    np.testing.assert_array_equal(rc30.image_points.sigma_mm, exact.image_points.sigma_mm)
    for table, column, sigma in (
        ("image_points", "xy", 0.005),
        ("fiducial_points", "xy", 0.002),
        ("ground_points", "xyz_m", np.array([0.01, 0.01, 0.015])),
        ("exterior", "position_m", 0.05),
    ):
        error = (getattr(getattr(rc30, table), column) - getattr(getattr(exact, table), column)) / sigma
        n = error.size
        assert abs(error.mean()) < 4 / np.sqrt(n)
        assert error.std() == pytest.approx(1.0, abs=4 / np.sqrt(2 * n))


def test_error_free_control_and_positions_are_the_truth() -> None:
    block = made(noise=False)
    g = block.ground_points
    np.testing.assert_array_equal(g.xyz_m, block.true_points.xyz_m[g.point])
    np.testing.assert_array_equal(block.exterior.position_m, block.true_images.position_m)


def test_film_deformation_is_of_the_size_asked_for_and_can_be_switched_off() -> None:
    for deformed in (True, False):
        block = made(noise=False, film={"deformation": deformed})
        side = []
        for a, b in ((0, 1), (1, 2)):  # the marks 1-2 and 2-3: along x and along y
            length = [np.linalg.norm(block.fiducials.xy_mm[a] - block.fiducials.xy_mm[b])] * len(block.images)
            marks = block.fiducial_points.xy.reshape(-1, 4, 2)
            side.append(np.linalg.norm(marks[:, a] - marks[:, b], axis=1) / length - 1)
        change = np.abs(side)
        if deformed:
            assert change.min() > 0.9e-4
            assert change.max() < 3.1e-4
        else:
            assert change.max() < 1e-12


def test_gross_errors_are_listed_with_row_and_size() -> None:
    kinds = {"image_points": 0.02, "fiducials": 3, "control": 2, "positions": 1}
    clean, spoilt = made(), made(gross_errors={**kinds, "size_sigmas": (20, 30)})
    g = spoilt.gross_errors
    assert len(clean.gross_errors) == 0
    assert (g.kind == "image_point").sum() == round(0.02 * len(clean.image_points))
    assert [(g.kind == k).sum() for k in ("fiducial", "control", "position")] == [3, 2, 1]
    for kind, table, column in (
        ("image_point", "image_points", "xy"),
        ("fiducial", "fiducial_points", "xy"),
        ("control", "ground_points", "xyz_m"),
        ("position", "exterior", "position_m"),
    ):
        before, after = (getattr(getattr(b, table), column) for b in (clean, spoilt))
        expected = np.zeros_like(before)
        mine = g.kind == kind
        expected[g.row[mine]] = g.size[mine, : before.shape[1]]
        np.testing.assert_allclose(after - before, expected, rtol=0, atol=1e-12)
    in_sigmas = np.linalg.norm(g.size[g.kind == "image_point"], axis=1) / 0.005
    assert in_sigmas.min() >= 20
    assert in_sigmas.max() <= 30


def test_plan_and_height_control_lack_the_other_coordinates() -> None:
    block = made(known={"full": 4, "plan": 3, "height": 5, "check_full": 2, "check_plan": 1, "check_height": 1})
    g = block.ground_points
    np.testing.assert_array_equal(np.isnan(g.xyz_m), g.role == NO_ROLE)
    kinds = [tuple(role) for role in g.role.tolist()]
    C, K = CONTROL, CHECK
    wanted = {(C, C, C): 4, (C, C, 0): 3, (0, 0, C): 5, (K, K, K): 2, (K, K, 0): 1, (0, 0, K): 1}
    assert {kind: kinds.count(kind) for kind in wanted} == wanted


def test_without_gnss_positions_are_approximate_or_absent() -> None:
    approximate = made(gnss={"observed": False}).exterior
    assert (approximate.position_use == 0).all()
    assert np.isnan(approximate.position_covariance_m2).all()
    assert len(made(gnss={"observed": False, "approximate_positions": False}).exterior) == 0


def test_a_shift_of_the_positions_is_common_to_a_strip() -> None:
    block = made(noise=False, gnss={"shift_m": 2.0})
    error = block.exterior.position_m - block.true_images.position_m
    assert (block.exterior.drift_group == block.strips.id[block.images.strip]).all()
    shifts = np.array([error[block.images.strip == s].mean(axis=0) for s in range(3)])
    np.testing.assert_allclose(error, shifts[block.images.strip], atol=1e-9)
    assert np.abs(shifts).min() > 1e-3


SWITCHES = list(
    itertools.product(("flat", "tangent", "map"), ("none", "radial", "vertical_plane"), ("none", "brown", "table"))
)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("kind", ["film", "digital"])
def test_every_combination_of_switches_gives_a_valid_block(kind: str, tmp_path: Path) -> None:
    digital = {
        "format": (5472.0, 3648.0),
        "principal_distance_mm": 8.8,
        "margin_mm": 0.05,
        "table_radius_mm": (0.0, 10.0),
        "table_correction_um": (0.0, 3.0),
    }
    camera = {"kind": kind, **(digital if kind == "digital" else {"fiducials": 8})}
    for n, (earth, refraction, distortion) in enumerate(SWITCHES):
        block = made(
            earth=earth,
            refraction=refraction,
            noise=n % 2 == 0,
            film={"deformation": n % 3 == 0},
            camera={**camera, "distortion": distortion, "brown": {"k1": 1e-9}},
            gnss={"observed": n % 4 < 2},
            flight={"scale_number": 2500.0 if kind == "film" else 12000.0},
        )
        assert np.bincount(block.image_points.point, minlength=len(block.points)).min() >= 2
        ids = [block.images.id, block.points.id, block.strips.id]
        assert all(list(i) == sorted(set(i.tolist()), key=str.encode) for i in ids)
        pairs = block.image_points.image.astype(np.int64) * len(block.points) + block.image_points.point
        assert (np.diff(pairs) > 0).all()
    digest = hdf5.write(block, tmp_path / "block.h5")
    assert content_digest(hdf5.read(tmp_path / "block.h5", type(block))) == digest


@pytest.mark.parametrize(
    "options",
    [
        {"known": {"full": 4, "plan": 2, "height": 3, "check_height": 1}, "earth": "tangent"},
        {"camera": {"distortion": "table", "fiducials": 8}, "gnss": {"shift_m": 1.0}, "noise": {"image_um": 4.3}},
        {"camera": {"distortion": "brown", "brown": {"b1": 1e-5}}, "gnss": {"observed": False}},
        {"preset": "uav", "flight": {"strips": 2, "images_per_strip": 5}, "known": {"full": 4, "check_full": 0}},
    ],
)
def test_a_block_folder_holds_all_but_the_truth(options, tmp_path: Path) -> None:
    block = made(**options)
    write_block(block, tmp_path / "block")
    assert content_digest(read_block(tmp_path / "block")) == content_digest(block, without=TRUTH)


def test_a_large_block_with_few_points_in_each_image() -> None:
    block = made(flight={"strips": 40, "images_per_strip": 50, "forward_overlap": 60.0}, ties={"per_position": 1})
    assert len(block.images) == 2000
    assert np.bincount(block.image_points.image, minlength=2000).min() >= 3
    assert block.images.id[0] == "0101"
    assert block.strips.id[:3].tolist() == ["1", "10", "11"]
    assert block.strips.id[block.images.strip[block.images.id == "0205"]] == ["2"]
