"""What is surveyed on the ground: networks, shapes, the round earth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest

from aatri.artifacts.block import TRUTH, Block
from aatri.errors import GeometryError, InputError
from aatri.formats.tables.writer import write_block
from aatri.simulation import earth
from aatri.simulation.structures import _round
from aatri.simulation.survey_settings import Condition
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.tables.digest import content_digest
from tests.campaigns.kinds import ALL
from tests.reading import read_block
from tests.stages.chain import simulated
from tests.stages.geodetic_blocks import CAMERA

# Simulated geodetic observations and relative control: what they are without errors, and where the errors are.

GEODETIC = {
    "camera": CAMERA,
    "refraction": "none",
    "earth": "geodetic",
    "false_origin_m": (500_000.0, 4_505_000.0),
    "terrain": {"relief_m": 20.0},
}
SURVEY: dict[str, Any] = ALL["survey"] | {"distance_scale": 0.0, "distance_addition_m": 0.0}


def made(seed: int = 1, **options: Any) -> Block:
    return simulated(seed, **(GEODETIC | {"survey": SURVEY} | options))


@pytest.fixture(scope="module")
def exact() -> Block:
    return made(noise=False)


def test_every_kind_goes_through_a_block_folder(tmp_path: Path) -> None:
    block = made()
    assert set(block.relative_control.type.tolist()) == set(Condition.__args__)  # type: ignore[attr-defined]
    write_block(block, tmp_path / "block")
    assert content_digest(read_block(tmp_path / "block")) == content_digest(block, without=TRUTH)


def _places(block: Block, names: np.ndarray) -> np.ndarray:
    assert block.true_points is not None
    number = {str(name): k for k, name in enumerate(block.points.id)}
    return block.true_points.xyz_m[[number[str(n)] for n in names]]


def test_geodetic_observations_are_those_of_pyproj(exact: Block) -> None:
    """Slope distances by geocentric coordinates, azimuths by those of the map."""
    g = exact.geodetic
    rows = (g.type == "distance") & (g.reduced == "no") & (g.end_kind == "point")
    to = pyproj.Transformer.from_crs(pyproj.CRS("EPSG:32650").to_3d(), "EPSG:4978", always_xy=True)
    ends = []
    for ids, heights in ((g.start, g.start_height_m), (g.end, g.end_height_m)):
        raised = _places(exact, ids[rows]) + heights[rows, None] * [0, 0, 1.0]
        ends.append(np.stack(to.transform(*raised.T), axis=1))
    np.testing.assert_allclose(g.value[rows], np.linalg.norm(ends[1] - ends[0], axis=1), atol=1e-6)
    in_map = g.reduced == "map"
    away = _places(exact, g.end[in_map]) - _places(exact, g.start[in_map])
    np.testing.assert_allclose(g.value[in_map], np.hypot(away[:, 0], away[:, 1]), atol=1e-8)
    assert 0.9995 < np.median(g.value[in_map]) / np.median(np.hypot(*away[:, :2].T)) < 1.0005
    rows = g.type == "azimuth"
    start, end = _places(exact, g.start[rows]), _places(exact, g.end[rows])
    grid = np.arctan2(end[:, 0] - start[:, 0], end[:, 1] - start[:, 1])
    turn = (g.value[rows] - grid + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(turn).max() < 1e-6  # arc to chord, and heights of the targets: below 0.2"
    rows = g.type == "height_difference"
    up = (_places(exact, g.end[rows]) - _places(exact, g.start[rows]))[:, 2] + (g.end_height_m - g.start_height_m)[rows]
    np.testing.assert_allclose(g.value[rows], up, atol=1e-9)


def test_zenith_angles_bend_by_the_share_of_the_curvature_that_refraction_is() -> None:
    """From both ends of a line: z + z' = 180 degrees + (1 - k) s / R."""
    found = {}
    for k in (0.0, 0.13, 0.5):
        block = made(noise=False, survey={"zenith_angles": 40, "refraction": k})
        found[k] = block.geodetic.value
        names = block.geodetic.start, block.geodetic.end
        s = np.hypot(*(_places(block, names[1]) - _places(block, names[0]))[:, :2].T)
    for k in (0.13, 0.5):
        np.testing.assert_allclose(found[0.0] - found[k], k * s / (2 * 6_371_000.0), rtol=2e-3)


