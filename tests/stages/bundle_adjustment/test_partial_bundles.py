"""Resection, intersection and alternation beside the bundle."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.errors import ConvergenceError, GeometryError
from aatri.stages.bundle_adjustment.alternating import AlternatingOptions, alternating
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.bundle_adjustment.intersection import IntersectionOptions, intersection
from aatri.stages.bundle_adjustment.resection import ResectionOptions, resection
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.hand_block import Heard


def flown(**options: Any) -> Chain:
    return run_chain(
        simulated(
            preset="rc30",
            earth="tangent",
            false_origin_m=(0.0, 0.0),
            ties={"new_points": 80},
            flight={"strips": 2, "images_per_strip": 4, "cross_strips": 0},
            known={"full": 10, "check_full": 0},
            **options,
        )
    )


@pytest.fixture(scope="module")
def exact() -> Chain:
    return flown(noise=False)


@pytest.fixture(scope="module")
def noisy() -> Chain:
    return flown()


def truth(chain: Chain) -> Any:
    images, points = chain.block.true_images, chain.block.true_points
    assert images is not None
    assert points is not None
    X = np.full((len(chain.block.points), 3), np.nan)
    X[points.point] = points.xyz_m
    return images, X


def right(chain: Chain, found: Any) -> None:
    images, X = truth(chain)
    solved = np.isfinite(found.points.xyz_m[:, 0])
    assert solved.sum() > 0.9 * len(solved)
    assert found.images.position_m == pytest.approx(images.position_m, abs=1e-6)
    assert found.images.ground_from_image == pytest.approx(images.ground_from_image, abs=1e-9)
    assert found.points.xyz_m[solved] == pytest.approx(X[solved], abs=1e-6)


def moved(chain: Chain, *, images_m: float = 0.0, points_m: float = 0.0) -> Any:
    """The adjusted block with images or points moved."""
    rng, s = np.random.default_rng(1), chain.bundle
    return replace(
        s,
        images=replace(
            s.images, position_m=s.images.position_m + images_m * rng.normal(size=s.images.position_m.shape)
        ),
        points=replace(s.points, xyz_m=s.points.xyz_m + points_m * rng.normal(size=s.points.xyz_m.shape)),
    )


def test_error_free_images_are_resected_to_the_truth(exact: Chain) -> None:
    right(exact, resection(exact.block, exact.refined, moved(exact, images_m=2.0)))


def test_images_without_orientation_get_a_start_of_their_own(exact: Chain) -> None:
    images = exact.bundle.images
    unknown = replace(
        images,
        oriented=np.zeros(len(images), dtype=bool),
        position_m=np.full((len(images), 3), np.nan),
        ground_from_image=np.full((len(images), 3, 3), np.nan),
    )
    right(exact, resection(exact.block, exact.refined, replace(exact.bundle, images=unknown)))


def test_error_free_points_are_intersected_to_the_truth(exact: Chain) -> None:
    right(exact, intersection(exact.block, exact.refined, moved(exact, points_m=1.0)))


@pytest.mark.slow
def test_points_of_many_rays_have_the_covariance_of_their_own_normal_equations() -> None:
    """(sum J' J / sigma^2)^-1 of the rays of a point, J of the projection by differences; without film corrections."""
    made = run_chain(simulated(3, preset="uav", flight={"strips": 2, "images_per_strip": 4}, known={"full": 6}))
    solution, m = intersection(made.block, made.refined, made.strip_block), made.refined.measurements
    c_mm = made.block.cameras.principal_distance_mm[0]
    P, R, step = solution.images.position_m, solution.images.ground_from_image, 1e-3 * np.eye(3)

    def photo_mm(ray: int, X: Any) -> Any:
        u = R[m.image[ray]].T @ (X - P[m.image[ray]])
        return -c_mm * u[:2] / u[2]

    control, seen = made.block.ground_points.point, np.bincount(m.point, minlength=len(made.block.points))
    new = np.setdiff1d(np.flatnonzero(seen >= 3), control)
    for j in new[:20].tolist():
        N, X = np.zeros((3, 3)), solution.points.xyz_m[j]
        for ray in np.flatnonzero((m.point == j) & m.active).tolist():
            J = np.stack([(photo_mm(ray, X + h) - photo_mm(ray, X - h)) / 2e-3 for h in step], axis=1)
            J /= m.sigma_mm[ray][:, None]
            N += J.T @ J
        np.testing.assert_allclose(solution.points.covariance_m2[j] @ N, np.eye(3), atol=1e-3)


def test_error_free_blocks_alternate_to_the_truth(exact: Chain) -> None:
    right(exact, alternating(exact.block, exact.refined, exact.strip_block))


@pytest.mark.slow
def test_alternation_ends_where_the_bundle_does_and_has_no_standard_deviations(noisy: Chain) -> None:
    found = alternating(noisy.block, noisy.refined, noisy.strip_block)
    reference = bundle(noisy.block, noisy.refined, noisy.strip_block, options=BundleOptions(interior_unknowns=False))
    assert found.sigma0 == pytest.approx(reference.sigma0, rel=1e-6)
    sigma = np.sqrt(np.einsum("nii->ni", reference.points.covariance_m2))
    assert np.nanmax(np.abs(found.points.xyz_m - reference.points.xyz_m) / sigma) < 5e-3
    assert np.isnan(found.points.covariance_m2).all()
    assert found.redundancy == reference.redundancy


def test_an_alternation_that_has_not_converged_is_an_error(noisy: Chain) -> None:
    with pytest.raises(ConvergenceError, match="have not converged in 1 rounds"):
        alternating(noisy.block, noisy.refined, noisy.strip_block, options=AlternatingOptions(max_rounds=1))


def test_weighted_points_give_the_bundle_its_own_result_back(exact: Chain) -> None:
    found = resection(exact.block, exact.refined, exact.bundle, options=ResectionOptions(points="weighted"))
    right(exact, found)
    held = resection(exact.block, exact.refined, exact.bundle)
    assert (np.einsum("nii->ni", held.images.covariance) < np.einsum("nii->ni", found.images.covariance)).all()


def test_weighted_orientations_make_points_less_certain_than_held_ones(exact: Chain) -> None:
    weighted = intersection(
        exact.block, exact.refined, exact.bundle, options=IntersectionOptions(orientations="weighted")
    )
    right(exact, weighted)
    held = intersection(exact.block, exact.refined, exact.bundle)
    new = np.setdiff1d(np.arange(len(exact.block.points)), exact.block.ground_points.point)
    a, b = (np.einsum("nii->n", s.points.covariance_m2)[new] for s in (held, weighted))
    assert (a < b * 1.0001).all()
    assert a.mean() < 0.9 * b.mean()


def test_weights_need_covariances(exact: Chain) -> None:
    bare = bundle(exact.block, exact.refined, exact.strip_block, options=BundleOptions(standard_deviations=False))
    with pytest.raises(GeometryError, match="no covariance"):
        resection(exact.block, exact.refined, bare, options=ResectionOptions(points="weighted"))


def test_what_is_held_keeps_the_standard_deviations_it_came_with(noisy: Chain) -> None:
    points = resection(noisy.block, noisy.refined, noisy.bundle).points.covariance_m2
    assert np.array_equal(points, noisy.bundle.points.covariance_m2, equal_nan=True)
    images = intersection(noisy.block, noisy.refined, noisy.bundle).images.covariance
    assert np.array_equal(images, noisy.bundle.images.covariance, equal_nan=True)


@pytest.mark.parametrize(("stage", "each", "table"), [(resection, 3, "points"), (intersection, 6, "images")])
def test_what_is_held_at_values_made_of_the_same_rays_is_no_redundancy(
    noisy: Chain, stage: Any, each: int, table: str
) -> None:
    """Their residuals are those of the bundle: sigma0 counted with all of them is too small."""
    heard = Heard()
    found = stage(noisy.block, noisy.refined, noisy.bundle, context=heard)
    at = {"images": "position_m", "points": "xyz_m"}[table]
    count = int(np.isfinite(getattr(getattr(found, table), at)[:, 0]).sum())
    redundancy = found.redundancy - each * count
    of_both = found.sigma0 * (found.redundancy / redundancy) ** 0.5
    assert of_both == pytest.approx(noisy.bundle.sigma0, abs=0.1)  # the bundle adjusts control and film corrections too
    follows = f"{of_both:.3f} (redundancy {redundancy})"
    assert any("sigma0" in text and (follows in text or "expected" in text) for text in heard.logged)
    assert not any("sigma0" in text for text in heard.warned)


@pytest.mark.parametrize("start", ["closed", "linear"])
def test_images_without_orientation_are_resected_on_known_points(exact: Chain, start: str) -> None:
    images = exact.bundle.images
    lost = images.oriented.copy()
    lost[::3] = False
    blank = replace(
        images,
        oriented=lost,
        position_m=np.where(lost[:, None], images.position_m, np.nan),
        ground_from_image=np.where(lost[:, None, None], images.ground_from_image, np.nan),
    )
    found = resection(
        exact.block, exact.refined, replace(exact.bundle, images=blank), options=ResectionOptions(start=start)
    )
    assert found.images.oriented.all()
    assert found.images.position_m == pytest.approx(truth(exact)[0].position_m, abs=1e-6)


@pytest.mark.parametrize(
    ("stage", "options"),
    [(resection, ResectionOptions(reliability=True)), (intersection, IntersectionOptions(reliability=True))],
)
def test_the_redundancy_numbers_of_a_part_sum_up_to_its_redundancy(noisy: Chain, stage: Any, options: Any) -> None:
    """What is known and held is no observation; an image on many points controls all of them, a pair of rays not."""
    solution = stage(noisy.block, noisy.refined, noisy.bundle, options=options)
    assert solution.tests is not None
    assert np.nansum(solution.tests.redundancy) == pytest.approx(solution.redundancy, abs=1e-6)
    assert solution.uncontrolled is not None
    assert (len(solution.uncontrolled) > 0) == (stage is intersection)
