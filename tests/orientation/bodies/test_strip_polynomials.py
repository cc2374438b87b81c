"""Strip block adjustment with polynomials."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.strip_bases import strip_axes, strip_basis
from aatri.observations.control import Control
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.strip_polynomials import adjust_strip_polynomials, fall_notes, textbook_counts
from tests.geometry.strip_deformation import correction_design

RNG = np.random.default_rng(21)


def _block(n_strips: int = 3, noise_m: float = 0.0, bend_m=0.3, degree_terms=5):
    """Strips along X and one across; each deformed by a polynomial in its own axes. Returns truth and strips."""
    x, y = np.meshgrid(np.arange(0, 2001, 100.0), np.arange(0, 300.0 * n_strips + 1, 60.0), indexing="ij")
    truth = np.column_stack([x.ravel(), y.ravel(), RNG.uniform(0, 20, x.size)])
    sets = [np.flatnonzero(abs(truth[:, 1] - 300 * k - 150) <= 215) for k in range(n_strips)]
    centres = [
        np.column_stack([np.arange(0, 2001, 250.0), np.full(9, 300.0 * k + 150), np.full(9, 400.0)])
        for k in range(n_strips)
    ]
    sets.append(np.flatnonzero(abs(truth[:, 0] - 1000) <= 215))
    centres.append(np.column_stack([np.full(6, 1000.0), np.linspace(0, 300 * n_strips, 6), np.full(6, 400.0)]))
    axes, parts = [], []
    for members, stations in zip(sets, centres):
        ax = strip_axes(truth[members], stations)
        coefficients = RNG.normal(0, bend_m, 15) * np.tile(np.arange(5) < degree_terms, 3)
        # The corrected point is the truth: the deformed one is found by iteration, as the terms depend on it.
        deformed = truth[members].copy()
        for _ in range(60):
            deformed = truth[members] - correction_design(ax, deformed) @ coefficients
        axes.append(ax)
        parts.append(deformed + RNG.normal(0, noise_m, deformed.shape))
    n = [len(p) for p in parts]
    points = BodyPoints(
        np.repeat(np.arange(len(n)), n),
        np.concatenate(sets),
        np.concatenate(parts),
        np.tile(np.diag([1e-4, 1e-4, 4e-4]), (sum(n), 1, 1)),
    )
    return truth, points, axes


def _control(truth, rows, given=(True, True, True), sigma=0.0):
    rows = np.asarray(rows)
    return _as_control(rows, truth[rows], sigma, np.tile(given, (len(rows), 1)))


def _as_control(rows, xyz_m, sigma, given):
    covariance = np.tile(np.eye(3) * sigma**2, (len(rows), 1, 1))
    return Control(np.arange(len(rows)), rows, xyz_m, covariance, given & (sigma > 0), given & (sigma == 0))


def test_second_degree_deformation_is_recovered_with_enough_control() -> None:
    truth, points, axes = _block()
    found = adjust_strip_polynomials(points, len(truth), axes, _control(truth, np.arange(0, len(truth), 11)))
    assert (found.degree == 2).all()
    assert found.falls == ()
    assert np.abs(found.point_m - truth).max() < 1e-9
    assert found.tied.tau_m == 0.0


def test_error_free_strips_stay_as_they_are() -> None:
    truth, points, axes = _block(bend_m=0.0)
    found = adjust_strip_polynomials(points, len(truth), axes, _control(truth, np.arange(0, len(truth), 11)))
    assert np.abs(found.coefficients_m).max() < 1e-9
    assert np.abs(found.point_m - truth).max() < 1e-9


def test_the_degree_falls_where_control_is_too_little_and_says_why() -> None:
    truth, points, axes = _block(n_strips=1)
    single = points.take(points.strip == 0)
    corners = [
        int(np.argmin(np.linalg.norm(truth[:, :2] - c, axis=1))) for c in ([0, 0], [0, 300], [2000, 0], [2000, 300])
    ]
    found = adjust_strip_polynomials(single, len(truth), axes[:1], _control(truth, corners))
    # Four points against five coefficients: the bend along the strip is open.
    assert found.degree.tolist() == [[1, 1]]
    assert [(fall.part, fall.degree) for fall in found.falls] == [("plan", 1), ("height", 1)]
    assert "rank 4 of 5" in found.falls[1].reason
    assert "c_UU" in found.falls[1].reason


def test_many_strips_that_fall_alike_are_told_in_one_warning() -> None:
    truth, points, axes = _block(n_strips=9)
    four = [int(np.argmin(np.linalg.norm(truth[:, :2] - c, axis=1))) for c in ([0, 0], [0, 90], [90, 0], [90, 90])]
    found = adjust_strip_polynomials(points, len(truth), axes, _control(truth, four))
    names = [f"S{k}" for k in range(10)]
    assert len({fall.strip for fall in found.falls}) == 10
    notes = fall_notes(found, names)
    of_many = [note for note in notes if note.ids]
    assert {name for note in of_many for name in note.ids} == {f"S{k}" for k in range(2, 10)}
    assert all(f"in {len(note.ids)} of 10 strips; in strip {note.ids[0]}, as degree" in note.text for note in of_many)
    assert len(of_many) == 2
    assert len(notes) < 10


def test_plan_and_height_fall_apart() -> None:
    truth, points, axes = _block(n_strips=1)
    single = points.take(points.strip == 0)
    heights = np.arange(0, len(truth), 7)
    plan = heights[[0, 3, -1]]
    control = _control(truth, heights)
    given = control.given.copy()
    given[:, :2] = np.isin(heights, plan)[:, None]
    found = adjust_strip_polynomials(
        single, len(truth), axes[:1], _as_control(control.point, control.xyz_m, 0.0, given)
    )
    assert found.degree[0, 1] == 2
    assert found.degree[0, 0] < 2


def test_a_degree_that_would_extrapolate_is_not_used() -> None:
    truth, points, axes = _block(n_strips=1, noise_m=0.01)
    single = points.take(points.strip == 0)
    first_quarter = np.flatnonzero(truth[:, 0] <= 400)
    found = adjust_strip_polynomials(single, len(truth), axes[:1], _control(truth, first_quarter, sigma=0.01))
    assert (found.degree < 2).all()
    assert "less precise than a point" in found.falls[0].reason


def test_deformation_beyond_the_polynomial_is_estimated() -> None:
    truth, points, axes = _block(noise_m=0.05)
    found = adjust_strip_polynomials(points, len(truth), axes, _control(truth, np.arange(0, len(truth), 5), sigma=0.01))
    # 5 cm in every coordinate, of which the covariances explain 1, 1 and 2 cm.
    assert found.tied.tau_m == pytest.approx(np.sqrt(0.05**2 - 2e-4), abs=0.004)


def test_a_wrong_tie_and_wrong_control_are_rejected() -> None:
    truth, points, axes = _block(noise_m=0.01)
    rows = np.arange(0, len(truth), 5)
    control = _control(truth, rows, sigma=0.01)
    wrong_control = control.xyz_m.copy()
    wrong_control[9] += [0.0, 0.0, 0.6]
    shared = np.flatnonzero(np.bincount(points.point)[points.point] == 3)
    tie = int(shared[~np.isin(points.point[shared], rows)][0])
    xyz = points.xyz.copy()
    xyz[tie] += [0.0, 0.7, 0.0]
    found = adjust_strip_polynomials(
        BodyPoints(points.strip, points.point, xyz, points.covariance),
        len(truth),
        axes,
        _as_control(control.point, wrong_control, 0.01, control.given),
    )
    n = len(points.strip)
    assert np.flatnonzero(~found.tied.active).tolist() == [tie, n + 9]
    assert found.tied.size[tie, 1] == pytest.approx(0.7, abs=0.06)
    assert found.tied.size[n + 9, 2] == pytest.approx(0.6, abs=0.06)


def test_a_point_known_in_one_strip_only_is_corrected_with_its_strip() -> None:
    truth, points, axes = _block(n_strips=1)
    single = points.take(points.strip == 0)
    found = adjust_strip_polynomials(single, len(truth), axes[:1], _control(truth, np.arange(0, len(truth), 9)))
    np.testing.assert_allclose(found.corrected_m, truth[single.point], atol=1e-9)


@pytest.mark.parametrize(
    ("form", "degree", "full"),
    [
        ("conformal", 2, False),
        ("conformal", 3, False),
        ("polynomial", 3, False),
        pytest.param("polynomial", 3, True, marks=pytest.mark.slow),
    ],
)
def test_a_deformation_of_every_form_is_recovered_with_enough_control(form: str, degree: int, full: bool) -> None:
    basis = strip_basis(form, degree, full=full)
    truth, straight, axes = _block(bend_m=0.0)
    rng = np.random.default_rng(3)
    bent = straight.xyz.copy()
    for k, ax in enumerate(axes):
        mine = straight.strip == k
        c = rng.normal(0, 0.3, basis.size)
        for _ in range(60):
            local = ((bent[mine] - ax.origin_m) @ ax.ground_from_axes)[:, :2] / ax.half_range_m
            ratio = np.full(len(local), ax.half_range_m[1] / ax.half_range_m[0])
            bent[mine] = straight.xyz[mine] - basis.rows(local[:, 0], local[:, 1], ratio) @ c @ ax.ground_from_axes.T
    points = BodyPoints(straight.strip, straight.point, bent, straight.covariance)
    found = adjust_strip_polynomials(
        points, len(truth), axes, _control(truth, np.arange(0, len(truth), 7)), degree=degree, basis=basis
    )
    assert (found.degree == degree).all()
    assert np.abs(found.point_m - truth).max() < 1e-8


def _lecture():
    """Three strips of five images: 5 columns and 7 rows of points, of which 10 are known and 2 in height."""
    x, y = np.meshgrid(np.arange(5) * 200.0, np.arange(7) * 100.0, indexing="ij")
    truth = np.column_stack([x.ravel(), y.ravel(), RNG.uniform(0, 20, 35)])
    row = np.tile(np.arange(7), 5)
    column = np.repeat(np.arange(5), 7)
    sets = [np.flatnonzero((row >= 2 * k) & (row <= 2 * k + 2)) for k in range(3)]
    centres = [
        np.column_stack([np.arange(5) * 200.0, np.full(5, 200.0 * k + 100), np.full(5, 400.0)]) for k in range(3)
    ]
    axes = [strip_axes(truth[s], c) for s, c in zip(sets, centres)]
    points = BodyPoints(
        np.repeat(np.arange(3), 15),
        np.concatenate(sets),
        truth[np.concatenate(sets)],
        np.tile(np.diag([1e-4, 1e-4, 4e-4]), (45, 1, 1)),
    )
    full = (np.isin(row, [0, 6]) & np.isin(column, [0, 2, 4])) | (np.isin(row, [2, 4]) & np.isin(column, [0, 4]))
    height = np.isin(row, [2, 4]) & (column == 2)
    rows = np.flatnonzero(full | height)
    given = np.where(full[rows][:, None], True, [False, False, True])
    return truth, points, axes, _as_control(rows, truth[rows], 0.01, given)


@pytest.mark.parametrize(("form", "coefficients"), [("polynomial", 45), ("conformal", 33)])
def test_counts_of_the_lecture_notes(form: str, coefficients: int) -> None:
    """62 equations; 45 coefficients leave 17 redundant, 33 conformal ones 29."""
    truth, points, axes, control = _lecture()
    found = adjust_strip_polynomials(points, len(truth), axes, control, basis=strip_basis(form, 2))
    assert textbook_counts(found, points, control) == (62, coefficients)
    assert found.tied.redundancy == 62 - coefficients
    assert np.abs(found.point_m - truth).max() < 1e-8