def test_relative_control_holds_exactly_without_errors(exact: Block) -> None:
    to = pyproj.Transformer.from_crs(pyproj.CRS("EPSG:32650").to_3d(), "EPSG:4978", always_xy=True)
    control, members = exact.relative_control, exact.relative_control_members
    seen = set()
    for k, type_ in enumerate(control.type.tolist()):
        names = members.id[members.condition == k]
        X = np.stack(to.transform(*_places(exact, names).T), axis=1)
        size = np.linalg.svd(X - X.mean(axis=0), compute_uv=False)
        seen.add(type_)
        if type_ in ("plane", "vertical_plane"):
            assert size[2] < 1e-6 < size[1]
        elif type_ in ("line", "plumb_line", "horizontal_line"):
            assert size[1] < 1e-6
        elif type_ in ("equal_height", "horizontal_plane"):
            assert np.ptp(_places(exact, names)[:, 2]) < 1e-9
        elif type_ == "equal_distance":
            assert np.ptp(np.linalg.norm(X[1::2] - X[::2], axis=1)) < 1e-6
        elif type_ == "distance":
            assert np.linalg.norm(X[1] - X[0]) == pytest.approx(control.value[k], abs=1e-6)
        elif type_ in ("parallel", "perpendicular"):
            u, w = X[1] - X[0], X[3] - X[2]
            sine = np.linalg.norm(np.cross(u, w)) / np.linalg.norm(u) / np.linalg.norm(w)
            assert sine == pytest.approx(0.0 if type_ == "parallel" else 1.0, abs=1e-7)
    assert len(seen) == len(Condition.__args__)  # type: ignore[attr-defined]


def test_errors_have_the_size_of_the_sigmas_and_the_covariances_that_the_block_states() -> None:
    survey = {"baselines": 400, "directions_per_set": 4, "direction_sets": 50, "height_differences": 300}
    noisy, exact = (made(4, survey=survey, noise=noise) for noise in (True, False))
    g = noisy.geodetic
    e = ((g.value - exact.geodetic.value + np.pi) % (2 * np.pi) - np.pi) / g.sigma
    for name in ("direction", "height_difference", "dX", "dY", "dZ"):
        mine = e[g.type == name]
        assert mine.std() == pytest.approx(1.0, abs=4 / np.sqrt(2 * len(mine)))
    c = noisy.geodetic_covariances
    products = e[c.row_a] * e[c.row_b]
    expected = c.value / (g.sigma[c.row_a] * g.sigma[c.row_b])
    assert products.mean() == pytest.approx(expected.mean(), abs=4 / np.sqrt(400))
    assert len(c) == 3 * 400


def test_gross_errors_are_named_with_kind_row_and_size() -> None:
    survey = {"distances": 20, "angles": 20, "relative": {"plane": 3, "distance": 3, "parallel": 3}}
    wrong = made(2, survey=survey, gross_errors={"geodetic": 4, "relative_control": 5}, noise=False)
    right = made(2, survey=survey, noise=False)
    gross = wrong.gross_errors
    assert gross is not None
    geodetic = np.isin(gross.kind, ("distance", "angle"))
    assert geodetic.sum() == 4
    assert len(gross) == 9
    away = wrong.geodetic.value - right.geodetic.value
    np.testing.assert_allclose(away[gross.row[geodetic]], gross.size[geodetic, 0], rtol=1e-9)
    assert (np.abs(away) > 0).sum() == 4
    planes = gross.row[gross.kind == "plane"]
    assert (wrong.relative_control.type[wrong.relative_control_members.condition[planes]] == "plane").all()
    valued = gross.kind == "relative_distance"
    change = wrong.relative_control.value - right.relative_control.value
    np.testing.assert_allclose(change[gross.row[valued]], gross.size[valued, 0], rtol=1e-9)
    with pytest.raises(InputError, match="relative_control"):
        made(survey={}, gross_errors={"relative_control": 1})


def test_too_few_points_for_a_survey_are_told() -> None:
    few = {"ties": {"new_points": 0}, "known": {"full": 3}}
    with pytest.raises(GeometryError, match="3 points are too few for 5 lines"):
        made(survey={"direction_sets": 2}, **few)


@pytest.mark.parametrize("earth", ["flat", "tangent", "map"])
def test_other_earths_have_a_survey_too(earth: str) -> None:
    block = made(survey=SURVEY, earth=earth, noise=False, false_origin_m=(0.0, 0.0))
    assert np.isfinite(block.geodetic.value).all()
    rows = (block.geodetic.type == "distance") & (block.geodetic.end_kind == "point")
    away = _places(block, block.geodetic.end[rows]) - _places(block, block.geodetic.start[rows])
    ratio = block.geodetic.value[rows] / np.linalg.norm(away, axis=1)
    assert np.abs(ratio - 1).max() < 0.02  # heights of instrument and target


