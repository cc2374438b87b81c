"""Networks of distances without any image, by the bundle adjustment: against SciPy's dense least squares."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.artifacts.block import Block
from aatri.errors import GeometryError
from aatri.observations.poses import POINT, Poses
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.settings import BundleSettings
from aatri.orientation.network.start import NetworkObservations, approximate_coordinates
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle

TRUTH = {
    "A": (0.0, 0.0, 0.0),
    "B": (100.0, 0.0, 5.0),
    "C": (50.0, 90.0, -3.0),
    "D": (11.2, 79.1, 38.7),
    "E": (61.5, 28.4, 31.3),
}
LINES = ("AD", "BD", "CD", "AE", "BE", "CE", "DE", "AD")
SIGMA = 0.003

HEAD = """aatri_block: 1
name: network
frames: {local: {axes: [east, north, up], crs: local}}
earth_curvature: ignore
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg, time: s}
"""


def _observed() -> np.ndarray:
    rng = np.random.default_rng(5)
    length = [np.linalg.norm(np.subtract(TRUTH[a], TRUTH[b])) for a, b in LINES]
    return np.array(length) + rng.normal(0, SIGMA, len(LINES))


def _network(folder: Path, *, fixed: str = "ABC", exact: str = "") -> Block:
    (folder / "block.yaml").write_text(HEAD)
    rows = []
    for name, (x, y, z) in TRUTH.items():
        if name in fixed:
            rows.append(f"{name},{x},{y},{z},0,0,0,control")
        else:
            rows.append(f"{name},{x + 2},{y - 3},{z + 1},,,,approximate")
    (folder / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sX,sY,sZ,role", *rows]) + "\n")
    observed = list(zip(LINES, _observed().tolist()))
    lines = [f"distance,{a},{b},{d!r},{SIGMA}" for (a, b), d in observed if a + b != exact]
    conditions = [
        f"- {{type: distance, points: [{a}, {b}], value: {d!r}, exact: true}}"
        for (a, b), d in observed
        if a + b == exact
    ]
    if conditions:
        (folder / "relative_control.yaml").write_text("\n".join(conditions) + "\n")
    (folder / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *lines]) + "\n")
    return tables(options=TablesOptions(path=folder))


def test_a_distance_network_is_that_of_dense_least_squares(tmp_path: Path) -> None:
    solution = bundle(_network(tmp_path), options=BundleOptions(tolerance=1e-8, reliability=True))
    d = _observed()

    def residuals(x: np.ndarray) -> np.ndarray:
        at = {**{k: np.array(v) for k, v in TRUTH.items()}, "D": x[:3], "E": x[3:]}
        return np.array([np.linalg.norm(at[a] - at[b]) for a, b in LINES]) - d

    found = least_squares(lambda x: residuals(x) / SIGMA, np.concatenate([TRUTH["D"], TRUTH["E"]]), xtol=1e-15)
    row = {str(k): i for i, k in enumerate(solution.points.id)}
    x = np.concatenate([solution.points.xyz_m[row["D"]], solution.points.xyz_m[row["E"]]])
    np.testing.assert_allclose(x, found.x, atol=1e-7)
    Q = np.linalg.inv(found.jac.T @ found.jac)
    mine = np.array([solution.points.covariance_m2[row[k]] for k in "DE"])
    np.testing.assert_allclose(mine[0], Q[:3, :3], rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(mine[1], Q[3:, 3:], rtol=1e-5, atol=1e-12)
    assert solution.redundancy == 2
    assert solution.sigma0 == pytest.approx(np.sqrt((found.fun**2).sum() / 2), rel=1e-6)
    assert solution.tests is not None
    distance = solution.residuals.kind == "distance"
    assert np.nansum(solution.tests.redundancy[distance]) == pytest.approx(2.0, abs=1e-9)


def test_an_exact_distance_holds_and_counts_in_the_redundancy(tmp_path: Path) -> None:
    weighted = bundle(_network(tmp_path), options=BundleOptions(tolerance=1e-8, blunders="none"))
    (tmp_path / "exact").mkdir()
    solution = bundle(_network(tmp_path / "exact", exact="DE"), options=BundleOptions(tolerance=1e-8, blunders="none"))
    row = {str(k): i for i, k in enumerate(solution.points.id)}
    length = np.linalg.norm(solution.points.xyz_m[row["D"]] - solution.points.xyz_m[row["E"]])
    assert length == pytest.approx(_observed()[LINES.index("DE")], abs=1e-9)
    assert solution.redundancy == weighted.redundancy
    at = np.flatnonzero((solution.residuals.kind == "relative_distance") & (solution.residuals.point == "D-E"))
    assert solution.residuals.sigma[at, 0].tolist() == [0.0]


def test_a_loss_of_all_observations_leaves_what_is_exact_alone(tmp_path: Path) -> None:
    given = bundle_input(observation_source(_network(tmp_path, exact="DE"), None, None), BundleOptions())
    result = adjust_bundle(given, BundleSettings(huber=1.0))
    problem = result.adjusted.problem
    assert problem.constraints
    assert all(r.loss is None for r in problem.constraints)
    row = {str(k): i for i, k in enumerate(given.point_ids)}
    length = np.linalg.norm(result.xyz_m[row["D"]] - result.xyz_m[row["E"]])
    assert length == pytest.approx(_observed()[LINES.index("DE")], abs=1e-7)


def test_start_values_in_part_stay_beside_a_block_that_has_none_of_these_points(tmp_path: Path) -> None:
    block = _network(tmp_path)
    xyz_m = block.ground_points.xyz_m.copy()
    xyz_m[block.points.id[block.ground_points.point] == "D", 2] = np.nan
    block = replace(block, ground_points=replace(block.ground_points, xyz_m=xyz_m))
    nothing = Poses(np.full((0, 3), np.nan), np.full((0, 3, 3), np.nan)), np.full((len(block.points), 3), np.nan)
    starts = [observation_source(block, None, None, shared=shared).start[POINT] for shared in (None, nothing)]
    np.testing.assert_array_equal(starts[0], starts[1])
    assert np.isfinite(starts[0][:, :2]).all()


def test_a_network_without_datum_is_refused_and_free_with_inner_constraints(tmp_path: Path) -> None:
    lines = {a + b for a in TRUTH for b in TRUTH if a < b}
    block = _network(tmp_path, fixed="")
    text = ["type,from,to,value,sigma"]
    text += [
        f"distance,{a},{b},{float(np.linalg.norm(np.subtract(TRUTH[a], TRUTH[b]))) + 0.001!r},{SIGMA}"
        for a, b in sorted(lines)
    ]
    (tmp_path / "geodetic.csv").write_text("\n".join(text) + "\n")
    block = tables(options=TablesOptions(path=tmp_path))
    with pytest.raises(GeometryError, match="leave 6 unknown"):
        bundle(block)
    free = bundle(block, options=BundleOptions(datum="free", tolerance=1e-8))
    assert free.redundancy == 10 - 15 + 6
    start = np.array([np.add(TRUTH[k], (2, -3, 1)) for k in TRUTH])
    shift = free.points.xyz_m - start
    np.testing.assert_allclose(shift.sum(axis=0), 0.0, atol=1e-8)
    # the pseudo-inverse of the normal matrix is the covariance with all points as datum
    rows = []
    X = free.points.xyz_m
    names = sorted(TRUTH)
    for a, b in sorted(lines):
        u = X[names.index(b)] - X[names.index(a)]
        u /= np.linalg.norm(u)
        j = np.zeros((5, 3))
        j[names.index(a)], j[names.index(b)] = -u, u
        rows.append(j.ravel() / SIGMA)
    Q = np.linalg.pinv(np.array(rows).T @ np.array(rows), rcond=1e-10)
    for k in range(5):
        block_of = Q[3 * k : 3 * k + 3, 3 * k : 3 * k + 3]
        np.testing.assert_allclose(free.points.covariance_m2[k], block_of, atol=1e-6 * np.abs(Q).max())


def test_control_of_a_network_enters_with_its_full_covariance(tmp_path: Path) -> None:
    """Two heights as control, correlated by 0.8, and a third levelled from both: against the dense solution."""
    (tmp_path / "block.yaml").write_text(HEAD)
    points = ["P,,,100.000,,,0.010,Z:control", "Q,,,101.000,,,0.020,Z:control", "R,,,100,,,,approximate"]
    (tmp_path / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sX,sY,sZ,role", *points]) + "\n")
    rows = ["height_difference,P,R,0.530,0.005", "height_difference,R,Q,0.500,0.005"]
    (tmp_path / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *rows]) + "\n")
    covariances = "table,row_a,row_b,value,coord_a,coord_b\nground_points,P,Q,0.00016,Z,Z\n"
    (tmp_path / "covariances.csv").write_text(covariances)
    solution = bundle(
        tables(options=TablesOptions(path=tmp_path)), options=BundleOptions(tolerance=1e-8, blunders="none")
    )
    A = np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 1], [0, 1, -1]])
    C = np.diag([1e-4, 4e-4, 25e-6, 25e-6])
    C[0, 1] = C[1, 0] = 1.6e-4
    W = np.linalg.inv(C)
    Q = np.linalg.inv(A.T @ W @ A)
    x = Q @ A.T @ W @ np.array([100.0, 101.0, 0.53, 0.5])
    np.testing.assert_allclose(solution.points.xyz_m[:, 2], x, atol=1e-9)
    np.testing.assert_allclose(solution.points.covariance_m2[:, 2, 2], np.diag(Q), rtol=1e-6)
    assert np.isnan(solution.points.xyz_m[:, :2]).all()
    assert solution.redundancy == 1


def test_many_exact_distances_are_those_of_multipliers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = bundle(_network(tmp_path, exact="DE"), options=BundleOptions(tolerance=1e-8, blunders="none"))
    monkeypatch.setattr("aatri.adjustment.constraints.stiff.MOST_BY_MULTIPLIERS", 0)
    stiff = bundle(_network(tmp_path, exact="DE"), options=BundleOptions(tolerance=1e-8, blunders="none"))
    np.testing.assert_allclose(stiff.points.xyz_m, few.points.xyz_m, atol=1e-8)
    scale = np.abs(few.points.covariance_m2).max()
    np.testing.assert_allclose(stiff.points.covariance_m2 / scale, few.points.covariance_m2 / scale, atol=1e-5)
    assert (stiff.redundancy, stiff.observations) == (few.redundancy, few.observations)
    assert stiff.sigma0 == pytest.approx(few.sigma0, rel=1e-5)


def test_exact_distances_that_contradict_each_other_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("aatri.adjustment.constraints.stiff.MOST_BY_MULTIPLIERS", 0)
    _network(tmp_path, exact="DE")
    path = tmp_path / "relative_control.yaml"
    path.write_text(path.read_text() + "- {type: distance, points: [E, D], value: 72.5, exact: true}\n")
    with pytest.raises(GeometryError, match="exact conditions contradict each other: relative_distance"):
        bundle(tables(options=TablesOptions(path=tmp_path)), options=BundleOptions(max_sigma0=1e9))


def _measured(start: np.ndarray, end: np.ndarray, value: np.ndarray) -> NetworkObservations:
    n = len(value)
    return NetworkObservations(start, end, value, np.full(n, -1), np.full(n, ""), np.zeros(n))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_of_points_that_are_not_sure_the_surest_comes_first(side: float) -> None:
    """The first of two is on either side of its base, till the second is there, whose base is not straight."""
    xy = np.array([[0.0, 0.0], [100.0, 0.0], [50.0, 0.05], [30.0, 60.0 * side], [70.0, 80.0 * side]])
    start, end = np.array([0, 1, 4, 0, 1, 2]), np.array([3, 3, 3, 4, 4, 4])
    value = np.linalg.norm(xy[start] - xy[end], axis=1) + np.array([0.0, 0.0, 0.0, 0.01, -0.01, 0.01])
    known = np.column_stack([xy, np.zeros(5)])
    known[3:] = np.nan
    computed, doubtful = approximate_coordinates({"horizontal_distance": _measured(start, end, value)}, known)
    assert doubtful == {4}
    np.testing.assert_allclose(computed[3:, :2], xy[3:], atol=0.1)


def test_slope_distances_are_reduced_by_the_heights_that_height_differences_give() -> None:
    """From three known points to one 50 m above them; slope distances taken for horizontal ones put it elsewhere."""
    known, unknown = np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [20.0, 90.0, 0.0]]), np.array([30.0, 40.0, 50.0])
    ends = np.arange(3)
    network = {
        "distance": _measured(ends, np.full(3, 3), np.linalg.norm(unknown - known, axis=1)),
        "height_difference": _measured(ends[:1], np.array([3]), np.array([50.0])),
    }
    xyz, doubtful = approximate_coordinates(network, np.vstack([known, np.full(3, np.nan)]))
    np.testing.assert_allclose(xyz[3], unknown, atol=1e-6)
    assert not doubtful
