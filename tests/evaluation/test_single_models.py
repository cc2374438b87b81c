"""Single-model restitution, against an intersection and a parallax of its own kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment import threads
from aatri.artifacts.block import CHECK
from aatri.artifacts.solution import DatumCarriers
from aatri.evaluation import ray_pairs, single_models
from aatri.evaluation.ray_pairs import ModelRays
from aatri.evaluation.single_models import intersected
from aatri.observations.poses import Poses
from aatri.stages.accuracy.evaluation import evaluation
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.geodetic_blocks import made

SMALL = {
    "preset": "rc30",
    "flight": {"strips": 2, "images_per_strip": 4, "cross_strips": 0},
    "known": {"full": 8},
    "ties": {"new_points": 80},
}


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(simulated(3, **SMALL))


def corrected(chain: Chain, image: int) -> dict[int, np.ndarray]:
    """Refined coordinates of an image's points with its estimated film corrections, by hand, mm."""
    m, s = chain.refined.measurements, chain.bundle
    p = s.parameters
    mine = (p.object == chain.block.images.id[image]) & np.char.startswith(p.group, "film")
    d = p.value[mine]
    rows = np.flatnonzero((m.image == image) & m.active)
    out = set(s.suspects.row[s.suspects.kind == "image_point"].tolist())
    x0 = chain.block.cameras.principal_point_mm[0]
    found = {}
    for r in rows.tolist():
        if r not in out:
            x, y = m.xy_mm[r] + x0  # from the fiducial centre
            film = [d[0] + d[1] * x + d[2] * y, d[3] + d[4] * x + d[5] * y] if len(d) else [0.0, 0.0]
            found[int(m.point[r])] = m.xy_mm[r] + film
    return found


def test_every_model_is_what_two_rays_give(chain: Chain) -> None:
    """Independently: rays with their corrections, nearest point of two skew lines, parallax by an epipolar angle."""
    found = evaluation(chain.block, chain.bundle).models
    assert found is not None
    ids, s = chain.block.images.id, chain.bundle
    assert list(zip(found.left, found.right)) == [(ids[i], ids[i + 1]) for i in (0, 1, 2, 4, 5, 6)]
    c = chain.block.cameras.principal_distance_mm[0]
    for k, (left, right) in enumerate(zip(found.left, found.right)):
        i, j = (int(np.flatnonzero(ids == name)[0]) for name in (left, right))
        a, b = corrected(chain, i), corrected(chain, j)
        X0, R = s.images.position_m, s.images.ground_from_image
        base = X0[j] - X0[i]
        off, parallax = [], []
        for point in sorted(set(a) & set(b)):
            d1, d2 = R[i] @ [*a[point], -c], R[j] @ [*b[point], -c]
            t = np.linalg.lstsq(np.column_stack([d1, -d2]), base, rcond=None)[0]
            off.append(X0[i] + t[0] * d1 - 0.5 * ((X0[i] + t[0] * d1) - (X0[j] + t[1] * d2)) - s.points.xyz_m[point])
            n1, n2 = np.cross(base, d1), np.cross(base, d2)  # epipolar planes of both rays
            angle = np.cross(n1, n2) @ base / np.linalg.norm(base) / np.linalg.norm(n1) / np.linalg.norm(n2)
            across = np.linalg.norm(n1) / np.linalg.norm(base)  # distance of the ray's end from the base
            slope = abs(n1 @ np.cross(base, [0, 0, 1.0])) / np.linalg.norm(n1) / np.linalg.norm(base)
            parallax.append(1e3 * angle * across / slope)
        assert found.points[k] == len(off)
        assert found.parallax_rms_um[k] == pytest.approx(np.sqrt(np.mean(np.square(parallax))), rel=0.03)
        # the middle between the rays is not least squares of image coordinates, but near it
        difference = np.sqrt(np.mean(np.square(off), axis=0))
        assert found.adjusted_rms_m[k] == pytest.approx(difference, abs=0.2 * difference.max())


def test_parallaxes_are_those_of_the_noise(chain: Chain) -> None:
    """p_y has sigma sqrt 2, but for the share that orientations and third rays take up or add."""
    found = evaluation(chain.block, chain.bundle)
    figures = found.metrics()
    assert figures["single_models"] == 6
    sigma_um = 1e3 * float(np.median(chain.refined.measurements.sigma_mm))
    assert 0.8 * np.sqrt(2) * sigma_um < figures["model_parallax_rmse_um"] < 1.15 * np.sqrt(2) * sigma_um
    assert 0.8 < figures["model_w_rms"] < 1.1
    assert "6 single models" in found.verdict


def test_check_points_of_a_model_are_compared_with_what_is_given(chain: Chain) -> None:
    found = evaluation(chain.block, chain.bundle).models
    assert found is not None
    g = chain.block.ground_points
    check = set(g.point[(g.role == CHECK).any(axis=1)].tolist())
    for k, (left, right) in enumerate(zip(found.left, found.right)):
        seen = [set(corrected(chain, int(np.flatnonzero(chain.block.images.id == name)[0]))) for name in (left, right)]
        assert found.check_points[k] == len(check & seen[0] & seen[1])
    some = found.check_points > 0
    assert np.isfinite(found.check_rms_m[some]).all()
    assert np.isnan(found.check_rms_m[~some]).all()


