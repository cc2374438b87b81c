"""Numerical rank defects that no pivot shows, on crafted problems: refused or set aside by name, or a warning."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.openness.open_directions import OpenError
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure.weights import taking_no_part
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.codes import CONTROL
from aatri.errors import GeometryError
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.adjustment.block_problem import posed_problem
from tests.adjustment.openness.test_null_vectors import trilateration
from tests.campaigns.block_changes import digital, extreme, with_control
from tests.campaigns.rank_defects import Heard


def _kahan(n: int) -> np.ndarray:
    """Upper triangular, 1 on the diagonal and -1 above: every pivot of R'R is 1, and its inverse has 4^(n - 2)."""
    return np.triu(-np.ones((n, n)), 1) + np.eye(n)


def _linear(J: np.ndarray, blocks: int, bend: float = 0.0, start: float = 0.0):
    """Observations J x of `blocks` blocks of unknowns, all in one record a row, with a little curvature."""
    rows, n = J.shape
    size = n // blocks
    number = [np.full(rows, k, dtype=np.int32) for k in range(blocks)]
    target = np.linspace(-1, 1, rows)

    def evaluate(state, chosen):
        linear = state["x"].ravel() @ J[chosen].T
        v = linear + bend * np.sin(linear) - target[chosen]
        slope = (1 + bend * np.cos(linear))[:, None] * J[chosen]
        return v[:, None], tuple(slope[:, None, k * size : (k + 1) * size] for k in range(blocks))

    records = Records("row", tuple(("x", k) for k in number), evaluate, np.ones((rows, 1)), np.ones(rows, bool))
    unknowns = Unknowns(
        "x",
        np.ones((blocks, size), bool),
        tuple(f"x{i}" for i in range(size)),
        [f"b{i}" for i in range(blocks)],
        add_step,
    )
    return [unknowns], [records], {"x": np.full((blocks, size), start)}


@pytest.mark.parametrize("n", [24, 26])
def test_a_rank_defect_that_no_pivot_shows_is_refused_and_its_combination_named(n: int) -> None:
    with pytest.raises(GeometryError, match=r"nearly leave 1 combinations? of unknowns open: x0 of x b0, b1"):
        adjust_large(*_linear(_kahan(n), n))


def test_what_is_ten_times_better_is_a_warning_and_what_is_better_still_none() -> None:
    assert [n.level for n in adjust_large(*_linear(_kahan(21), 21)).notes] == ["warning"]
    assert not adjust_large(*_linear(_kahan(16), 16)).notes


def test_a_single_weak_block_is_set_aside_by_name() -> None:
    n = 25
    J = np.zeros((n + 40, 2 * n))
    J[:n, :n] = _kahan(n)
    J[n:, n:] = np.random.default_rng(0).normal(size=(40, n))
    unknowns, (all_,), start = _linear(J, 2)

    def part(name: str, rows: np.ndarray, block: int) -> Records:
        def evaluate(state, chosen):
            v, jacobians = all_.evaluate(state, rows[chosen])
            return v, (jacobians[block],)

        return Records(
            name,
            (("x", np.full(len(rows), block, np.int32)),),
            evaluate,
            np.ones((len(rows), 1)),
            np.ones(len(rows), bool),
        )

    weak, good = part("weak", np.arange(n), 0), part("good", np.arange(n, n + 40), 1)
    result = adjust_large(unknowns, [weak, good], start)
    assert [str(note) for note in result.notes] == ["set aside, its observations hardly determine it: x b0"]
    assert taking_no_part(result.problem)["x"].tolist() == [True, False]
    assert (result.n_unknowns, result.observations) == (n, 40)
    wanted = np.linalg.lstsq(J[n:, n:], np.linspace(-1, 1, n + 40)[n:], rcond=None)[0]
    np.testing.assert_allclose(result.state["x"][1], wanted, atol=1e-9)
    found = marginal_covariances(result).groups["x"]
    assert np.isnan(found[0]).all()
    np.testing.assert_allclose(found[1], np.linalg.inv(J[n:, n:].T @ J[n:, n:]), rtol=1e-8)


def _loose_net(sigma: float, implausible: float | None):
    """Distances and, for the datum, all coordinates observed with a standard deviation."""
    (points,), (distances,), start = trilateration(3)
    n, distances = len(points.free), replace(distances, whitener=np.ones_like(distances.whitener))
    target = start["point"].copy()
    eye = np.broadcast_to(np.eye(3), (n, 3, 3))
    given = Records(
        "given",
        (("point", np.arange(n, dtype=np.int32)),),
        lambda state, rows: (state["point"][rows] - target[rows], (eye[rows],)),
        np.full((n, 3), 1 / sigma),
        np.ones(n, bool),
    )
    limit = None if implausible is None else np.full(3, implausible)
    return [replace(points, implausible=limit)], [distances, given], start