def test_a_survey_changes_nothing_else() -> None:
    plain, surveyed = made(3, survey={}), made(3, survey=SURVEY | {"relative": {}})
    assert content_digest(plain, without={"geodetic", "geodetic_covariances"}) == content_digest(
        surveyed, without={"geodetic", "geodetic_covariances"}
    )


# Points laid on shapes.


@pytest.mark.parametrize("seed", range(5))
def test_points_lie_all_around_a_cylinder_without_a_gap(seed: int) -> None:
    """Within 0.3 of their step of regular places, so that no gap is wider than 1.6 steps."""
    n = 12
    laid = _round("cylinder", n, 4.0, np.random.default_rng(seed))
    out = laid.away[:, 0]
    across = np.linalg.svd(out)[2][:2]
    x, y = across @ out.T
    turn = np.sort(np.arctan2(y, x))
    gaps = np.diff(np.append(turn, turn[0] + 2 * np.pi))
    assert gaps.max() <= 1.6 * 2 * np.pi / n + 1e-12
    np.testing.assert_allclose(np.linalg.norm(laid.offset_m @ across.T, axis=1), 2.0)


def test_points_of_a_sphere_lie_on_it() -> None:
    laid = _round("sphere", 9, 6.0, np.random.default_rng(2))
    np.testing.assert_allclose(np.linalg.norm(laid.offset_m, axis=1), 3.0)
    np.testing.assert_allclose(laid.away[:, 0] * 3.0, laid.offset_m, atol=1e-12)


# The spherical earth: map and tangent frame are of one world.

R = 6_371_000.0


def both():
    options = {"noise": False, "flight": {"strips": 6, "images_per_strip": 12}}
    return [
        simulate(options=SimulateOptions(earth=kind, **options), rng=np.random.default_rng(5))
        for kind in ("map", "tangent")
    ]


def test_distances_on_the_sphere_are_the_same_from_map_and_tangent_frame() -> None:
    in_map, in_tangent = both()
    m, t = in_map.true_points.xyz_m, in_tangent.true_points.xyz_m + np.array([0.0, 0.0, R])
    np.testing.assert_allclose(np.linalg.norm(t, axis=1) - R, m[:, 2], rtol=0, atol=1e-8)
    direction = t / np.linalg.norm(t, axis=1)[:, None]
    chord = np.linalg.norm(direction[1:] - direction[:-1], axis=1)
    z = (m[:, 0] + 1j * m[:, 1]) / (2 * R)  # closed form of the stereographic chord
    closed = 2 * np.abs(z[1:] - z[:-1]) / np.sqrt((1 + np.abs(z[1:]) ** 2) * (1 + np.abs(z[:-1]) ** 2))
    np.testing.assert_allclose(R * chord, R * closed, rtol=0, atol=1e-8)


def test_both_blocks_hold_the_same_image_points() -> None:
    in_map, in_tangent = both()
    np.testing.assert_array_equal(in_map.image_points.xy, in_tangent.image_points.xy)
    assert (in_map.earth_curvature, in_tangent.earth_curvature) == ("correct", "ignore")


def test_the_axes_of_a_place_are_where_the_coordinates_grow() -> None:
    place = np.array([[2500.0, -1800.0, 300.0], [-40e3, 90e3, 12.0]])
    axes = earth.tangent_from_place(place)
    np.testing.assert_allclose(axes @ axes.swapaxes(1, 2), np.broadcast_to(np.eye(3), (2, 3, 3)), atol=1e-15)
    for k, step in enumerate(np.eye(3)):
        growth = (earth.tangent_from_map(place + step) - earth.tangent_from_map(place - step)) / 2
        np.testing.assert_allclose(growth / np.linalg.norm(growth, axis=1)[:, None], axes[:, :, k], atol=1e-9)


def test_the_map_has_scale_one_at_the_centre() -> None:
    near = earth.tangent_from_map(np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, -10.0, 0.0]]))
    np.testing.assert_allclose(near[:, :2], [[0, 0], [10, 0], [0, -10]], atol=1e-10)


def test_a_rotation_in_the_tangent_frame_is_that_of_the_place_turned() -> None:
    in_map, in_tangent = both()
    axes = earth.tangent_from_place(in_map.true_images.position_m)
    turned = axes @ in_map.true_images.ground_from_image
    np.testing.assert_allclose(turned, in_tangent.true_images.ground_from_image, atol=1e-15)


def test_a_false_origin_adds_exactly() -> None:
    origin = (446000.0, 4505000.0)
    local = earth.settled(np.random.default_rng(1).uniform(-3000, 3000, (1000, 3)), origin)
    given = local + np.array([*origin, 0.0])
    np.testing.assert_array_equal(given - np.array([*origin, 0.0]), local)
