"""What was asked for stands on the page: calibration, reliability, suspects, orientations, control and check points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.suspects import Uncontrolled
from aatri.evaluation.accuracy import evaluate
from aatri.ids import amounts, natural_order
from aatri.report.drawing.scales import length_text
from aatri.report.sections.calibration import parameter_tables
from aatri.report.sections.evaluation import point_tables
from aatri.report.sections.observations import suspects_tables, uncontrolled_counts
from aatri.report.sections.reliability import groups, reliability_tables
from aatri.report.sections.solution import orientations
from aatri.report.sections.tables import lengths, observation_classes
from aatri.report.verdict import _far_off
from aatri.report.view.numbers import estimate, number
from aatri.units import decimals, listed, rms_alike
from tests.formats.results.test_readable import full_solution
from tests.made_solutions import made_block, made_solution


def test_calibration_comes_with_units_sigmas_and_what_was_removed_and_film_in_figures_only() -> None:
    values, correlations, film = parameter_tables(full_solution())
    assert [row[2] for row in values.rows] == ["k1", "k2", "p1"]
    assert values.rows[0] == ("additional", "cam", "k1", "mm^-2", "3.00e-08", "2.0e-09", "15.0")
    assert values.rows[1][4:] == ("removed", "–", "–")
    assert correlations.rows == [("cam", "k1", "p1", "-0.500")]
    assert film.rows[0][:4] == ("film correction d0", "um", "1-0", "1")


def test_reliability_is_told_by_kind_and_by_the_largest_tests_in_use() -> None:
    by_kind, largest, effects = reliability_tables(full_solution())
    kinds = {row[0]: row for row in by_kind.rows}
    # the rejected image point takes no part: redundancy 0.6 and 0.7
    assert kinds["image point"][1:6] == ("um", "2", "0.65", "0.6", "0")
    assert kinds["control point"][-1] == "0.9"
    assert [(row[0], row[2], row[7]) for row in largest.rows] == [
        ("control point", "p00", "-0.90"),
        ("image point", "p00", "-0.48"),
    ]
    assert "external" in effects.caption.lower() or "effect" in effects.caption.lower()
    assert effects.rows[0][0] == "control point"  # 6.3 standard deviations
    assert reliability_tables(made_solution(made_block())) == []


def test_suspects_are_counted_by_stage_and_kind_and_listed_by_id() -> None:
    summary, listed = suspects_tables(full_solution().suspects)
    assert summary.rows == [
        ("absolute orientation", "control point", "rejected", "1"),
        ("bundle adjustment", "image point", "rejected", "1"),
    ]
    assert listed.rows[0][:5] == ("bundle adjustment", "image point", "1-1", "p10", "rejected")


def test_all_control_and_check_points_are_there_the_largest_first() -> None:
    block = made_block(columns=40, rows=10)
    block = replace(block, ground_points=replace(block.ground_points))
    evaluation = evaluate(block, made_solution(block, shift_m=[0.0, 0.0, 0.05]))
    tables = point_tables(evaluation)
    listed = sum(len(table.rows) for table in tables)
    assert listed == int((evaluation.differences.kind != "truth").sum())
    assert tables[0].heads[3] == "dZ mm"
    assert tables[0].rows[0][3] == "50.0"


def test_every_image_has_its_orientation_in_the_table() -> None:
    block = made_block()
    table = orientations(block, made_solution(block))
    assert [row[0] for row in table.rows] == block.images.id.tolist()
    assert float(table.rows[0][3]) == 400.0


def test_strips_are_listed_in_the_order_in_which_one_counts() -> None:
    block = made_block()
    block = replace(block, strips=replace(block.strips, id=np.array(["10", "9"])))
    table = orientations(block, made_solution(block))
    assert [row[0][0] for row in table.rows] == ["2"] * 5 + ["1"] * 5  # the second strip is strip 9
    assert natural_order(["a10", "a9", "b", "a9b", ""]).tolist() == [4, 1, 3, 0, 2]


def test_numbers_have_the_digits_of_their_standard_deviations() -> None:
    assert [decimals(size) for size in (0.0123, 0.5, 3.0, 40.0, float("nan"))] == [3, 2, 1, 0, 3]
    (values,) = lengths("sX", np.array([0.0123, 0.0456])).items()
    assert values[0] == "sX mm"
    assert values[1][1](values[1][0][0]) == "12.3"


def test_residuals_are_told_in_their_own_unit() -> None:
    rows = {row[0]: row for row in observation_classes(full_solution()).rows}
    assert rows["image point"][1] == "um"
    assert rows["control point"][1] == "mm"
    assert float(rows["control point"][8]) == 20.0


def test_rejected_observations_are_counted_apart_from_those_in_use() -> None:
    solution = made_solution(made_block())
    mine = np.flatnonzero(solution.residuals.kind == "image_point")
    active = np.ones(len(solution.residuals), dtype=bool)
    active[mine[:3]] = False
    rows = observation_classes(replace(solution, residuals=replace(solution.residuals, active=active))).rows
    assert next(row[3:5] for row in rows if row[0] == "image point") == (str(len(mine) - 3), "3")


def test_a_check_point_thousands_of_sigmas_off_is_named() -> None:
    block = made_block()
    evaluation = evaluate(block, made_solution(block))
    assert _far_off(evaluation) == []
    d = evaluation.differences
    row = int(np.flatnonzero(d.kind == "check")[0])
    difference = d.difference_m.copy()
    difference[row, 2] = 6000 * d.sigma_m[row, 2]
    (light,) = _far_off(replace(evaluation, differences=replace(d, difference_m=difference)))
    assert light.state == "bad"
    assert light.words.startswith(f"{d.point[row]} (6000 sigma, ")


def test_uncontrolled_before_the_bundle_is_counted_by_kind_and_rays_in_no_model_apart() -> None:
    nothing, along = np.full(3, np.nan), np.array([1.0, 0.0, np.nan])
    found = Uncontrolled(
        kind=np.array(["image_point", "image_point", "image_point", "model_tie"]),
        row=np.array([0, 1, 2, -1], dtype=np.int32),
        image=np.array(["a", "b", "a", "a-b"]),
        point=np.array(["1", "1", "2", "3"]),
        redundancy=np.zeros(4),
        direction=np.stack([along, along, nothing, nothing]),
    )
    table = uncontrolled_counts(found)
    assert table is not None
    assert table.rows == [
        ("image point", "1", "2", "1"),
        ("image point in no model", "2", "1", "1"),
        ("model point", "3", "1", "1"),
    ]
    assert uncontrolled_counts(found.take(np.zeros(4, dtype=bool))) is None
    assert uncontrolled_counts(None) is None


def test_without_variance_components_groups_are_kinds_with_their_redundancy() -> None:
    solution = full_solution()
    assert solution.tests is not None
    tests = replace(solution.tests, redundancy=4 * solution.tests.redundancy)  # more than 1 of each kind
    solution = replace(solution, variance_components=None, tests=tests)
    of = {name: (factor, low, high) for name, factor, low, high, _ in groups(solution)}
    assert list(of) == ["control point", "image point"]
    r = solution.residuals
    for kind, (factor, low, high) in zip(("control", "image_point"), of.values()):
        used = (r.kind == kind) & r.active
        v, s, share = (of_kind[used, :2] for of_kind in (r.residual, r.sigma, tests.redundancy))
        assert factor == pytest.approx(np.sqrt(((v / s) ** 2).sum() / share.sum()))
        assert low < factor < high
    assert groups(made_solution(made_block())) == []


def test_one_of_many_is_told_as_one() -> None:
    assert amounts({"image_points": 30, "check_points": 1, "strips": 0}) == "30 image points, 1 check point"


@pytest.mark.parametrize(
    ("rms_m", "n", "told"),
    [
        ([0.01428, 0.01214, 0.03335], 36, "14, 12 and 33 mm"),  # 33 / sqrt(72) = 4 mm
        ([0.0078, 0.0080, 0.0166], 3632, "7.8, 8.0 and 16.6 mm"),  # 0.2 mm
        ([0.02, 0.015, 1.03], 4, "0.02, 0.01 and 1.03 m"),  # the smallest keeps a digit
        ([1e-9, 0.02, float("nan")], 36, "0, 20 and – mm"),
        ([0.01234], 0, "12.3 mm"),  # of how many errors is not known
    ],
)
def test_root_mean_squares_are_told_to_their_own_standard_deviation(rms_m: list[float], n: int, told: str) -> None:
    assert listed(*rms_alike(rms_m, n)) == told


@pytest.mark.parametrize(
    ("value", "sigma", "unit", "told"),
    [
        (0.000219894, 0.0003753, "mm", ("0.22", "0.38", "um")),
        (2.99599e-05, 3.033e-07, "mm^-2", ("2.996e-05", "3.0e-07", "mm^-2")),
        (0.00010144, 3.846e-06, "1", ("101.4", "3.8", "ppm")),
        (0.00174533, 1.456e-05, "rad", ("360.0", "3.0", "″")),  # 0.1 deg
        (153.84, 0.0, "px", ("153.84", "0", "px")),
        (0.0, 1e-9, "mm^-2", ("0e+00", "1.0e-09", "mm^-2")),
        (np.radians(26.6), 7.8e-6, "rad", ("26.60000", "0.00045", "deg")),  # the orientation of a set of directions
        (7.8e-5, 7.8e-6, "rad", ("16.1", "1.6", "″")),
    ],
)
def test_estimates_are_told_to_their_standard_deviation(
    value: float, sigma: float, unit: str, told: tuple[str, str, str]
) -> None:
    assert estimate(value, sigma, unit) == told


def test_numbers_are_printed_for_reading() -> None:
    assert number(None) == number(float("nan")) == "–"
    assert number(1234567) == "1\u202f234\u202f567"
    assert length_text(0.0467061) == "46.7 mm"
    assert length_text(2000.0) == "2 km"
