"""Places of points by a run: its own residuals, and clicks that fall into their ellipses as often as they should."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.measuring.orientation import Click, GroundEstimate, RunOrientation
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import run_chain, simulated
from tests.stages.film_blocks import Told

FLIGHT = {"flight": {"strips": 2, "images_per_strip": 5}, "ties": {"new_points": 150}}
FILM = {"preset": "rc30", **FLIGHT, "known": {"full": 8, "check_full": 0}}
UAV = {"preset": "uav", **FLIGHT, "known": {"full": 8, "check_full": 0}}


@pytest.fixture(scope="module", params=["film", "uav", "calibrated"])
def orientation(request: pytest.FixtureRequest) -> RunOrientation:
    chain = run_chain(simulated(**(FILM if request.param == "film" else UAV)), BundleOptions())
    solution = chain.bundle
    if request.param == "calibrated":
        options = BundleOptions(self_calibration={"set": "brown_conrady"})
        solution = bundle(chain.block, chain.refined, chain.strip_block, options=options, context=Told())
    return RunOrientation(chain.block, chain.refined, solution)


def test_residuals_are_those_of_the_adjustment(orientation: RunOrientation) -> None:
    r, measured = orientation.solution.residuals, orientation.block.image_points
    rows = np.flatnonzero((r.kind == "image_point") & r.active)
    at = r.row[rows]
    v = orientation.residuals_mm(measured.image[at], orientation.xyz_m[measured.point[at]], measured.xy[at])
    told = r.residual[rows, :2]
    assert np.sqrt(((v - told) ** 2).mean()) < 0.02 * np.sqrt((told**2).mean())


def _clicks(orientation: RunOrientation, point: int) -> list[Click]:
    """Image points as clicks: of the simulation, so with the errors that their standard deviations tell."""
    block, m = orientation.block, orientation.block.image_points
    rows = np.flatnonzero((m.point == point) & m.active & orientation.oriented[m.image])
    return [Click(str(block.images.id[m.image[k]]), m.xy[k], m.sigma_mm[k]) for k in rows]


def _of_many_rays(orientation: RunOrientation, least: int) -> list[int]:
    ties = np.setdiff1d(np.arange(len(orientation.block.points)), orientation.block.ground_points.point)
    return [int(k) for k in ties if len(_clicks(orientation, int(k))) >= least][:8]


def test_a_point_of_the_run_is_where_it_was_measured(orientation: RunOrientation) -> None:
    t = []
    for point in _of_many_rays(orientation, 3):
        name = str(orientation.block.points.id[point])
        there = orientation.places(name, [], None)
        for click in _clicks(orientation, point):
            A = orientation.rays.table_from_mm(orientation.row[click.image])
            C = A @ np.diag(click.sigma_mm**2) @ A.T
            off = click.xy - there[click.image].xy
            t.append(off @ np.linalg.solve(C, off))
    assert 0.8 < np.mean(t) < 2.4  # residuals of an adjustment, which has taken up some of the errors


@pytest.mark.slow(after=1)
def test_of_two_clicks_the_others_follow_within_their_ellipses(orientation: RunOrientation) -> None:
    t = []
    for point in _of_many_rays(orientation, 4):
        first, second, *others = _clicks(orientation, point)
        there = orientation.places("not in the run", [first, second], None)
        for click in others:
            A = orientation.rays.table_from_mm(orientation.row[click.image])
            C = there[click.image].covariance + A @ np.diag(click.sigma_mm**2) @ A.T
            off = click.xy - there[click.image].xy
            t.append(off @ np.linalg.solve(C, off))
    assert len(t) > 15
    assert 0.3 < np.mean(t) < 3.5  # chi-square with 2, less where poses that are taken as independent err alike


@pytest.mark.slow
def test_a_wrong_click_is_told_by_its_test_and_good_ones_are_not(orientation: RunOrientation) -> None:
    called_wrong = 0
    points = _of_many_rays(orientation, 4)
    for point in points:
        clicks = _clicks(orientation, point)
        called_wrong += sum(place.wrong for place in orientation.places("x", clicks, None).values())
        bad = clicks[1]
        A = orientation.rays.table_from_mm(orientation.row[bad.image])
        clicks[1] = Click(bad.image, bad.xy + A @ (40.0 * bad.sigma_mm), bad.sigma_mm)
        there = orientation.places("x", clicks, None)
        tests = {image: place.t for image, place in there.items() if place.t is not None}
        assert there[bad.image].wrong
        assert max(tests, key=lambda image: tests[image]) == bad.image
    assert called_wrong <= 1


def test_one_click_tells_along_its_ray(orientation: RunOrientation) -> None:
    point = _of_many_rays(orientation, 3)[0]
    first, *others = _clicks(orientation, point)
    there = orientation.places("not in the run", [first], None)
    for click in others:
        off, C = click.xy - there[click.image].xy, there[click.image].covariance
        assert off @ np.linalg.solve(C, off) < 13.8
        assert there[click.image].t is None


def test_control_without_a_click_is_found_by_its_coordinates(orientation: RunOrientation) -> None:
    block = orientation.block
    for k, point in enumerate(block.ground_points.point.tolist()):
        g = block.ground_points
        control = orientation.control(g.xyz_m[k], g.covariance_m2[k], str(block.frames.crs[0]))
        assert isinstance(control, GroundEstimate)
        there = orientation.places("not in the run", [], control)
        for click in _clicks(orientation, point):
            A = orientation.rays.table_from_mm(orientation.row[click.image])
            C = there[click.image].covariance + A @ np.diag(click.sigma_mm**2) @ A.T
            off = click.xy - there[click.image].xy
            assert off @ np.linalg.solve(C, off) < 25.0
    assert orientation.control(np.zeros(3), np.eye(3), "EPSG:4978") is None
