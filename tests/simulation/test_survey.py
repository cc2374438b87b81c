"""Simulated geodetic observations and relative control: what they are without errors, and where the errors are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest

from aatri.artifacts.block import TRUTH, Block
from aatri.errors import GeometryError, InputError
from aatri.formats.tables.writer import write_block
from aatri.simulation.survey_settings import Condition
from aatri.tables.digest import content_digest
from tests.campaigns.kinds import ALL
from tests.reading import read_block
from tests.stages.chain import simulated
from tests.stages.geodetic_blocks import CAMERA

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
