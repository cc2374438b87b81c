"""strip_adjustment/polynomial on made-up free strips."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from aatri.adapters.strips.strip_adjustment import rays_of_ties
from aatri.artifacts.suspects import Suspects
from aatri.errors import ConvergenceError, GeometryError, InputError
from aatri.geometry.rotations import log_rotation
from aatri.orientation.bodies.deformation import distance_m, most_models
from aatri.orientation.bodies.determined_degrees import StripBlockOptions
from aatri.stages.absolute_orientation.similarity import SimilarityOptions, similarity
from aatri.stages.strip_adjustment.conformal import conformal
from aatri.stages.strip_adjustment.polynomial import PolynomialOptions, polynomial
from tests.made_strips import HEIGHT_M, Heard, MadeBlock


def _adjusted(made, *, components="all", **options):
    heard = Heard()
    block, points, strips = made.block(), made.image_points(), made.strips()
    initial = similarity(block, strips, points, options=SimilarityOptions(components=components))
    solution = polynomial(block, points, strips, initial, options=PolynomialOptions(**options), context=heard)
    return initial, solution, heard


def _rms(made, solution):
    return np.sqrt(np.nanmean((solution.points.xyz_m - made.truth) ** 2))


def _bend(strip, X):
    """A sag along the strip and a tilt growing along it."""
    u = X[0] / 1000.0
    return np.array([0.0, 0.0, (1.5 if strip % 2 else -1.5) * u * u + 0.001 * u * X[1]])


def test_error_free_strips_stay_exact_and_so_do_the_resected_images() -> None:
    made = MadeBlock(3, 5)
    made.control(range(0, len(made.truth), 7))
    _, solution, _ = _adjusted(made)
    turn = log_rotation(solution.images.ground_from_image @ made.truth_R.swapaxes(1, 2))
    assert np.nanmax(np.abs(solution.points.xyz_m - made.truth)) < 1e-6
    assert np.abs(solution.images.position_m - made.truth_X0).max() < 1e-6
    assert np.abs(turn).max() < 1e-9


def test_bent_strips_are_straightened() -> None:
    made = MadeBlock(3, 6, deformation=_bend)
    made.control(range(0, len(made.truth), 5))
    initial, solution, heard = _adjusted(made)
    assert heard.warnings == []
    assert _rms(made, initial) > 0.05
    assert _rms(made, solution) < 0.015
    models = set(solution.transformations.model.tolist())
    assert models == {"similarity", "polynomial_2"}


@pytest.mark.slow
def test_strips_may_have_degrees_of_their_own() -> None:
    made = MadeBlock(3, 6, deformation=_bend)
    made.control(range(0, len(made.truth), 5))
    ids = made.strips().strips.id.tolist()
    for options, expected in (
        ({"degree": 2, "degrees": {ids[1]: 3}}, [2, 3, 2]),
        ({"degree": 3, "degrees": {ids[0]: 1, ids[2]: 2}}, [1, 3, 2]),
    ):
        _, solution, _ = _adjusted(made, **options)
        t = solution.transformations
        for name, degree in zip(ids, expected):
            mine = set(t.model[(t.id == name) & (t.model != "similarity")].tolist())
            assert mine == {f"polynomial_{degree}"}


def test_a_degree_for_a_strip_that_is_not_there_is_an_error_that_lists_the_strips() -> None:
    made = MadeBlock(2, 6)
    made.control(range(0, len(made.truth), 5))
    with pytest.raises(InputError, match="names strip 9") as caught:
        _adjusted(made, degrees={"9": 1})
    assert all(name in caught.value.what for name in made.strips().strips.id.tolist())


def test_a_degree_of_a_strip_is_that_of_all_its_parts() -> None:
    names = np.array(["1.1", "1.2", "2"])
    assert StripBlockOptions(degrees={"1": 1}).degrees_of(names).tolist() == [1, 1, 2]
    assert StripBlockOptions(degrees={"1.2": 3, "2": 0}).degrees_of(names).tolist() == [2, 3, 0]


def test_what_the_conformal_adjustment_rejects_is_a_warning() -> None:
    made = MadeBlock(3, 6)
    made.control(range(0, len(made.truth), 5))
    block, points, strips = made.block(), made.image_points(), made.strips()
    initial = similarity(block, strips, points)
    ground = block.ground_points
    xyz = ground.xyz_m.copy()
    xyz[2, 2] += 5.0
    wrong = replace(block, ground_points=replace(ground, xyz_m=xyz))
    heard = Heard()
    solution = conformal(wrong, points, strips, initial, context=heard)
    name = str(block.points.id[ground.point[2]])
    assert name in solution.suspects.point[solution.suspects.verdict == "rejected"].tolist()
    assert any("rejected as gross errors" in text and name in text for text in heard.warnings)


def test_the_degree_falls_with_little_control_and_the_fall_is_reported() -> None:
    made = MadeBlock(2, 6)
    made.control(made.corners())
    _, solution, heard = _adjusted(made, degree=2)
    assert "polynomial_2" not in solution.transformations.model
    assert any(text.startswith("strip 1, height: polynomial_") and "rank 9 of 10" in text for text in heard.warnings)
    assert _rms(made, solution) < 1e-6


@pytest.mark.slow
def test_a_degree_can_be_asked_for() -> None:
    made = MadeBlock(2, 6)
    made.control(range(0, len(made.truth), 5))
    _, solution, _ = _adjusted(made, degree=1)
    assert set(solution.transformations.model.tolist()) == {"similarity", "polynomial_1"}


def test_strips_that_are_not_oriented_are_left_out_and_named() -> None:
    made = MadeBlock(2, 5, gap_m=400.0)
    made.control(np.flatnonzero(made.truth[:, 1] < made.truth[:, 1].mean())[::5])
    _, solution, heard = _adjusted(made, components="largest")
    assert solution.images.oriented.sum() == 5
    assert any("left out: 2" in text for text in heard.warnings)


def test_control_rejected_before_is_tested_again() -> None:
    made = MadeBlock(3, 6, noise_m=0.01)
    made.control(range(0, len(made.truth), 6), sigma_m=0.01)
    made.control([24], sigma_m=0.01, error_m=(0.0, 0.0, 1.5))
    initial, solution, _ = _adjusted(made)
    assert initial.suspects.point.tolist() == ["p024"]
    assert solution.suspects.point[solution.suspects.kind == "control"].tolist() == ["p024"]
    assert set(solution.suspects.stage.tolist()) == {"strip_adjustment"}


def test_an_initial_solution_without_orientations_is_refused() -> None:
    made = MadeBlock(2, 5)
    made.control(made.corners())
    block, points, strips = made.block(), made.image_points(), made.strips()
    initial = similarity(block, strips, points)
    nothing = replace(
        initial.images,
        oriented=np.zeros(10, dtype=bool),
        position_m=np.full((10, 3), np.nan),
        ground_from_image=np.full((10, 3, 3), np.nan),
    )
    with pytest.raises(GeometryError, match="orients no strip"):
        polynomial(block, points, strips, replace(initial, images=nothing))


def test_ties_of_right_control_are_not_rejected_for_one_that_is_wrong() -> None:
    made = MadeBlock(3, 4, noise_m=0.003)
    corners = made.corners()
    made.control(corners, sigma_m=0.01).control(corners[:1], sigma_m=0.01, error_m=(3.0, 0, 0))
    _, solution, heard = _adjusted(made)
    suspects = solution.suspects
    rejected = suspects.verdict == "rejected"
    assert np.isfinite(suspects.test[rejected]).all()
    assert np.isfinite(suspects.sigma[rejected]).all()
    assert (suspects.kind[rejected] == "control").all()
    assert rejected.sum() <= 1
    kept = suspects.point[suspects.verdict == "kept"]
    assert all(any(point in text for text in heard.warnings if "not rejected" in text) for point in kept)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("n", [6, 13])
def test_several_wrong_control_points_of_few_are_all_found(n: int) -> None:
    made = MadeBlock(3, 6, noise_m=0.005)
    made.control(np.linspace(0, len(made.truth) - 1, n).astype(int), sigma_m=0.01)
    wrong = sorted(made.given)[1 : 1 + (2 if n == 6 else 3)]
    made.control(wrong, sigma_m=0.01, error_m=(0.6, -0.5, 0.9)).positions(range(len(made.truth_X0)), sigma_m=0.05)
    _, solution, _ = _adjusted(made)
    out = (solution.suspects.verdict == "rejected") & (solution.suspects.kind == "control")
    assert sorted(solution.suspects.point[out].tolist()) == [f"p{k:03d}" for k in wrong]
    assert _rms(made, solution) < 0.05


def test_ties_that_an_earlier_stage_rejected_at_a_point_come_back_if_nothing_else_ties_it() -> None:
    made = MadeBlock(3, 5, noise_m=0.005)
    made.control(range(0, len(made.truth), 4), sigma_m=0.01)
    block, points, strips = made.block(), made.image_points(), made.strips()
    initial = similarity(block, strips, points)
    single = np.flatnonzero(np.bincount(strips.strip_points.point) == 1)
    point = int(single[np.isin(single, block.ground_points.point)][0])
    row = int(np.flatnonzero(strips.strip_points.point == point)[0])
    suspects = Suspects(
        kind=["strip_tie"],
        row=[-1],
        image=strips.strips.id[strips.strip_points.strip[[row]]],
        point=block.points.id[[point]],
        stage=["absolute_orientation"],
        size=[0.0],
        unit=["m"],
        sigma=[np.nan],
        test=[np.nan],
        verdict=["rejected"],
    )
    solution = polynomial(block, points, strips, replace(initial, suspects=suspects))
    assert solution.suspects.verdict.tolist() == ["readmitted"]
    assert np.isfinite(solution.points.xyz_m[point]).all()


def test_a_rejected_tie_of_a_strip_stands_for_the_image_points_it_was_made_of() -> None:
    made = MadeBlock(3, 5, noise_m=0.01)
    strips, points, m = made.strips(), made.image_points(), made.image_points().measurements
    images, point = strips.strip_images, int(strips.strip_points.point[strips.strip_points.strip == 1][0])
    wrong = rays_of_ties(points, images.strip, images.image, np.array([1]), np.array([point]))
    of_strip = np.isin(m.image, images.image[images.strip == 1])
    np.testing.assert_array_equal(wrong, (m.point == point) & of_strip)
    assert wrong.any()
    assert not rays_of_ties(points, images.strip, images.image, np.zeros(0, int), np.zeros(0, int)).any()


@pytest.mark.slow
def test_strips_that_do_not_fit_control_at_all_are_an_error() -> None:
    made = MadeBlock(3, 5, noise_m=0.01)
    rng = np.random.default_rng(2)
    made.control(range(0, len(made.truth), 5), sigma_m=0.01)
    for p in list(made.given):
        made.control([p], sigma_m=0.01, error_m=rng.normal(0, 60.0, 3))
    with pytest.raises(ConvergenceError, match="beyond max_sigma0"):
        _adjusted(made)


def test_strips_that_fit_badly_after_they_were_oriented_are_named_and_the_bundle_begins_from_them() -> None:
    """As models of five points leave them: one strip is off by 1 % of its distance, a hundred times what it states."""
    made = MadeBlock(3, 5, noise_m=0.01)
    made.control(range(0, len(made.truth), 5), sigma_m=0.01)
    block, points, strips = made.block(), made.image_points(), made.strips()
    initial, p = similarity(block, strips, points), strips.strip_points
    off = np.random.default_rng(3).normal(0, 0.01 * np.abs(p.xyz[:, 2]).mean(), p.xyz.shape) * (p.strip == 1)[:, None]
    bad, heard = replace(strips, strip_points=replace(p, xyz=p.xyz + off)), Heard()
    solution = polynomial(block, points, bad, initial, context=heard)
    (text,) = (text for text in heard.warnings if f"farthest off: strip {strips.strips.id[1]} " in text)
    off_m, share = map(float, re.findall(r"but by ([0-9.]+) m \(RMS\), ([0-9.]+)% of the distance", text)[0])
    assert 100 * off_m / share == pytest.approx(HEIGHT_M, rel=0.1)
    assert solution.images.oriented.all()
    with pytest.raises(ConvergenceError, match="beyond max_sigma0 = 20 "):
        polynomial(block, points, bad, initial, options=PolynomialOptions(max_sigma0=20.0))


def test_sigma0_is_told_with_what_is_expected_and_its_interval() -> None:
    made = MadeBlock(3, 5, noise_m=0.02)
    made.control(range(0, len(made.truth), 5), sigma_m=0.02)
    _, _, heard = _adjusted(made)
    assert any("sigma0 with the deformation of the strips counted" in line and "95 %" in line for line in heard.lines)
    assert any("sigma0 of control" in line for line in heard.lines)
    assert heard.warnings == []
    with pytest.raises(ConvergenceError, match="4 models"):
        _adjusted(made, max_sigma0=0.1)


def test_a_strip_has_a_model_less_than_images() -> None:
    made = MadeBlock(2, 5, noise_m=0.02)
    made.control(made.corners(), sigma_m=0.05)
    assert most_models(made.strips()) == 4


def test_the_distance_of_a_strip_is_from_the_middle_of_its_images_to_that_of_its_points() -> None:
    """By hand: from (10, 0, 500) to (10, 300, 100); a point without coordinates does not count."""
    images = np.array([[0.0, 0.0, 500.0], [20.0, 0.0, 500.0]])
    points = np.array([[0.0, 300.0, 100.0], [20.0, 300.0, 100.0], [np.nan, np.nan, np.nan]])
    assert distance_m(images, points) == pytest.approx(500.0)
