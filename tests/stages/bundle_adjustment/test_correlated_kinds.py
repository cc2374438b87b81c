"""Observations of different kinds with covariances between them: against dense least squares."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.bundle_adjustment.test_networks import HEAD

A, B, P = np.array([0.0, 0.0, 0.0]), np.array([90.0, 40.0, 3.0]), np.array([35.0, 80.0, 12.0])
SIGMA = {"distance": 0.004, "zenith": np.radians(0.003), "azimuth": np.radians(0.004)}


def _value(kind: str, a: np.ndarray, b: np.ndarray) -> float:
    e, n, u = b - a
    return {
        "distance": np.sqrt(e * e + n * n + u * u),
        "zenith": np.arctan2(np.hypot(e, n), u),
        "azimuth": np.arctan2(e, n) % (2 * np.pi),
    }[kind]


def test_the_distance_zenith_angle_and_azimuth_of_a_sight_may_be_correlated(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    kinds, rho = ("distance", "zenith", "azimuth"), np.array([[1, 0.6, -0.3], [0.6, 1, 0.2], [-0.3, 0.2, 1]])
    s = np.array([SIGMA[k] for k in kinds])
    C = rho * np.outer(s, s)
    observed = {
        name: np.array([_value(k, a, P) for k in kinds]) + rng.multivariate_normal(np.zeros(3), C)
        for name, a in (("A", A), ("B", B))
    }
    (tmp_path / "block.yaml").write_text(HEAD)
    (tmp_path / "ground_points.csv").write_text(
        "point,X,Y,Z,sX,sY,sZ,role\nA,0,0,0,0,0,0,control\nB,90,40,3,0,0,0,control\nP,36,79,11,,,,approximate\n"
    )
    lines, pairs = [], []
    unit = np.array([1.0, np.degrees(1), np.degrees(1)])
    for number, name in enumerate("AB"):
        for k, kind in enumerate(kinds):
            lines.append(f"{kind},{name},P,{float(observed[name][k] * unit[k])!r},{float(s[k] * unit[k])!r}")
        for i, j in ((0, 1), (0, 2), (1, 2)):
            value = float(C[i, j] * unit[i] * unit[j])
            pairs.append(f"geodetic,{3 * number + i + 1},{3 * number + j + 1},{value!r}")
    (tmp_path / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *lines]) + "\n")
    (tmp_path / "covariances.csv").write_text("\n".join(["table,row_a,row_b,value", *pairs]) + "\n")
    options = BundleOptions(tolerance=1e-9, reliability=True, blunders="none")
    solution = bundle(tables(options=TablesOptions(path=tmp_path)), options=options)

    W = np.linalg.inv(np.linalg.cholesky(C))

    def residuals(x: np.ndarray) -> np.ndarray:
        return np.concatenate([W @ ([_value(k, a, x) for k in kinds] - observed[n]) for n, a in (("A", A), ("B", B))])

    dense = least_squares(residuals, P, x_scale=1.0, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    row = solution.points.id.tolist().index("P")
    np.testing.assert_allclose(solution.points.xyz_m[row], dense.x, atol=1e-7)
    np.testing.assert_allclose(solution.points.covariance_m2[row], np.linalg.inv(dense.jac.T @ dense.jac), rtol=1e-4)
    assert solution.redundancy == 3
    np.testing.assert_allclose(solution.sigma0, np.sqrt(2 * dense.cost / 3), rtol=1e-6)
    mine = solution.residuals.kind == "correlated"
    assert mine.sum() == 6
    assert set(solution.residuals.unit[mine].tolist()) == {"m", "rad"}
    tests = solution.tests
    assert tests is not None
    assert abs(np.nansum(tests.redundancy[mine]) - 3) < 1e-6
