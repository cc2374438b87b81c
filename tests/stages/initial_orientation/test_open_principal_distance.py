"""A principal distance that is only known by a share, as EXIF has it: nothing right is taken for wrong.

Around an object the rotations of pairs say what it is, before anything is adjusted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import aatri
from aatri.artifacts.block import Block, CameraParameters
from aatri.artifacts.suspects import Suspects
from aatri.orientation.graph.starting_distance import pairs_around_one_image, starting_factor
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation.unordered import initial_of, measured, simulated

C_MM, PIXEL_MM = 24.0, 0.004

DRONE = {
    "camera": {
        "kind": "digital",
        "principal_distance_mm": 9.0,
        "format": (4000.0, 3000.0),
        "pixel_size_mm": 0.0027,
        "margin_mm": 0.1,
    },
    "flight": {
        "strips": 2,
        "images_per_strip": 5,
        "cross_strips": 1,
        "forward_overlap": 75.0,
        "side_overlap": 60.0,
        "scale_number": 10000.0,
    },
    "terrain": {"relief_m": 10.0},
    "ties": {"per_position": 4},
    "known": {"full": 4},
    "gnss": {"observed": True},
    "refraction": "none",
    "earth": "flat",
    "noise": {"image_um": 1.0},
}


def with_distance_off(block: Block, share: float, *, free: bool = False) -> Block:
    """The principal distance wrong by a share, and open: by 30 %, or without a weight."""
    c_mm = block.cameras.principal_distance_mm * (1.0 + share)
    is_open = CameraParameters(
        camera=np.array([0], dtype=np.int32),
        name=np.array(["principal_distance"]),
        value=np.array([np.nan]),
        sigma=np.array([np.nan if free else 0.3 * c_mm[0]]),
        free=np.array([free]),
    )
    return replace(block, cameras=replace(block.cameras, principal_distance_mm=c_mm), camera_parameters=is_open)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("share", [0.12, -0.12])
@pytest.mark.parametrize("free", [False, True])
def test_positions_and_control_are_not_blamed(share: float, free: bool) -> None:
    true, told = simulated(2, **DRONE), Told()
    block = with_distance_off(true, share, free=free)
    found = initial_of(block, told)
    assert not np.isin(found.suspects.kind, ["position", "control"]).any()
    assert not any("contradict" in text for text in told.warnings)
    done = bundle(block, measured(block), found)
    assert done.cameras.principal_distance_mm[0] == pytest.approx(9.0, rel=2e-3)
    assert not (done.suspects.verdict == "rejected").any()


@pytest.mark.slow
def test_where_the_principal_distance_is_known_the_contradiction_is_told() -> None:
    block, told = simulated(2, **DRONE), Told()
    wrong = replace(
        block, cameras=replace(block.cameras, principal_distance_mm=1.12 * block.cameras.principal_distance_mm)
    )
    initial_of(wrong, told)
    assert any("contradict" in text for text in told.warnings)


@pytest.mark.slow
def test_a_position_far_off_in_plan_is_found_all_the_same() -> None:
    block = with_distance_off(simulated(2, **DRONE), 0.12)
    e = block.exterior
    moved = e.position_m.copy()
    moved[4, 0] += 40.0
    found = initial_of(replace(block, exterior=replace(e, position_m=moved)))
    rows = found.suspects.kind == "position"
    assert found.suspects.image[rows].tolist() == [block.images.id[e.image[4]]]


def column(factor: float, *, free: bool = True, control: int = 0, heights_m: tuple[float, float] = (2.3, 0.7)) -> Block:
    """A column from around it, of which each of 20 images sees one side; the principal distance times a factor."""
    rng = np.random.default_rng(5)
    angle, height = rng.uniform(0, 2 * np.pi, 250), rng.uniform(0, 3, 250)
    X = np.column_stack([0.6 * np.cos(angle), 0.6 * np.sin(angle), height])
    outwards = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    rows: dict[str, list[object]] = {"image": [], "point": [], "x": [], "y": []}
    for k, turn in enumerate(np.arange(20) * 2 * np.pi / 20):
        centre = np.array([3 * np.cos(turn), 3 * np.sin(turn), heights_m[k % 2]])
        back = centre - [0.0, 0.0, 1.5]
        back /= np.linalg.norm(back)
        right = np.cross([0.0, 0.0, 1.0], back)
        right /= np.linalg.norm(right)
        u = (X - centre) @ np.stack([right, np.cross(back, right), back], axis=1)
        xy = -C_MM * u[:, :2] / u[:, 2:] / PIXEL_MM * [1.0, -1.0] + [3000.0, 2000.0] + rng.normal(0, 0.2, (len(X), 2))
        seen = (((centre - X) * outwards).sum(axis=1) > 0.8) & (np.abs(xy - [3000, 2000]) < [3000, 2000]).all(axis=1)
        for i in np.flatnonzero(seen).tolist():
            for name, value in zip(rows, (f"i{k}", f"p{i}", xy[i, 0], xy[i, 1])):
                rows[name].append(value)
    camera = {
        "kind": "digital",
        "image_coordinates": "pixel",
        "pixel": {"size": PIXEL_MM, "origin": "top-left-corner", "y": "down"},
        "format": [6000, 4000],
        "principal_distance": C_MM * factor,
        **({"sigmas": {"principal_distance": float("inf")}} if free else {}),
    }
    settings = {
        "name": "column",
        "frames": {"map": {"axes": ["east", "north", "up"], "crs": "local"}},
        "units": {"sigma_image": "um"},
        "sigma": {"image": 0.8},
        "cameras": {"cam": camera},
    }
    images = {"image": [f"i{k}" for k in range(20)], "camera": ["cam"] * 20}
    known = X[[0, 1, 2][:control]] + rng.normal(0, 1e-3, (control, 3))
    ground = {"point": [f"p{i}" for i in range(control)], **{f"s{c}": [1e-3] * control for c in "XYZ"}}
    ground |= {c: known[:, k].tolist() for k, c in enumerate("XYZ")}
    return aatri.block(settings, images=images, image_points=rows, ground_points=ground)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("factor", [0.75, 0.9, 1.3])
def test_an_open_distance_far_off_is_found_from_the_rotations_of_pairs(factor: float) -> None:
    block, told = column(factor), Told()
    start = graph(block, calibrated(block), context=told, rng=np.random.default_rng(1))
    assert start.images.oriented.all()
    (line,) = [line for line in told.lines if "rotations of pairs fit within" in line]
    c_mm = float(line.split("degrees with ")[1].split()[0])
    assert abs(c_mm - C_MM) < 0.02 * C_MM


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("factor", "free"), [(1.0, True), (1.1, False)])
def test_one_that_fits_or_is_stated_without_doubt_is_used_as_it_is(factor: float, free: bool) -> None:
    block, told = column(factor, free=free), Told()
    graph(block, calibrated(block), context=told, rng=np.random.default_rng(1))
    assert not [line for line in told.lines if "rotations of pairs fit within" in line]


def test_the_least_misfit_counts_where_it_is_clear() -> None:
    def factor(misfit: Callable[[float], float], pairs: Callable[[float], int] = lambda f: 20) -> float:
        return starting_factor(lambda f: np.full(pairs(f), misfit(f) / f)).factor

    def valley(f: float) -> float:
        return 0.002 + 0.1 * abs(f - 1.23)

    assert factor(valley) == pytest.approx(1.23, rel=0.013)
    assert factor(valley, lambda f: 20 if f < 1.1 else 8) < 1.1  # pairs that form no model do not fit
    assert factor(lambda f: 0.8 * 0.02 if f > 1.2 else 0.02) == 1.0  # hardly less
    assert factor(lambda f: 0.004 * abs(f - 1.1)) == 1.0  # they fit
    assert factor(lambda f: 0.02 * f**-4) == 1.0  # least beyond all that are tried
    assert factor(valley, lambda f: 3) == 1.0  # too few triangles


def test_of_many_pairs_those_near_each_other_are_tried() -> None:
    left, right = np.arange(99), np.arange(1, 100)
    left, right = np.append(left, [50, 50]), np.append(right, [52, 53])
    chosen = pairs_around_one_image(left, right, 100, 10)
    assert len(chosen) == 10
    assert np.abs(np.concatenate([left[chosen], right[chosen]]) - 50).max() <= 6
    assert pairs_around_one_image(left, right, 100, 200).tolist() == list(range(101))


def test_images_that_look_to_all_sides_are_upside_down_nowhere() -> None:
    """All look a little upwards, and the mean of their viewing directions straight: three control points place them."""
    block = column(1.0, free=False, control=3, heights_m=(0.9, 1.0))
    start = graph(block, calibrated(block), context=Told(), rng=np.random.default_rng(1))
    assert start.images.oriented.all()
    np.testing.assert_allclose(start.images.position_m[:, 2], [0.9, 1.0] * 10, atol=0.1)


@pytest.mark.slow(after=1)
def test_points_of_two_rays_that_fit_the_adjusted_camera_come_back() -> None:
    """An earlier stage has left them out, of a block whose principal distance is a tenth off."""
    block = column(0.9)
    rows = block.image_points
    order = np.lexsort((rows.image, rows.point))
    place = np.arange(len(order)) - np.searchsorted(rows.point[order], rows.point[order])
    many = np.bincount(rows.point)[rows.point[order]] > 5
    block = replace(block, image_points=rows.take(np.sort(order[(place < 2) | many & (rows.point[order] % 3 > 0)])))
    points, rows = calibrated(block), block.image_points
    start = graph(block, points, context=Told(), rng=np.random.default_rng(1))
    out = np.flatnonzero(np.bincount(rows.point)[rows.point] == 2)
    n = len(out)
    assert n > 40
    suspects = Suspects(
        kind=np.full(n, "image_point"),
        row=out.astype(np.int32),
        image=block.images.id[rows.image[out]],
        point=block.points.id[rows.point[out]],
        stage=np.full(n, "initial_orientation"),
        size=np.full(n, np.nan),
        unit=np.full(n, "mm"),
        sigma=np.full(n, np.nan),
        test=np.full(n, 50.0),
        verdict=np.full(n, "rejected"),
    )
    xyz_m = start.points.xyz_m.copy()
    xyz_m[np.unique(rows.point[out])] = np.nan
    start = replace(start, suspects=suspects, points=replace(start.points, xyz_m=xyz_m))
    done = bundle(block, points, start, options=BundleOptions(datum="free"))
    assert done.suspects.staying_out.sum() == 0
