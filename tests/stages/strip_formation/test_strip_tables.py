"""Tables of strips and of what orients them, where the unit of a strip is far from a metre: scales, ties, suspects."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.stages.absolute_orientation.similarity import SimilarityOptions, similarity
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import PolynomialOptions, polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.made_strips import MadeBlock
from tests.stages.made_strips import made_strips


def test_joints_hold_the_ratio_of_the_bases_and_every_point_agrees() -> None:
    made = made_strips(5, 2)
    strips = scale_transfer(made.block, dependent(made.block, made.image_points))
    for strip, image, scale, points in zip(
        strips.joints.strip, strips.joints.image, strips.joints.scale, strips.joints.points
    ):
        before, after = (np.linalg.norm(made.X0[image + k] - made.X0[image + k - 1]) for k in (0, 1))
        assert scale == pytest.approx(after / before, abs=1e-9)
        assert made.block.images.strip[image] == strip
        assert points > 3
    assert len(strips.joints) == 6
    np.testing.assert_allclose(strips.discrepancies.log_scale, 0.0, atol=1e-9)
    assert strips.discrepancies.active.all()


def test_a_point_too_far_away_in_one_model_tells_by_how_much() -> None:
    """1 % too far from the common image in the second model: its own scale is 1 % smaller than the joint's."""
    made = made_strips(4)
    models = dependent(made.block, made.image_points)
    p = models.model_points
    common = np.intersect1d(p.point[p.model == 1], p.point[p.model == 2])
    point = int(common[len(common) // 2])
    wrong = (p.model == 2) & (p.point == point)
    xyz = np.where(wrong[:, None], 1.01 * p.xyz, p.xyz)
    strips = scale_transfer(made.block, dataclasses.replace(models, model_points=dataclasses.replace(p, xyz=xyz)))
    d = strips.discrepancies
    (row,) = np.flatnonzero((d.joint == 1) & (d.point == point))
    assert d.log_scale[row] == pytest.approx(-np.log(1.01), abs=1e-6)
    assert not d.active[row]
    others = np.arange(len(d)) != row
    np.testing.assert_allclose(d.log_scale[others], 0.0, atol=1e-6)
    first_base = np.linalg.norm(made.X0[1] - made.X0[0])
    expected = 0.01 * (made.ground[point] - made.X0[2]) @ made.R[0] / first_base  # second minus first model
    np.testing.assert_allclose(d.xyz[row], expected, rtol=1e-5)
    assert strips.joints.scale[1] == pytest.approx(
        np.linalg.norm(made.X0[3] - made.X0[2]) / np.linalg.norm(made.X0[2] - made.X0[1]), abs=1e-6
    )
    (suspect,) = np.flatnonzero(strips.suspects.kind == "model_tie")
    assert strips.suspects.point[suspect] == made.block.points.id[point]
    assert strips.suspects.verdict[suspect] == "rejected"
    assert strips.suspects.size[suspect] == pytest.approx(-np.log(1.01), rel=1e-3)
    assert strips.suspects.test[suspect] == pytest.approx(
        abs(strips.suspects.size[suspect]) / strips.suspects.sigma[suspect]
    )


@pytest.mark.parametrize("method", ["similarity", "polynomial"])
def test_transformations_lead_from_the_strip_to_the_ground_with_its_scale(method: str) -> None:
    made = MadeBlock(2, 6)
    made.control(range(0, len(made.truth), 5), sigma_m=0.02)
    solution, _ = oriented(made, method)
    t = solution.transformations
    for name, (translation, scale, R) in zip(("1", "2"), made.frames):
        mine = {p: v for n, m, p, v in zip(t.id, t.model, t.parameter, t.value) if (n, m) == (name, "similarity")}
        assert mine["scale"] == pytest.approx(1.0 / scale, rel=1e-6)
        turn = Rotation.from_euler("XYZ", [mine["omega_rad"], mine["phi_rad"], mine["kappa_rad"]]).as_matrix()
        np.testing.assert_allclose(turn, R.T, atol=1e-7)
        origin = made.truth_X0[0] - R.T @ translation / scale  # where the strip's own origin comes to lie
        np.testing.assert_allclose([mine["TX_m"], mine["TY_m"], mine["TZ_m"]], origin, atol=1e-3)
        assert (t.id[t.model == "similarity"] == name).sum() == 7


@pytest.mark.parametrize("method", ["similarity", "polynomial"])
def test_a_tie_that_disagrees_shows_half_of_it_in_either_strip_in_metres(method: str) -> None:
    """The mean of two strips lies half-way; adjusted minus observed is against the strip's own error."""
    error = np.array([0.06, -0.04, 0.05])
    made, point = with_one_wrong_tie(error)
    solution, _ = oriented(made, method, limit=1e3)
    r = solution.residuals
    mine = {strip: k for k, strip in enumerate(r.image) if r.kind[k] == "strip_tie" and r.point[k] == f"p{point:03d}"}
    assert set(mine) == {"1", "2"}
    np.testing.assert_allclose(r.residual[mine["2"]], -error / 2, atol=0.012)  # the strips bend a little to it
    np.testing.assert_allclose(r.residual[mine["1"]], error / 2, atol=0.012)
    np.testing.assert_allclose(r.residual[mine["1"]], -r.residual[mine["2"]], atol=1e-5)
    np.testing.assert_allclose(r.sigma[mine["1"]], r.sigma[mine["2"]], rtol=0.05)  # metres, not units of either strip
    assert (r.sigma[[*mine.values()]] > 0.014).all()
    assert (r.sigma[[*mine.values()]] < 0.046).all()
    assert (r.row[[*mine.values()]] == -1).all()
    others = [k for k in range(len(r)) if r.kind[k] == "strip_tie" and k not in mine.values()]
    assert np.abs(r.residual[others]).max() < 0.02
    tied_points = {p for _, p, _ in made.strip_points if sum(q == p for _, q, _ in made.strip_points) > 1}
    assert {r.point[k] for k in range(len(r)) if r.kind[k] == "strip_tie"} == {f"p{p:03d}" for p in tied_points}


@pytest.mark.parametrize("method", ["similarity", "polynomial"])
def test_a_wrong_tie_is_a_suspect_with_its_size_in_metres(method: str) -> None:
    error = np.array([3.0, -2.0, 6.0])
    made, point = with_one_wrong_tie(error)
    solution, _ = oriented(made, method)
    s = solution.suspects
    rows = np.flatnonzero((s.kind == "strip_tie") & (s.verdict == "rejected"))
    assert set(s.point[rows]) == {f"p{point:03d}"}
    assert s.size[rows] == pytest.approx(7.0, rel=0.1)
    assert (s.unit[rows] == "m").all()
    np.testing.assert_allclose(s.size[rows] / s.sigma[rows], s.test[rows])
    free = np.isfinite(solution.points.xyz_m).all(axis=1) & (np.arange(len(made.truth)) != point)
    np.testing.assert_allclose(solution.points.xyz_m[free], made.truth[free], atol=2e-3)


@pytest.mark.parametrize("method", ["similarity", "polynomial"])
def test_residuals_of_control_are_adjusted_minus_given_in_metres(method: str) -> None:
    made = MadeBlock(2, 6)
    made.control(range(0, len(made.truth), 5), sigma_m=0.001)
    made.control([12], roles=(1, 1, 0), sigma_m=50.0, error_m=(3.0, -2.0, 9.0))
    solution, _ = oriented(made, method)
    r = solution.residuals
    (row,) = np.flatnonzero((r.kind == "control") & (r.point == "p012"))
    np.testing.assert_allclose(r.residual[row], [-3.0, 2.0, np.nan], atol=1e-3)
    np.testing.assert_allclose(r.sigma[row], [50.0, 50.0, np.nan])
    assert r.row[row] == made.block().ground_points.point.tolist().index(12)
    assert np.isfinite(r.residual[(r.kind == "control") & (np.arange(len(r)) != row)]).all()


def test_positions_are_compared_at_the_antenna() -> None:
    made = MadeBlock(2, 6)
    made.control(made.corners(), sigma_m=0.001)
    error = {i: np.zeros(3) for i in range(12)} | {4: np.array([0.3, -0.2, 0.1])}
    made.positions(range(12), sigma_m=5.0, error_m=error, lever_arm_m=(1.5, -2.5, 3.5))
    solution, _ = oriented(made, "similarity")
    r = solution.residuals
    mine = np.flatnonzero(r.kind == "position")
    assert r.image[mine].tolist() == [f"{i:03d}" for i in range(12)]
    assert r.row[mine].tolist() == list(range(12))
    expected = np.zeros((12, 3))
    expected[4] = [-0.3, 0.2, -0.1]
    np.testing.assert_allclose(r.residual[mine], expected, atol=2e-3)
    np.testing.assert_allclose(r.sigma[mine], 5.0)


def oriented(made: MadeBlock, method: str, limit: float | None = None):
    """The solution of either stage, and what the other began with."""
    block, points, strips = made.block(), made.image_points(), made.strips()
    absolute = SimilarityOptions() if limit is None else SimilarityOptions(tie_limit=limit, control_limit=limit)
    initial = similarity(block, strips, points, options=absolute)
    if method == "similarity":
        return initial, initial
    options = PolynomialOptions() if limit is None else PolynomialOptions(limit=limit)
    return polynomial(block, points, strips, initial, options=options), initial


def with_one_wrong_tie(error_m: np.ndarray) -> tuple[MadeBlock, int]:
    """Two strips with plenty of control, and a tie in the middle that is wrong in the second strip."""
    made = MadeBlock(2, 8)
    count = np.bincount([p for _, p, _ in made.strip_points], minlength=len(made.truth))
    ties = np.flatnonzero(count > 1)
    point = int(ties[np.argmin(np.linalg.norm(made.truth[ties, :2] - made.truth[ties, :2].mean(0), axis=1))])
    frame = made.frames[1]
    made.strip_points = [
        (strip, p, made._into(frame, made.truth[p] + error_m) if (strip, p) == (1, point) else xyz)
        for strip, p, xyz in made.strip_points
    ]
    made.control([p for p in range(0, len(made.truth), 3) if p != point], sigma_m=0.01)
    return made, point
