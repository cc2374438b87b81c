"""Gross errors that come together: of a whole strip, of control that is exchanged beside some that is wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.small_blocks import adjusted_by, flown
from tests.stages.bundle_adjustment.test_bundle_input import CORNERS
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told
from tests.stages.hand_block import C_MM, Hand, ground_rows, hand, projected, read, start

OPTIONS = BundleOptions(interior_unknowns=True)


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(
        simulated(
            5,
            preset="rc30",
            flight={"strips": 3, "images_per_strip": 6, "cross_strips": 0},
            known={"full": 12},
            ties={"new_points": 300},
        )
    )


def _adjusted(chain: Chain, block: Block, **more: object) -> tuple[Solution, Told]:
    told, initial = Told(), replace(chain.strip_block, suspects=Suspects.empty())
    options = OPTIONS.model_copy(update=more)
    return bundle(block, chain.refined, initial, options=options, context=told), told


def _off(block: Block, rows: np.ndarray, by_m: list[float]) -> Block:
    position = block.exterior.position_m.copy()
    position[rows] += by_m
    return replace(block, exterior=replace(block.exterior, position_m=position))


@pytest.mark.slow
def test_positions_of_a_whole_strip_that_are_off_are_named_with_their_shift(chain: Chain) -> None:
    e = chain.block.exterior
    rows = np.flatnonzero(chain.block.strips.id[chain.block.images.strip[e.image]] == "2")
    assert len(rows) == 6
    solution, told = _adjusted(chain, _off(chain.block, rows, [1.5, 1.2, 1.5]))
    (line,) = [text for text in told.warnings if "off together" in text]
    assert line.startswith("observed positions of strip 2 are off together by 1.5")
    assert "all 6 are left out" in line
    assert "drift: shift, per: strip" in line
    s = solution.suspects
    assert set(s.row[s.staying_out].tolist()) == set(rows.tolist())
    assert set(s.kind[s.staying_out].tolist()) == {"position"}
    assert solution.sigma0 < 1.1


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("factor", [0.95, 1.29])
def test_a_principal_distance_that_is_wrong_is_named_with_the_right_one_and_no_ray_goes_for_it(
    chain: Chain, factor: float
) -> None:
    cameras = chain.block.cameras
    right = float(cameras.principal_distance_mm[0])
    block = replace(chain.block, cameras=replace(cameras, principal_distance_mm=factor * cameras.principal_distance_mm))
    solution, told = _adjusted(chain, block, max_sigma0=1e9)
    (line,) = [text for text in told.warnings if "ask for a principal distance of" in text]
    value, sigma = line.split("distance of ")[1].split(" mm")[0].rstrip(")").split(" (+- ")
    assert abs(float(value) - right) < 4 * float(sigma)
    assert line.startswith("the result contradicts its own tests")
    assert solution.contradictions == 1
    assert not solution.suspects.staying_out.any()


def test_image_points_near_each_other_that_are_moved_together_are_all_left_out(chain: Chain) -> None:
    m = chain.refined.measurements
    rays, image = np.bincount(m.point[m.active]), 7
    mine = np.flatnonzero((m.image == image) & m.active & (rays[m.point] > 2))
    apart = np.linalg.norm(m.xy_mm[mine] - m.xy_mm[mine[0]], axis=1)
    rows = mine[np.argsort(apart)[:8]]
    xy = m.xy_mm.copy()
    xy[rows] += 12 * m.sigma_mm[rows] * [0.6, -0.8]
    told, initial = Told(), replace(chain.strip_block, suspects=Suspects.empty())
    points = replace(chain.refined, measurements=replace(m, xy_mm=xy))
    solution = bundle(chain.block, points, initial, options=OPTIONS, context=told)
    (line,) = [text for text in told.warnings if text.startswith("neighbourhood of")]
    assert f"in image {chain.block.images.id[image]}" in line
    s = solution.suspects
    assert set(rows.tolist()) <= set(s.row[(s.kind == "image_point") & s.staying_out].tolist())
    assert s.staying_out.sum() <= len(rows) + 3


def test_images_with_each_other_s_position_are_named_and_nothing_else_goes(chain: Chain) -> None:
    e, order = chain.block.exterior, np.arange(len(chain.block.exterior))
    order[[3, 9]] = order[[9, 3]]
    block = replace(chain.block, exterior=replace(e, position_m=e.position_m[order]))
    solution, told = _adjusted(chain, block)
    (line,) = [text for text in told.warnings if "fit if their numbers are exchanged" in text]
    assert all(chain.block.images.id[e.image[row]] in line for row in (3, 9))
    s = solution.suspects
    assert set(s.row[s.staying_out].tolist()) == {3, 9}
    assert solution.sigma0 < 1.1


def test_positions_without_a_common_shift_are_no_strip_that_is_off(chain: Chain) -> None:
    _, told = _adjusted(chain, chain.block)
    assert not [text for text in told.warnings if "off together" in text]
    _, told = _adjusted(chain, _off(chain.block, np.array([4]), [1.5, 1.2, 1.5]))
    assert not [text for text in told.warnings if "off together" in text]


def test_positions_against_control_are_told_and_the_rays_of_control_do_not_go_for_it(chain: Chain) -> None:
    block = _off(chain.block, np.arange(len(chain.block.exterior)), [1.5, 1.2, 1.5])
    solution, told = _adjusted(chain, block)
    assert any("positions and control differ by a constant: positions less control 1.5" in t for t in told.warnings)
    s = solution.suspects
    out = s.point[(s.kind == "image_point") & s.staying_out]
    control = block.points.id[block.ground_points.point[(block.ground_points.role == 1).any(axis=1)]]
    assert np.isin(control, out).sum() <= 2


def test_exchanged_control_leaves_room_to_reject_another(chain: Chain) -> None:
    g = chain.block.ground_points
    rows = np.flatnonzero((g.role == 1).all(axis=1))
    rays = np.bincount(chain.refined.measurements.point, minlength=len(chain.block.points))[g.point[rows]]
    rows = rows[np.argsort(-rays, kind="stable")][:3]
    xyz = g.xyz_m.copy()
    xyz[rows[:2]] = xyz[rows[1::-1]]
    xyz[rows[2], 2] += 1.0
    solution, told = _adjusted(chain, replace(chain.block, ground_points=replace(g, xyz_m=xyz)))
    s = solution.suspects
    assert set(s.row[(s.kind == "control") & s.staying_out].tolist()) == set(rows.tolist())
    names = chain.block.points.id[g.point[rows]]
    (line,) = [text for text in told.warnings if "fit if their numbers are exchanged" in text]
    assert all(name in line for name in names[:2])
    assert solution.sigma0 < 1.1


def test_control_whose_standard_deviations_are_five_times_too_small_is_told(chain: Chain) -> None:
    g, rng = chain.block.ground_points, np.random.default_rng(7)
    rows = np.flatnonzero((g.role == 1).all(axis=1))
    xyz = g.xyz_m.copy()
    xyz[rows] += 4.9 * np.sqrt(np.einsum("nii->ni", g.covariance_m2[rows])) * rng.standard_normal((len(rows), 3))
    _, told = _adjusted(chain, replace(chain.block, ground_points=replace(g, xyz_m=xyz)))
    (line,) = [text for text in told.warnings if "standard deviations do not fit the residuals" in text]
    factors = dict(part.rsplit(" ", 1) for part in line.split("): ")[-1].split(", "))
    assert all(3.0 < float(factors[name]) < 8.0 for name in ("control plan", "control height")), line


@pytest.mark.slow
def test_ten_per_cent_of_gross_errors_are_found_without_any_option(chain: Chain) -> None:
    m, rng = chain.refined.measurements, np.random.default_rng(3)
    bad = rng.permutation(np.flatnonzero(m.active))[: len(m) // 10]
    angle, size = rng.uniform(0, 2 * np.pi, len(bad)), 0.005 * rng.uniform(10, 1000, len(bad))
    xy = m.xy_mm.copy()
    xy[bad] += size[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = replace(chain.refined, measurements=replace(m, xy_mm=xy))
    initial = replace(chain.strip_block, suspects=Suspects.empty())
    solution = bundle(chain.block, points, initial, options=OPTIONS)
    s = solution.suspects
    out = s.row[(s.kind == "image_point") & s.staying_out]
    assert np.isin(bad, out).mean() > 0.95
    assert 0.9 < solution.sigma0 < 1.1


def test_two_of_six_control_points_exchanged_are_named_by_the_whole_chain_without_positions() -> None:
    block = simulated(
        1,
        preset="rc30",
        flight={"strips": 3, "images_per_strip": 6, "cross_strips": 0},
        known={"full": 6},
        ties={"new_points": 300},
        gnss={"observed": False, "approximate_positions": False},
    )
    g = block.ground_points
    rows = np.flatnonzero((g.role == 1).all(axis=1))[[2, 3]]
    xyz = g.xyz_m.copy()
    xyz[rows] = xyz[rows[::-1]]
    s = run_chain(replace(block, ground_points=replace(g, xyz_m=xyz))).bundle.suspects
    assert set(s.row[(s.kind == "control") & s.staying_out].tolist()) == set(rows.tolist())


@pytest.mark.slow
def test_exchanged_control_is_not_taken_for_the_third_point_where_positions_drift() -> None:
    """Shift and drift of each strip leave the datum to three control points, and any of them would explain two."""
    camera = {"kind": "digital", "principal_distance_mm": 9.0, "format": (4000.0, 3000.0), "pixel_size_mm": 0.0027}
    overlaps = {"forward_overlap": 80.0, "side_overlap": 60.0, "kappa_sigma_deg": 1.0, "tilt_max_deg": 15.0}
    block = simulated(
        20149,
        camera={**camera, "margin_mm": 0.1, "mounting_deg": 90},
        flight={"strips": 2, "images_per_strip": 4, "cross_strips": 2, "scale_number": 5000.0, **overlaps},
        terrain={"mean_height_m": 800.0, "relief_m": 20.0, "wavelength_m": 300.0},
        ties={"per_position": 5},
        known={"full": 3, "check_full": 3},
        gnss={"observed": True, "shift_m": 2.0},
        earth="flat",
        refraction="none",
        noise={"image_um": 2.0},
        survey={"relative": {"sphere": 2}},
    )
    g, told = block.ground_points, Told()
    rows = np.flatnonzero((g.role == 1).all(axis=1))[:2]
    xyz = g.xyz_m.copy()
    xyz[rows] = xyz[rows[::-1]]
    block = replace(block, ground_points=replace(g, xyz_m=xyz))
    chain = run_chain(block)
    solution = bundle(block, chain.refined, chain.strip_block, context=told)
    s = solution.suspects
    assert set(s.row[(s.kind == "control") & s.staying_out].tolist()) == set(rows.tolist())
    assert solution.sigma0 < 1.1
    assert not any("off the terrain" in text for text in told.warnings)  # spheres stand on it


@pytest.mark.parametrize("pair", [("GCP01", "GCP08"), ("GCP02", "GCP07")])
def test_control_points_far_apart_with_each_others_coordinates_stop_no_adjustment(
    chain: Chain, pair: tuple[str, str]
) -> None:
    """Kilometres of contradiction bend the block so that no adjustment with them comes to an end."""
    g = chain.block.ground_points
    rows = np.flatnonzero(np.isin(chain.block.points.id[g.point], pair))
    xyz = g.xyz_m.copy()
    xyz[rows] = xyz[rows[::-1]]
    solution, told = _adjusted(chain, replace(chain.block, ground_points=replace(g, xyz_m=xyz)))
    s = solution.suspects
    assert set(zip(s.kind.tolist(), s.row.tolist(), s.verdict.tolist())) == {
        ("control", row, "swapped") for row in rows
    }
    (line,) = [text for text in told.warnings if "control: these two fit if their numbers are exchanged" in text]
    assert all(name in line for name in pair)
    assert solution.sigma0 < 1.1


@pytest.mark.parametrize("off_level_m", [22.0, 26.0])
def test_what_explains_as_much_once_it_is_adjusted_is_named_too(tmp_path: Path, off_level_m: float) -> None:
    """Vertical images of flat ground: c 1 % long is 6 m of height but for what the images fly above each other."""
    true = hand(relief_m=0.0)
    position, rotation = true.position_m.copy(), np.broadcast_to(np.eye(3), (6, 3, 3)).copy()
    position[:, 2] = 600.0 + off_level_m * np.array([1, -1, 1, -1, 1, -1])
    image, point = (a.ravel() for a in np.indices((6, len(true.xyz_m))))
    xy_mm = projected(position, rotation, true.xyz_m, image, point)
    image, point, xy_mm = (a[(np.abs(xy_mm) < 115.0).all(axis=1)] for a in (image, point, xy_mm))
    true = Hand(position, rotation, true.xyz_m, image, point, xy_mm)
    positions = [f"{i},{x!r},{y!r},{z!r},0.1,0.1,0.1" for i, (x, y, z) in zip(true.image_ids, position.tolist())]
    block, points = read(
        tmp_path,
        true,
        ground=ground_rows(true, CORNERS),
        exterior="\n".join(["image,X,Y,Z,sX,sY,sZ", *positions]) + "\n",
        xy_mm=xy_mm + np.random.default_rng(3).normal(0, 0.005, xy_mm.shape),
        camera={"principal_distance": 1.01 * C_MM},
    )
    told = Told()
    bundle(block, points, start(true, block), options=BundleOptions(max_sigma0=1e9), context=told)
    (line,) = [text for text in told.warnings if "would explain as much" in text]
    assert "principal distance of camera c" in line


@pytest.mark.slow
@pytest.mark.parametrize(
    ("factor", "how"),
    [
        (-1.0, " with the opposite sign of x, y, z"),
        ([1, 1, -1], " with the opposite sign of z"),
        (1e3, " in mm"),
        (10, " in dm"),
    ],
)
def test_a_lever_arm_in_another_unit_or_of_another_sign_is_told_with_the_reading_that_fits(
    tmp_path: Path, factor: float | list[int], how: str
) -> None:
    small, arm_m = (
        flown(strips=2, per_strip=4),
        np.array([0.6, -0.8, -2.0]) / (300 if how == " in mm" else 3 if how == " in dm" else 1),
    )
    small.position_m = {i: x + small.rotation[i] @ arm_m for i, x in small.position_m.items()}
    small.camera["lever_arm"] = (factor * arm_m).tolist()
    exterior = small.write(tmp_path / "block") / "exterior.csv"
    lines = exterior.read_text().splitlines()
    exterior.write_text("\n".join([lines[0] + ",refers_to", *(line + ",antenna" for line in lines[1:]), ""]))
    warnings = adjusted_by("graph", tmp_path / "block").warnings
    arm = ", ".join(f"{m:.6g}" for m in arm_m)
    assert [text for text in warnings if f"the lever arm given fits read{how}: {arm} m" in text]


@pytest.mark.slow
def test_a_lever_arm_beside_positions_of_the_projection_centres_is_told_to_be_left_out(tmp_path: Path) -> None:
    small = flown(strips=2, per_strip=4)
    small.camera["lever_arm"] = [0.3, 0.0, 0.4]
    exterior = small.write(tmp_path / "block") / "exterior.csv"
    lines = exterior.read_text().splitlines()
    exterior.write_text("\n".join([lines[0] + ",refers_to", *(line + ",antenna" for line in lines[1:]), ""]))
    (text,) = [text for text in adjusted_by("graph", tmp_path / "block").warnings if "leave out `lever_arm`" in text]
    assert "read in mm" not in text
