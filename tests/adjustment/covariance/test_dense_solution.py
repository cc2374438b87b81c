"""The short way of small problems, by whole matrices, against the factorisation by fronts."""

from dataclasses import replace

import numpy as np

from aatri.adjustment.covariance.dense import is_small, solve_dense
from aatri.adjustment.covariance.solve import solve
from aatri.adjustment.records import Records
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.unknowns import Unknowns, add_step
from tests.adjustment.covariance.test_solve import strips


def test_both_ways_give_the_same_step_covariances_and_tests() -> None:
    """With inactive records, of which some leave a point without any that is active."""
    unknowns, records, state = strips(n_points=40)
    ties, control = records
    active = np.ones(len(ties.active), dtype=bool)
    active[[2, 3, 17, 60]] = False  # both ties of point 1; point 0 keeps its control
    given = np.ones(len(control.active), dtype=bool)
    given[5] = False
    records = (replace(ties, active=active), replace(control, active=given))
    assert is_small(unknowns, records)
    dense, fronts = solve_dense(unknowns, records, state), solve(prepare(unknowns, records), state)
    assert dense is not None
    for u in unknowns:
        taking_part = np.isfinite(fronts.covariances.groups[u.name]).all(axis=(1, 2))
        np.testing.assert_allclose(dense.state[u.name][taking_part], fronts.state[u.name][taking_part], atol=1e-9)
        np.testing.assert_allclose(
            dense.covariances.groups[u.name], fronts.covariances.groups[u.name], rtol=1e-8, atol=1e-10
        )
    for key, tests in fronts.tests().items():
        np.testing.assert_allclose(dense.tests()[key].redundancy, tests.redundancy, rtol=1e-8, atol=1e-9)
        np.testing.assert_allclose(dense.tests()[key].test, tests.test, rtol=1e-7, atol=1e-9)
    assert dense.departure == fronts.departure == 0.0


def test_what_is_not_determined_is_left_to_the_fronts_which_name_it() -> None:
    unknowns, records, state = strips(n_points=40)
    nothing = np.zeros(len(records[1].active), dtype=bool)
    assert solve_dense(unknowns, (records[0], replace(records[1], active=nothing)), state) is None


def test_the_departure_from_the_linear_model_is_that_of_the_residuals() -> None:
    """v = x^2 - 4 from x = 3: the linear model foretells 0 after the step of -5/6, the square has (5/6)^2 left."""
    x = Unknowns("x", np.ones((1, 1), dtype=bool), ("x",), ["x"], add_step)
    block = np.zeros(1, dtype=np.int32)
    square = Records(
        "square",
        (("x", block),),
        lambda s, rows: (s["x"] ** 2 - 4.0, (2 * s["x"][:, :, None],)),
        np.ones((1, 1)),
        np.ones(1, dtype=bool),
    )
    solved = solve_dense([x], [square], {"x": np.array([[3.0]])})
    assert solved is not None
    np.testing.assert_allclose(solved.departure, 25 / 36, rtol=1e-14)
    np.testing.assert_allclose(solved.covariances.groups["x"], [[[1 / 36]]])


def test_records_that_join_two_points_are_left_to_the_fronts() -> None:
    """Points are eliminated one by one, which a distance between two of them does not allow."""
    unknowns, records, _ = strips(n_points=40)
    of = np.zeros(1, dtype=np.int32)
    distance = Records("distance", (("point", of), ("point", of + 1)), records[1].evaluate, np.ones((1, 1)), of == 0)
    assert not is_small(unknowns, (*records, distance))
