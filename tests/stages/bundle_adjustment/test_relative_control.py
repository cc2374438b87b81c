"""Relative control of every type in a network of distances: counts, exact as the limit of weighted, free datum."""

from __future__ import annotations

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