def test_a_datum_less_certain_than_the_limit_is_refused_by_name() -> None:
    with pytest.raises(GeometryError, match=r"nearly leave .* open: .* of point p"):
        adjust_large(*_loose_net(5e4, 1000.0))
    assert not adjust_large(*_loose_net(5e4, None)).notes


def test_a_tenth_of_the_limit_is_a_warning() -> None:
    result = adjust_large(*_loose_net(2000.0, 1000.0))
    sigma = np.sqrt(marginal_covariances(result).groups["point"][0, 0, 0])
    assert 100.0 < sigma < 1000.0
    assert result.notes
    assert all(note.level == "warning" and "hardly determined" in note.text for note in result.notes)
    assert not adjust_large(*_loose_net(100.0, 1000.0)).notes


def _loosely_controlled(sigma_m: float, moved_m: float, image_mm: float = 0.1) -> tuple[Block, ImagePoints]:
    """A block whose control has one standard deviation and is moved by another, and the sigma of its image points."""
    block, rng = with_control(digital(), extreme(4)), np.random.default_rng(2)
    g, points = block.ground_points, calibrated(block)
    m = points.measurements
    covariance = np.broadcast_to(sigma_m**2 * np.eye(3), g.covariance_m2.shape)
    g = replace(g, xyz_m=g.xyz_m + rng.normal(0, moved_m, g.xyz_m.shape), covariance_m2=covariance)
    return replace(block, ground_points=g), replace(
        points, measurements=replace(m, sigma_mm=np.full_like(m.sigma_mm, image_mm))
    )


@pytest.mark.parametrize(("sigma_m", "image_mm"), [(5e3, 0.1), (500.0, 0.001)])
def test_a_datum_that_only_too_large_sigmas_of_control_leave_open_is_adjusted_and_told(
    sigma_m: float, image_mm: float
) -> None:
    """The closed form: rays fix the form, control of one sigma s the similarity, Q = s^2 G (sum of G_k' G_k)^-1 G'.

    In the second block the smallest eigenvalue of the datum is 9e-14 of what rays put on the diagonal, its pivots are
    larger.
    """
    ear, (block, points) = Heard(), _loosely_controlled(sigma_m, 0.0, image_mm)
    s = bundle(block, points, options=BundleOptions(blunders="none"), context=ear)
    assert any(re.search(r"hardly determined.* of the whole block", text) for text in ear.warnings)
    control = (block.ground_points.role == CONTROL).any(axis=1)
    fixed = _motions_of(block.ground_points.xyz_m[control])
    ours = np.isfinite(s.points.covariance_m2).all(axis=(1, 2))
    G = _motions_of(s.points.xyz_m[ours])
    Q = sigma_m**2 * G @ np.linalg.inv(np.einsum("nik,nil->kl", fixed, fixed)) @ G.swapaxes(1, 2)
    assert ours.sum() > 100
    np.testing.assert_allclose(np.einsum("nii->ni", s.points.covariance_m2[ours]), np.einsum("nii->ni", Q), rtol=1e-3)


@pytest.mark.slow
def test_a_datum_whose_control_is_as_bad_as_it_says_is_refused_by_name() -> None:
    block, points = _loosely_controlled(5e3, 2e3)
    with pytest.raises(GeometryError, match=r"leaves nothing of .*of the whole block"):
        bundle(block, points, options=BundleOptions(blunders="none"))


def test_a_datum_of_so_little_weight_that_rounding_leaves_none_of_it_is_told_as_that() -> None:
    block, points = _loosely_controlled(5e3, 0.0, 0.001)
    with pytest.raises(  # open, as what no observation sees: a search brings back what closes it
        OpenError, match=r"leaves nothing of .*shift Z of the whole block.* 1e-13 of the weight"
    ) as refused:
        bundle(block, points, options=BundleOptions(blunders="none"))
    assert "smaller standard deviations" in str(refused.value.remedy)


@pytest.mark.parametrize("sigma_m", [5.0, 500.0])
def test_what_control_of_any_weight_does_not_see_is_open(sigma_m: float) -> None:
    """Four control points in height alone leave shifts in X and Y, the azimuth and the scale."""
    block, points = _loosely_controlled(sigma_m, 0.0, 0.001)
    g = block.ground_points
    role = np.where(np.arange(3) < 2, np.where(g.role == CONTROL, 0, g.role), g.role).astype(g.role.dtype)
    block = replace(block, ground_points=replace(g, role=role))
    with pytest.raises(GeometryError, match=r"open: .*rotation about Z.* of the whole block"):
        bundle(block, points, options=BundleOptions(blunders="none"))


