"""Relative control of every type in a network of distances: counts, exact as the limit of weighted, free datum."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle

FIXED = {
    "A": (0.0, 0.0, 0.0),
    "B": (60.0, 5.0, 8.0),
    "C": (20.0, 55.0, -4.0),
    "D": (30.0, 20.0, 45.0),
    "E": (-20.0, 30.0, 20.0),
}
SIGMA = 0.005

HEAD = """aatri_block: 1
name: network
frames: {local: {axes: [east, north, up], crs: local}}
earth_curvature: ignore
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg, time: s}
"""
d = np.array([0.48, -0.6, 0.64])
turn = [0.0, 0.9, 2.1, 2.9, 4.2, 5.5]
circle = [np.array([20 + 7 * np.cos(a), 20 + 7 * np.sin(a), z]) for a, z in zip(turn, (3, 9, -4, 1, 6, 12))]
u, w = np.array([0.6, 0.0, 0.8]), np.array([-0.8, 0.0, 0.6])
ball = [
    np.array([10.0, 22.0, 9.0]) + 12 * s * np.array(e)
    for s, e in zip((1, -1, 1, -1, 1, -1), (u, u, w, w, (0, 1, 0), (0, 1, 0)))
]
CASES = {  # type: members, true points, value, gained
    "plane": (
        "points: [1, 2, 3, 4, 5, 6]",
        [
            20 * d + a * u + b * np.cross(d, u) + [20, 30, 5]
            for a, b in ((0, 0), (18, 1), (-9, 12), (4, -15), (12, 14), (-14, -8))
        ],
        "",
        3,
    ),
    "vertical_plane": (
        "points: [1, 2, 3, 4]",
        [[10 + 3 * s, 20 - 4 * s, z] for s, z in ((0, 3), (2, 22), (5, -9), (-3, 10))],
        "",
        2,
    ),
    "horizontal_plane": ("points: [1, 2, 3, 4]", [[5, 9, 7], [25, 3, 7], [12, 30, 7], [40, 44, 7]], "", 3),
    "equal_height": ("points: [1, 2, 3]", [[5, 9, 7], [25, 3, 7], [12, 30, 7]], "", 2),
    "line": ("points: [1, 2, 3, 4]", [[20, 25 + s, 5 + 2 * s] for s in (0.0, 7.0, -4.0, 11.0)], "", 4),  # across X
    "plumb_line": ("points: [1, 2, 3]", [[14, 18, z] for z in (0, 11, 25)], "", 4),
    "horizontal_line": ("points: [1, 2, 3, 4]", [[10 + 3 * s, 20 - 4 * s, 6] for s in (0, 2, 5, -3)], "", 5),
    "distance": ("points: [1, 2]", [[10, 10, 10], [13, 14, 22]], "value: 13.0", 1),
    "equal_distance": (
        "pairs: [[1, 2], [3, 4], [5, 6]]",
        [[9, 9, 9], [12, 13, 9], [30, 3, 5], [30, 8, 5], [9, 30, 2], [9, 33, 6]],
        "",
        2,
    ),
    "angle": ("at: 1, between: [2, 3]", [[10, 10, 10], [22, 10, 10], [10, 31, 10]], "value: 90.0", 1),
    "coordinate_difference": ("points: [1, 2]", [[10, 10, 10], [13, 14, 22]], "axis: Y, value: 4.0", 1),
    "parallel": ("pairs: [[1, 2], [3, 4]]", [[9, 9, 9], [12, 13, 21], [30, 3, 5], [24, -5, -19]], "", 2),
    "perpendicular": ("pairs: [[1, 2], [3, 4]]", [[9, 9, 9], [17, 9, 15], [30, 3, 5], [24, 12, 13]], "", 1),
    "sphere": ("points: [1, 2, 3, 4, 5, 6]", ball, "", 2),
    "sphere of known radius": ("points: [1, 2, 3, 4, 5, 6]", ball, "radius: 12.0", 3),
    "cylinder": ("points: [1, 2, 3, 4, 5, 6]", circle, "", 1),
    "cylinder of known radius": ("points: [1, 2, 3, 4, 5, 6]", circle, "radius: 7.0", 2),
}
ANGULAR = {"angle", "parallel", "perpendicular"}


def _network(folder: Path, case: str, how: str, *, fixed: bool = True, seed: int = 7) -> Solution:
    """Distances from five stations to each point of the case, with noise; the condition as `how` says."""
    members, points, value, _ = CASES[case]
    folder.mkdir()
    rng = np.random.default_rng(seed)
    true = {**FIXED, **{str(k + 1): tuple(map(float, p)) for k, p in enumerate(points)}}
    (folder / "block.yaml").write_text(HEAD)
    rows = [
        f"{k},{x},{y},{z},0,0,0,control"
        if k in FIXED and fixed
        else f"{k},{x + rng.normal(0, 0.2)},{y + rng.normal(0, 0.2)},{z + rng.normal(0, 0.2)},,,,approximate"
        for k, (x, y, z) in true.items()
    ]
    (folder / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sX,sY,sZ,role", *rows]) + "\n")
    pairs = [(a, b) for a in FIXED for b in true if ((b not in FIXED or not fixed) and a < b) or (b not in FIXED)]
    lines = [
        f"distance,{a},{b},{float(np.linalg.norm(np.subtract(true[a], true[b])) + rng.normal(0, SIGMA))!r},{SIGMA}"
        for a, b in pairs
    ]
    (folder / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *lines]) + "\n")
    if how:
        body = ", ".join(part for part in (f"type: {case.split()[0]}", members, value, how) if part)
        (folder / "relative_control.yaml").write_text(f"- {{{body}}}\n")
    options = BundleOptions(tolerance=1e-7, blunders="none", datum="given" if fixed else "free")
    return bundle(tables(options=TablesOptions(path=folder)), options=options)


@pytest.mark.slow(after=17)
@pytest.mark.parametrize("ratio", [1e-4, 1e-9])
@pytest.mark.parametrize("case", CASES)
def test_exact_is_the_limit_of_weighted_and_the_redundancy_is_that_of_the_notes(
    case: str, ratio: float, tmp_path: Path
) -> None:
    plain = _network(tmp_path / "plain", case, "")
    small = ratio * SIGMA * (180 / np.pi / 10 if case in ANGULAR else 1.0)
    weighted = _network(tmp_path / "weighted", case, f"sigma: {small!r}")
    exact = _network(tmp_path / "exact", case, "exact: true")
    gained = CASES[case][3]
    given = [set(s.residuals.sigma[s.residuals.kind == case.split()[0], 0].tolist()) for s in (weighted, exact)]
    if case.split()[0] not in ("distance", "angle", "coordinate_difference"):  # kinds that networks observe, too
        assert given[1] == {0.0}
        assert min(given[0]) > 0
    assert weighted.redundancy - plain.redundancy == gained
    assert exact.redundancy - plain.redundancy == gained
    np.testing.assert_allclose(exact.points.xyz_m, weighted.points.xyz_m, atol=1e-8)
    assert exact.sigma0 == pytest.approx(weighted.sigma0, rel=1e-6)
    assert not np.allclose(exact.points.xyz_m, plain.points.xyz_m, atol=1e-5)
    scale = np.abs(plain.points.covariance_m2).max()
    np.testing.assert_allclose(
        exact.points.covariance_m2 / scale, weighted.points.covariance_m2 / scale, atol=1e-6 if ratio == 1e-4 else 5e-5
    )


def _conditions_of_the_notes(case: str, X: np.ndarray) -> np.ndarray:
    """g(X) = 0 of the points (m, 3) by the lecture notes 5-7, with errata E18 (line) and E19 (angle, vertex 1)."""
    d = X - X[0]
    if case == "plane":  # (5-7-24)
        return np.array([np.linalg.det(np.array([one, d[1], d[2]])) for one in d[3:]])
    if case == "line":  # (5-7-28), the components across the direction's largest, Z
        return np.concatenate([d[2:, k] * d[1, 2] - d[2:, 2] * d[1, k] for k in (0, 1)])
    upright = d[2:, 0] * d[1, 1] - d[2:, 1] * d[1, 0]  # (5-7-15)
    if case == "vertical_plane":
        return upright
    if case in ("horizontal_plane", "equal_height"):
        return d[1:, 2]
    if case == "plumb_line":
        return d[1:, :2].ravel()
    if case == "horizontal_line":
        return np.concatenate([upright, d[1:, 2]])
    if case == "distance":
        return np.array([d[1] @ d[1] - 13.0**2])
    if case == "angle":  # cosine law with cos 90 degrees = 0
        return np.array([(X[2] - X[1]) @ (X[2] - X[1]) - d[1] @ d[1] - d[2] @ d[2]])
    if case == "coordinate_difference":
        return np.array([d[1, 1] - 4.0])
    u = X[1::2] - X[::2]
    if case == "equal_distance":
        return np.array([u[k] @ u[k] - u[0] @ u[0] for k in (1, 2)])
    return np.array([u[0] @ u[1]]) if case == "perpendicular" else _cross(u[0], u[1])[:2]


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@pytest.mark.parametrize("case", [c for c in CASES if c.split()[0] not in ("sphere", "cylinder")])
def test_exact_is_least_squares_with_the_conditions_of_the_notes_by_multipliers(case: str, tmp_path: Path) -> None:
    """[[N, G'], [G, 0]] in dense matrices, derivatives by complex step: points, their covariances and v'Pv."""
    exact = _network(tmp_path / "exact", case, "exact: true")
    rows = [line.split(",") for line in (tmp_path / "exact" / "geodetic.csv").read_text().split()[1:]]
    X = np.array(CASES[case][1], dtype=float)

    def lengths(points: np.ndarray) -> np.ndarray:
        place = {**{k: np.array(v) for k, v in FIXED.items()}, **{str(k + 1): x for k, x in enumerate(points)}}
        d = [place[row[1]] - place[row[2]] for row in rows]
        return np.array([np.sqrt(one @ one) for one in d])

    def derivatives(f: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        step = 1e-30j * np.eye(X.size).reshape(-1, *X.shape)
        return np.array([f(X + one).imag / 1e-30 for one in step]).T

    for _ in range(30):
        A, G = derivatives(lengths), derivatives(lambda x: _conditions_of_the_notes(case, x))
        G_unit = G / np.linalg.norm(G, axis=1)[:, None]
        misclosure = np.array([float(row[3]) for row in rows]) - lengths(X)
        g = _conditions_of_the_notes(case, X) / np.linalg.norm(G, axis=1)
        whole = np.block([[A.T @ A, G_unit.T], [G_unit, np.zeros((len(G), len(G)))]])
        X = X + np.linalg.solve(whole, np.concatenate([A.T @ misclosure, -g]))[: X.size].reshape(X.shape)
    rows_of = [exact.points.id.tolist().index(str(k + 1)) for k in range(len(X))]
    np.testing.assert_allclose(exact.points.xyz_m[rows_of], X, atol=1e-8)
    Q = SIGMA**2 * np.linalg.inv(whole)[: X.size, : X.size]
    own = np.array([Q[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(len(X))])
    np.testing.assert_allclose(exact.points.covariance_m2[rows_of], own, atol=1e-6 * np.abs(own).max())
    assert exact.redundancy == len(rows) - X.size + len(G)
    assert exact.sigma0 == pytest.approx(np.sqrt(misclosure @ misclosure / exact.redundancy) / SIGMA, rel=1e-6)


@pytest.mark.parametrize("case", CASES)
def test_a_free_network_with_relative_control_is_the_fixed_one_moved(case: str, tmp_path: Path) -> None:
    """Control adds to a free network what its own distances do not: here stations are tied by distances as well."""
    sigma = f"sigma: {SIGMA * (180 / np.pi / 10 if case in ANGULAR else 1.0)!r}"
    free = _network(tmp_path / "free", case, sigma, fixed=False)
    plain = _network(tmp_path / "plain", case, "", fixed=False)
    open_tilts = case in (
        "vertical_plane",
        "horizontal_plane",
        "equal_height",
        "plumb_line",
        "horizontal_line",
        "coordinate_difference",
    )
    seen = {
        "vertical_plane": 1,
        "horizontal_plane": 2,
        "equal_height": 2,
        "plumb_line": 2,
        "horizontal_line": 1,
        "coordinate_difference": 1,
    }.get(case, 0)
    assert free.redundancy - plain.redundancy == CASES[case][3] - (seen if open_tilts else 0)
    assert np.isfinite(free.points.covariance_m2).all()
    # inner constraints: the points are shifted nowhere as a whole
    true = {**FIXED, **{str(k + 1): p for k, p in enumerate(CASES[case][1])}}
    away = free.points.xyz_m - np.array([true[str(k)] for k in free.points.id])
    assert np.abs(away).max() < 1.0


@pytest.mark.parametrize("case", ["horizontal_plane", "equal_height"])
def test_the_height_of_points_of_one_height_counts_as_theirs_do(case: str, tmp_path: Path) -> None:
    done = _network(tmp_path / "b", case, "exact: true")
    height_m = done.parameters.value[done.parameters.name == "height"]
    on_it = [str(k + 1) for k in range(3)]
    np.testing.assert_allclose(done.points.xyz_m[np.isin(done.points.id, on_it), 2], height_m[0], atol=1e-6)
