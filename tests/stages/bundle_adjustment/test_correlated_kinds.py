"""Observations of different kinds with covariances between them: against dense least squares."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.small_blocks import adjusted_by, flown
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


MARKED = ("C1", "C2", "C3", "C4", "p10", "p21", "p33", "p40")


def _of_a_network(folder: Path, seed: int, *, off: dict[str, Any], stated: float = 1.0, less: str = "") -> Path:
    """Two strips with control of one covariance, errors drawn from it, some of it off; `less` is not in the tables."""
    small, rng = flown(2, 4, seed=seed), np.random.default_rng([seed, 77])
    small.control, small.observed = dict.fromkeys(MARKED, "XYZ"), {}
    A = np.eye(24) + rng.normal(0, 0.2, (24, 24))
    C = A @ A.T * 0.02**2
    given = np.array([small.xyz_m[p] for p in MARKED]) + (A @ rng.normal(0, 0.02, 24)).reshape(8, 3)
    small.write(folder)
    at = given + np.array([off.get(p, np.zeros(3)) for p in MARKED])
    used = [k for k, p in enumerate(MARKED) if p != less]
    rows = [",".join([MARKED[k], *map(repr, at[k].tolist())]) for k in used]
    (folder / "ground_points.csv").write_text("\n".join(["point,X,Y,Z", *rows, ""]))
    pairs = [(3 * a + i, 3 * b + j) for a in used for b in used for i in range(3) for j in range(3)]
    lines = [
        f"ground_points,{MARKED[i // 3]},{MARKED[j // 3]},{C[i, j] * stated**2!r},{'XYZ'[i % 3]},{'XYZ'[j % 3]}"
        for i, j in pairs
        if i <= j
    ]
    head = "table,row_a,row_b,value,coord_a,coord_b"
    (folder / "covariances.csv").write_text("\n".join([head, *lines, ""]).replace("np.float64(", "").replace(")", ""))
    return folder


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("seed", "off"), [(3, [0.6, 0, 0]), (4, [0, 40.0, 0]), (5, [0, 0, -0.6])])
def test_a_wrong_point_of_correlated_control_goes_alone(tmp_path: Path, seed: int, off: list[float]) -> None:
    """The result is that of the control without it, its covariances among the others'."""
    wrong = {"p21": np.array(off)}
    done = adjusted_by("graph", _of_a_network(tmp_path / "block", seed, off=wrong))
    without = adjusted_by("graph", _of_a_network(tmp_path / "without", seed, off={}, less="p21"))
    assert any("control point p21 is off by" in text for text in done.warnings)
    suspects = done.bundle.suspects
    out = suspects.point[(suspects.kind == "control") & suspects.staying_out]
    assert out.tolist() == ["p21"]
    np.testing.assert_allclose(suspects.error[suspects.point == "p21"], [off], atol=0.15)
    of = {p: k for k, p in enumerate(without.bundle.points.id.tolist())}
    order = [of[p] for p in done.bundle.points.id.tolist()]
    np.testing.assert_allclose(done.bundle.points.xyz_m, without.bundle.points.xyz_m[order], atol=1e-4)
    np.testing.assert_allclose(
        done.bundle.points.covariance_m2, without.bundle.points.covariance_m2[order], rtol=1e-3, atol=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("chain", ["graph", "strips"])
@pytest.mark.parametrize("seed", [6, 7])
def test_exchanged_numbers_of_correlated_control_stay_out(tmp_path: Path, chain: str, seed: int) -> None:
    """What an earlier stage has rejected of a set does not come back with it; the bundle did not converge."""
    small = flown(2, 4, seed=seed)
    apart = small.xyz_m["C4"] - small.xyz_m["p10"]
    done = adjusted_by(chain, _of_a_network(tmp_path / "block", seed, off={"p10": apart, "C4": -apart}))
    suspects = done.bundle.suspects
    assert set(suspects.point[(suspects.kind == "control") & suspects.staying_out].tolist()) == {"p10", "C4"}
    assert 0.8 < done.bundle.sigma0 < 1.2


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("seed", [8, 9, 10])
def test_covariances_of_control_that_are_too_small_are_scaled_and_cost_no_point(tmp_path: Path, seed: int) -> None:
    """A fifth of the true standard deviations; so for single points, whose class has a scale."""
    done = adjusted_by("graph", _of_a_network(tmp_path / "block", seed, off={}, stated=0.2))
    assert not done.bundle.suspects.staying_out.any()
    scaled = [text for text in done.warnings if "standard deviations do not fit the residuals" in text]
    (factor,) = (float(re.search(r": control ([\d.]+)$", text)[1]) for text in scaled)
    assert 5 / 1.6 < factor < 5 * 1.6  # 24 coordinates, of which some 18 are redundant