def _motions_of(xyz_m: np.ndarray) -> np.ndarray:
    """Shifts, rotations and scale of points in km, (n, 3, 7)."""
    x, y, z = (xyz_m / 1e3).T
    o, e = np.zeros_like(x), np.ones_like(x)
    rows = [(e, o, o, o, z, -y, x), (o, e, o, -z, o, x, y), (o, o, e, y, -x, o, z)]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)


def _weak_point(scale: float):
    """A point whose rays hardly depend on it."""
    unknowns, records, start = posed_problem(1, n_kept=14, n_points=40)
    whole, point = records[0].evaluate, records[0].touches[1][1]

    factor = np.ones((40, 1))
    factor[9] = scale

    def evaluate(state, rows):
        v, (a, p) = whole({**state, "p": factor * state["p"]}, rows)
        return v, (a, factor[point[rows]][:, :, None] * p)

    points = replace(unknowns[1], implausible=np.full(3, 1e4))
    return (unknowns[0], points), (replace(records[0], evaluate=evaluate), records[1]), start


def test_a_weak_point_is_set_aside_by_name_and_the_rest_is_as_without_it() -> None:
    unknowns, records, start = _weak_point(1e-7)
    result = adjust_large(unknowns, records, start, tolerance=1e-9)
    assert [str(note) for note in result.notes] == ["set aside, its observations hardly determine it: p p9"]
    without = replace(records[0], active=records[0].touches[1][1] != 9)
    expected = adjust_large(unknowns, (without, records[1]), start, tolerance=1e-9)
    np.testing.assert_allclose(result.state["a"], expected.state["a"], atol=1e-8)
    assert np.isnan(marginal_covariances(result).groups["p"][9]).all()
    assert not adjust_large(*_weak_point(1.0)).notes


def test_a_nearly_singular_problem_that_does_not_converge_is_diagnosed_as_such() -> None:
    with pytest.raises(GeometryError, match=r"no convergence in 2 iterations: .* nearly leave 1 .* x0 of x b0"):
        adjust_large(*_linear(_kahan(24), 24, bend=0.3, start=0.5), max_iterations=2)


def _beside(*parts: np.ndarray) -> np.ndarray:
    """Problems that have nothing in common, as one."""
    J = np.zeros((sum(len(part) for part in parts), sum(len(part) for part in parts)))
    at = 0
    for part in parts:
        J[at : at + len(part), at : at + len(part)] = part
        at += len(part)
    return J


def test_what_is_open_by_its_ratio_and_by_its_limit_counts_once() -> None:
    (unknowns,), records, start = _linear(_kahan(24), 24)
    limited = replace(unknowns, implausible=np.array([1e3]))  # of about 2^22
    with pytest.raises(GeometryError, match=r"nearly leave 1 combinations? of unknowns open"):
        adjust_large([limited], records, start)


def test_what_is_open_by_its_ratio_alone_and_what_by_its_limit_alone_are_two() -> None:
    # sum and difference of the last two blocks: known to 1 and to 1e4, far from the ratio, beyond the limit of 1e3
    pair = np.array([[1.0, 1.0], [1e-4, -1e-4]])
    (unknowns,), records, start = _linear(_beside(_kahan(24), pair), 26)
    limited = replace(unknowns, implausible=np.array([1e3]))
    with pytest.raises(GeometryError, match=r"nearly leave 2 combinations?.*x0 of x b2[45], b2[45]"):
        adjust_large([limited], records, start)


def test_of_many_open_combinations_seven_are_named_and_the_others_counted() -> None:
    with pytest.raises(GeometryError, match=r"nearly leave 8 combinations?.* and 1 more") as refused:
        adjust_large(*_linear(_beside(*[_kahan(24)] * 9), 9 * 24))
    assert refused.value.what.count("; ") == 6


def test_points_that_nothing_determines_are_refused_by_name_where_there_are_no_others() -> None:
    unknowns, records, start = posed_problem(1, n_kept=14, n_points=40)
    whole = records[0].evaluate

    def evaluate(state, rows):
        v, (a, p) = whole(state, rows)
        return v, (a, p * [1.0, 1.0, 0.0])

    with pytest.raises(GeometryError, match=r"40 of 40 are not determined .*: p p0, p p1, .*, p p9 and 30 more"):
        adjust_large(unknowns, (replace(records[0], evaluate=evaluate), records[1]), start)