def test_models_of_a_free_datum_are_not_compared_with_check_points_of_another_frame(chain: Chain) -> None:
    """A free block of a quarry had model differences of 4,400 km."""
    datum = DatumCarriers(kind=["point"] * 3, id=chain.block.points.id[:3])
    rays = chain.bundle.residuals.take(chain.bundle.residuals.kind == "image_point")
    result = evaluation(chain.block, replace(chain.bundle, residuals=rays, datum=datum))
    assert result.models is not None
    assert result.models.points.sum() > 0
    assert result.models.check_points.sum() == 0
    assert result.verdict.endswith("not compared with check points: the datum is free, and they are in another frame.")


def test_models_are_compared_with_check_points_where_control_determines_all_of_a_free_datum(chain: Chain) -> None:
    datum = DatumCarriers(kind=["point"] * 3, id=chain.block.points.id[:3])
    result, given = (evaluation(chain.block, s) for s in (replace(chain.bundle, datum=datum), chain.bundle))
    assert result.models is not None
    assert given.models is not None
    np.testing.assert_array_equal(result.models.check_rms_m, given.models.check_rms_m)
    assert result.models.check_points.sum() > 0
    assert "not compared" not in result.verdict


def test_images_without_a_strip_are_paired_with_the_image_they_share_most_points_with(chain: Chain) -> None:
    images = chain.block.images
    block = replace(chain.block, images=replace(images, strip=np.full(len(images), -1, dtype=np.int32)))
    found = evaluation(block, chain.bundle).models
    assert found is not None
    points = [set(corrected(chain, i)) for i in range(len(images))]
    of = {str(name): i for i, name in enumerate(images.id)}
    pairs = {frozenset((of[str(a)], of[str(b)])) for a, b in zip(found.left, found.right)}
    for i, mine in enumerate(points):
        most = max(len(mine & points[j]) for j in range(len(points)) if j != i)
        assert any(i in pair and len(set.intersection(*(points[j] for j in pair))) == most for pair in pairs)


def test_pieces_and_threads_change_no_model(chain: Chain, monkeypatch: pytest.MonkeyPatch) -> None:
    images = chain.block.images
    strip = np.where(np.arange(len(images)) % 3 == 0, -1, images.strip).astype(np.int32)
    block = replace(chain.block, images=replace(images, strip=strip))
    at_once = evaluation(block, chain.bundle).models
    monkeypatch.setattr(single_models, "CHUNK", 7)
    monkeypatch.setattr(single_models, "PAIRS_AT_ONCE", 2)
    monkeypatch.setattr(ray_pairs, "IMAGES_AT_ONCE", 2)
    monkeypatch.setattr(threads, "default_threads", lambda: 3)
    in_pieces = evaluation(block, chain.bundle).models
    assert at_once is not None
    assert in_pieces is not None
    for name in type(at_once).__dataclass_fields__:
        np.testing.assert_array_equal(getattr(in_pieces, name), getattr(at_once, name), err_msg=name)


def test_two_images_from_one_place_are_no_model(chain: Chain) -> None:
    s = chain.bundle
    position = s.images.position_m.copy()
    position[1] = position[0]
    found = evaluation(chain.block, replace(s, images=replace(s.images, position_m=position))).models
    assert found is not None
    assert (str(s.images.id[0]), str(s.images.id[1])) not in zip(found.left.tolist(), found.right.tolist())


def test_a_solution_without_image_points_has_no_models(chain: Chain) -> None:
    found = evaluation(chain.block, chain.strip_block)
    assert found.models is None
    assert "single_models" not in found.metrics()


def test_models_of_a_block_in_a_map_are_restituted_in_its_tangent_frame() -> None:
    """3 km up the scale of the map, 0.9996, would lift points by 1.2 m; in the tangent frame rays are straight."""
    block = made(1, 3000.0)
    solution = bundle(block, calibrated(block))
    found = evaluation(block, solution).models
    assert found is not None
    sigma = np.sqrt(np.nanmedian(np.einsum("nii->ni", solution.points.covariance_m2), axis=0))
    # Two rays instead of many: a model is less precise than the block, but by no metre.
    assert (np.sqrt(np.mean(found.adjusted_rms_m**2, axis=0)) < 3 * sigma).all()
    assert (np.sqrt(np.mean(found.adjusted_rms_m**2, axis=0)) < 0.4).all()
    noise_um = 1e3 * float(np.median(block.image_points.sigma_mm))
    assert 0.7 * np.sqrt(2) * noise_um < np.sqrt(np.mean(found.parallax_rms_um**2)) < 1.3 * np.sqrt(2) * noise_um


def test_two_rays_that_do_not_meet_have_no_point_and_the_others_theirs() -> None:
    """Images above each other's neighbour looking down: x - c X / Z; parallel rays have equal coordinates."""
    X0 = np.array([[0.0, 0.0, 100.0], [30.0, 0.0, 100.0]])
    poses = Poses(X0, np.tile(np.eye(3), (2, 1, 1)))
    xyz = np.array([[10.0, 5.0, 0.0], [1e9, 0.0, -1e12]])
    xy = np.stack([50.0 * (xyz - x0)[:, :2] / (x0 - xyz)[:, 2:] for x0 in X0], axis=1)
    rays = ModelRays(
        left=np.array([0]),
        right=np.array([1]),
        model=np.array([0, 0]),
        point=np.array([0, 1]),
        xy_mm=xy,
        sigma_mm=np.full((2, 2, 2), 0.005),
        c_mm=np.full((2, 2), 50.0),
    )
    found, w, _ = intersected(poses, rays, xyz + 0.01)
    np.testing.assert_allclose(found[0], xyz[0], atol=1e-9)
    assert w[0] < 1e-6
    assert np.isnan(found[1]).all()
