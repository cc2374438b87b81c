"""The same block told in another way gives the same answer: order, names, units, frame, weights, splitting.

Differences are in standard deviations. Beside the bound of 1e-8 stands 2e-9 m: what coordinates of some 4,000 km hold.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.geometry.rotations import exp_rotation
from aatri.observations.control import control_of
from aatri.observations.poses import POINT, POSE, Poses
from aatri.observations.positions import positions_of
from aatri.orientation.bundle.result import BundleResult
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from tests.orientation.bundle.parts import Parts, adjust_bundle
from tests.stages.chain import run_chain, simulated

Array = np.ndarray


@pytest.fixture(scope="module")
def given() -> Parts:
    """A block of 12 digital images with weighted control and observed positions; coordinates on a grid of 2^-10 m."""
    block = simulated(
        camera={"kind": "digital", "format": (6000.0, 6000.0), "pixel_size_mm": 0.01, "principal_distance_mm": 60.0},
        flight={"strips": 3, "images_per_strip": 4},
        ties={"per_position": 3},
        known={"full": 6},
    )
    chain = run_chain(block)
    made = bundle_input(observation_source(block, chain.refined, chain.strip_block), BundleOptions())
    assert made.rays is not None
    control, positions = control_of(block), positions_of(block)
    poses = Poses(_on_grid(made.poses.position_m + made.origin_m), made.poses.ground_from_image)
    return Parts(
        made.image_ids,
        made.point_ids,
        made.rays,
        poses,
        _on_grid(made.xyz_m + made.origin_m),
        replace(control, xyz_m=_on_grid(control.xyz_m)),
        replace(positions, position_m=_on_grid(positions.position_m)),
    )


@pytest.fixture(scope="module")
def reference(given: Parts) -> BundleResult:
    return _adjusted(given)


def _on_grid(xyz_m: Array) -> Array:
    return np.round(xyz_m * 1024) / 1024


def _adjusted(given: Parts, tolerance: float = 1e-10, **options: object) -> BundleResult:
    return adjust_bundle(given, tolerance=tolerance, **options)  # type: ignore[arg-type]


def _moved(given: Parts, rotation: Array, shift_m: Array, factor: float = 1.0) -> Parts:
    """The block in another object frame: X -> factor R X + t."""

    def there(x: Array) -> Array:
        return factor * x @ rotation.T + shift_m

    def spread(covariance: Array) -> Array:
        return factor**2 * rotation @ covariance @ rotation.T

    c, p = given.control, given.positions
    return replace(
        given,
        xyz_m=there(given.xyz_m),
        poses=Poses(there(given.poses.position_m), rotation @ given.poses.ground_from_image),
        control=replace(c, xyz_m=there(c.xyz_m), covariance_m2=spread(c.covariance_m2)),
        positions=replace(
            p, position_m=there(p.position_m), covariance_m2=spread(p.covariance_m2), lever_arm_m=factor * p.lever_arm_m
        ),
    )


def _assert_same(found: BundleResult, reference: BundleResult, bound: float = 1e-8, floor_m: float = 0.0) -> None:
    """Points, positions and rotations within `bound` standard deviations, standard deviations within 1e-9."""
    for name in ("point", "pose"):
        covariance = getattr(reference, f"{name}_covariance" + ("_m2" if name == "point" else ""))
        other = getattr(found, f"{name}_covariance" + ("_m2" if name == "point" else ""))
        sigma, again = (np.sqrt(np.einsum("nii->ni", c)) for c in (covariance, other))
        np.testing.assert_allclose(again, sigma, rtol=max(1e-9, bound), atol=floor_m)
        x, y = (r.xyz_m if name == "point" else r.poses.position_m for r in (reference, found))
        assert np.nanmax(np.abs(y - x) / (bound * sigma[:, :3] + floor_m + 1e-300)) <= 1
    turned = reference.poses.ground_from_image - found.poses.ground_from_image
    assert np.nanmax(np.abs(turned)) <= max(bound, 1e-8) * np.sqrt(np.einsum("nii->ni", covariance)[:, 3:].min())
    assert found.adjusted.sigma0 == pytest.approx(reference.adjusted.sigma0, rel=1e-9)


def _back(found: BundleResult, rotation: Array, shift_m: Array, factor: float = 1.0) -> BundleResult:
    """A result taken back to the frame of the reference."""
    G = np.kron(np.diag([1 / factor, 1.0]), rotation.T)
    return replace(
        found,
        xyz_m=(found.xyz_m - shift_m) @ rotation / factor,
        poses=Poses((found.poses.position_m - shift_m) @ rotation / factor, rotation.T @ found.poses.ground_from_image),
        covariances={
            POINT: rotation.T @ found.point_covariance_m2 @ rotation / factor**2,
            POSE: G @ found.pose_covariance @ G.T,
        },
    )


@pytest.mark.parametrize("seed", range(5))
def test_order_and_names_do_not_matter(given: Parts, reference: BundleResult, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rays, images, points = (rng.permutation(n) for n in (len(given.rays.image), len(given.image_ids), len(given.xyz_m)))
    new_image, new_point = np.argsort(images), np.argsort(points)
    shuffled = given.rays.take(rays)
    c, p = given.control, given.positions
    other = replace(
        given,
        image_ids=np.asarray(given.image_ids)[images],
        point_ids=np.array([f"p{k}" for k in range(len(points))]),
        rays=replace(
            shuffled, image=new_image[shuffled.image].astype(np.int32), point=new_point[shuffled.point].astype(np.int32)
        ),
        poses=Poses(given.poses.position_m[images], given.poses.ground_from_image[images]),
        xyz_m=given.xyz_m[points],
        control=replace(c, point=new_point[c.point]),
        positions=replace(p, image=new_image[p.image]),
    )
    found = _adjusted(other)
    back = replace(
        found,
        xyz_m=found.xyz_m[new_point],
        poses=Poses(found.poses.position_m[new_image], found.poses.ground_from_image[new_image]),
        covariances={POSE: found.pose_covariance[new_image], POINT: found.point_covariance_m2[new_point]},
    )
    _assert_same(back, reference)


@pytest.mark.parametrize("factor", [1000.0, 1e-3])
def test_the_unit_of_the_object_space_does_not_matter(given: Parts, reference: BundleResult, factor: float) -> None:
    frame = (np.eye(3), np.zeros(3), factor)
    _assert_same(_back(_adjusted(_moved(given, *frame)), *frame), reference, floor_m=1e-12)


def test_coordinates_of_a_map_do_not_matter(given: Parts, reference: BundleResult) -> None:
    frame = (np.eye(3), np.array([468000.0, 4410000.0, 0.0]))
    _assert_same(_back(_adjusted(_moved(given, *frame)), *frame), reference, floor_m=2e-9)


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.2), (2.0, 0.0, 0.0), (0.5, -1.0, 2.0)])
def test_a_rotated_object_frame_does_not_matter(
    given: Parts, reference: BundleResult, axis: tuple[float, float, float]
) -> None:
    frame = (exp_rotation(np.array([axis]))[0], np.zeros(3))
    _assert_same(_back(_adjusted(_moved(given, *frame)), *frame), reference, floor_m=1e-11)


@pytest.mark.parametrize("c", [0.01, 7.0])
def test_all_sigmas_times_c_leave_the_unknowns_and_divide_sigma0(
    given: Parts, reference: BundleResult, c: float
) -> None:
    scaled = replace(
        given,
        rays=replace(given.rays, sigma_mm=c * given.rays.sigma_mm),
        control=replace(given.control, covariance_m2=c**2 * given.control.covariance_m2),
        positions=replace(given.positions, covariance_m2=c**2 * given.positions.covariance_m2),
    )
    # a hundredth of sigma, a hundred times the rounding in units of it
    found = _adjusted(scaled, tolerance=1e-8)
    assert found.adjusted.sigma0 * c == pytest.approx(reference.adjusted.sigma0, rel=1e-9)
    back = replace(
        found,
        covariances={g: found.covariances[g] / c**2 for g in (POSE, POINT)},
        adjusted=replace(found.adjusted, sigma0=found.adjusted.sigma0 * c),
    )
    _assert_same(back, reference)


def test_an_image_point_split_in_two_of_sqrt_2_sigma_counts_the_same(given: Parts, reference: BundleResult) -> None:
    n = len(given.rays.image)
    twice = given.rays.take(np.concatenate([np.arange(n), np.arange(0, n, 3)]))
    sigma = twice.sigma_mm.copy()
    sigma[np.arange(0, n, 3)] *= np.sqrt(2)
    sigma[n:] *= np.sqrt(2)
    found = _adjusted(replace(given, rays=replace(twice, sigma_mm=sigma)))
    assert found.adjusted.cost == pytest.approx(reference.adjusted.cost, rel=1e-10)
    back = replace(found, adjusted=replace(found.adjusted, sigma0=reference.adjusted.sigma0))
    _assert_same(back, reference)


def test_exact_control_is_control_of_a_vanishing_sigma(given: Parts) -> None:
    c = given.control
    nothing, every = np.zeros_like(c.exact), np.ones_like(c.exact)
    exact = _adjusted(replace(given, control=replace(c, observed=nothing, exact=every)))
    tiny = np.tile(1e-18 * np.eye(3), (len(c.point), 1, 1))
    weighted = _adjusted(replace(given, control=replace(c, covariance_m2=tiny, observed=every, exact=nothing)), 1e-6)
    others = np.ones(len(given.xyz_m), dtype=bool)
    others[c.point] = False
    assert np.abs(weighted.xyz_m[~others] - exact.xyz_m[~others]).max() < 1e-9
    sigma = np.sqrt(np.einsum("nii->ni", exact.point_covariance_m2[others]))
    assert (np.abs(weighted.xyz_m[others] - exact.xyz_m[others]) / sigma).max() < 1e-6


def test_reproducible_is_the_same_bits_for_any_number_of_threads(given: Parts) -> None:
    one, two = (_adjusted(given, reproducible=True, threads=threads) for threads in (1, 2))
    assert (one.xyz_m == two.xyz_m).all()
    assert (one.poses.position_m == two.poses.position_m).all()
    assert (one.point_covariance_m2 == two.point_covariance_m2).all()
