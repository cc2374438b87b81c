"""A block from files beside an own bundle in dense matrices: whatever changes the adjustment changes both alike."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.dense_bundle import Array, Rows, bauer3, brown_conrady, ebner12, least_squares, projected
from tests.small_blocks import C_MM, HALF_MM, Small, flown
from tests.stages.film_blocks import Told

Basis = Callable[[Array], Array]

RADIUS_MM = float(np.hypot(HALF_MM, HALF_MM))


def sines(xy: Array) -> Array:
    """A set of the user's own, (n, 2, 2)."""
    K = np.zeros((len(xy), 2, 2))
    K[:, 0, 0], K[:, 1, 1] = np.sin(xy[:, 0] / 50), xy[:, 1] ** 2 / 1e4
    return K


COLUMNS: dict[str, Basis] = {
    "ebner12": lambda xy: ebner12(xy / (0.8 * HALF_MM)),
    "bauer3": lambda xy: bauer3(xy / RADIUS_MM, 70.0 / RADIUS_MM),
    "brown_conrady": lambda xy: brown_conrady(xy / RADIUS_MM, C_MM / RADIUS_MM),
    "user": sines,
}

OWN_SET = """
names = ["s", "t"]
def basis(x_mm, y_mm):
    K = np.zeros((len(x_mm), 2, 2))
    K[:, 0, 0], K[:, 1, 1] = np.sin(x_mm / 50), y_mm ** 2 / 1e4
    return K
"""


@dataclass(frozen=True)
class Adjusted:
    """The stage's result and its own counterpart: points (n, 3), their standard deviations, parameters, redundancy.

    sigma0 is that of the observations: the weights of parameters have no part in it, nor their redundancy, 1 - Q P0.
    """

    solution: Solution
    xyz_m: Array
    sigma_m: Array
    parameters: Array
    parameter_covariance: Array
    redundancy: int
    sigma0: float

    def agree(self) -> None:
        s = self.solution
        np.testing.assert_allclose(s.points.xyz_m, self.xyz_m, rtol=0, atol=1e-10)
        sigma = np.sqrt(np.einsum("nii->ni", s.points.covariance_m2))
        np.testing.assert_allclose(sigma, self.sigma_m, rtol=1e-9)
        assert s.unknowns == 6 * len(s.images) + self.xyz_m.size + len(self.parameters)
        assert s.redundancy == self.redundancy
        assert s.sigma0 == pytest.approx(self.sigma0, rel=1e-8)


def both(
    small: Small,
    folder: Path,
    *,
    basis: Basis | None = None,
    sets: Array | None = None,
    prior_mm: float | None = None,
    more: Callable[[Block], list[Rows]] = lambda _: [],
    edit: Callable[[Path], None] = lambda _: None,
    by: str = "graph",
    told: Told | None = None,
    calibration: Solution | None = None,
    **options: Any,
) -> Adjusted:
    """The stage, and the same observations in dense matrices, from the truth.

    Parameters
    ----------
    sets : (n_images,) int, optional
        Which set of parameters an image has; default: all the same.
    more : callable, optional
        Block -> further observations in the dense matrices.
    edit : callable, optional
        Changes the files before they are read.
    by : str
        Where the start comes from: `graph`, or `strips`.
    """
    edit(small.write(folder))
    block = tables(options=TablesOptions(path=folder), context=Told())
    points = calibrated(block, context=Told())
    start = _start(block, points, by)
    chosen = BundleOptions(blunders="none", tolerance=1e-9, **options)
    solution = bundle(block, points, start, calibration, options=chosen, context=told or Told())
    n, k = len(block.images), len(block.points)
    of_image = np.zeros(n, dtype=int) if sets is None else sets
    size = 0 if basis is None else basis(np.zeros((1, 2))).shape[2]
    n_sets = int(of_image.max()) + 1 if size else 0
    angles = [Rotation.from_matrix(small.rotation[i]).as_euler("XYZ") for i in block.images.id]
    poses = np.hstack([[small.position_m[i] for i in block.images.id], angles])
    true_m = np.array([small.xyz_m[p] for p in block.points.id])
    x0 = np.concatenate([poses.ravel(), true_m.ravel(), np.zeros(n_sets * size)])
    fixed = [*_control(block, 6 * n), *more(block)]
    if prior_mm is not None:
        own = np.arange(6 * n + 3 * k, len(x0))[:, None]
        fixed.append(Rows(lambda z: z, own, np.full(own.shape, prior_mm)))

    def observed(x: Array) -> list[Rows]:
        return [_rays(points, x, n, k, of_image, basis, size), *fixed]

    x, Q = least_squares(x0, observed)
    vPv = sum(float(((r.residual(x[r.columns]) / r.sigma) ** 2).sum()) for r in observed(x)[: -1 if prior_mm else None])
    share = 0.0 if prior_mm is None else float((1 - np.diag(Q)[6 * n + 3 * k :] / prior_mm**2).sum())
    count = sum(int(np.isfinite(rows.sigma).sum()) for rows in observed(x)) - len(x)
    at = slice(6 * n, 6 * n + 3 * k)
    sigma = np.sqrt(np.diag(Q)[at]).reshape(k, 3)
    of_sets = Q[at.stop :, at.stop :]
    sigma0 = float(np.sqrt(vPv / (count - share)))
    return Adjusted(solution, x[at].reshape(k, 3), sigma, x[at.stop :], of_sets, count, sigma0)


def _start(block: Block, points: ImagePoints, by: str) -> Solution:
    if by == "graph":
        return graph(block, points, context=Told(), rng=np.random.default_rng(1))
    strips = scale_transfer(block, dependent(block, points, context=Told()), context=Told())
    return polynomial(block, points, strips, similarity(block, strips, points, context=Told()), context=Told())


def _rays(points: ImagePoints, x: Array, n: int, k: int, of_image: Array, basis: Basis | None, size: int) -> Rows:
    """v = projection - measured - K p, K at the adjusted measurements of the step before."""
    m = points.measurements
    columns = np.hstack([6 * m.image[:, None] + np.arange(6), 6 * n + 3 * m.point[:, None] + np.arange(3)])
    if basis is None:
        return Rows(lambda z: projected(z, C_MM) - m.xy_mm, columns, m.sigma_mm)
    first = 6 * n + 3 * k + size * of_image[m.image]
    columns = np.hstack([columns, first[:, None] + np.arange(size)])
    at, z = m.xy_mm, x[columns]
    for _ in range(5):
        at = projected(z, C_MM) - np.einsum("nij,nj->ni", basis(at), z[:, 9:])
    K = basis(at)
    return Rows(lambda z: projected(z, C_MM) - m.xy_mm - np.einsum("nij,nj->ni", K, z[:, 9:]), columns, m.sigma_mm)


def _control(block: Block, first: int) -> list[Rows]:
    """One observation per coordinate that is control."""
    g, rows = block.ground_points, []
    for row, axis in zip(*np.nonzero(g.role == CONTROL)):
        column, sigma = np.array([[first + 3 * g.point[row] + axis]]), np.sqrt(g.covariance_m2[row, axis, axis])
        value = g.xyz_m[row, axis]
        rows.append(Rows(lambda z, value=value: z - value, column, np.array([[sigma]])))
    return rows


def two_by_four(**options: Any) -> Small:
    """Two strips of four images, every point in two or more; eight control points, no position is observed."""
    small = flown(2, 4, points=8, apart_m=350.0, **options)
    images = Counter(point for _, point in small.rays)
    small.rays = {key: xy for key, xy in small.rays.items() if images[key[1]] > 1}
    small.observed = {}
    small.control = dict.fromkeys(sorted({p for _, p in small.rays})[::8], "XYZ")
    return small


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    "options",
    [{"ordering": o} for o in ("auto", "nested_dissection", "minimum_degree", "across_strips", "along_strips")]
    + [{"solver": "direct", "memory_gb": 1e-5}],
    ids=lambda o: "-".join(map(str, o.values())),
)
def test_orders_of_elimination_and_memory_give_the_dense_solution(tmp_path: Path, options: dict[str, Any]) -> None:
    told = Told()
    both(two_by_four(), tmp_path / "b", told=told, **options).agree()
    assert any("the factor goes to" in line for line in told.lines) == ("memory_gb" in options)


def test_orientations_by_strips_are_a_start_of_six_iterations_at_most(tmp_path: Path) -> None:
    """Lecture notes 5.3: results of the strips as initial values; no orientation is given by the user."""
    result = both(two_by_four(), tmp_path / "b", by="strips")
    result.agree()
    assert result.solution.iterations <= 6


@pytest.mark.slow
def test_standard_deviations_of_rows_and_groups_weight_as_in_dense_matrices(tmp_path: Path) -> None:
    """One image four times less precise row by row, control five times by its group."""

    def edit(folder: Path) -> None:
        rows = (folder / "image_points.csv").read_text().splitlines()
        less = [f"{row},12,12" if row.startswith("102,") else f"{row},," for row in rows[1:]]
        (folder / "image_points.csv").write_text("\n".join([rows[0] + ",sx,sy", *less, ""]))
        head = yaml.safe_load((folder / "block.yaml").read_text())
        head["sigma"]["control"] = [0.1] * 3
        (folder / "block.yaml").write_text(yaml.safe_dump(head))

    result = both(two_by_four(), tmp_path / "b", edit=edit)
    result.agree()
    of_image = result.solution.residuals
    assert len(np.unique(of_image.sigma[of_image.kind == "image_point", :2])) == 2
    plain = both(two_by_four(), tmp_path / "plain").xyz_m
    assert np.abs(result.xyz_m - plain).max() > 0.01


def test_relative_control_has_no_unknowns_of_its_own(tmp_path: Path) -> None:
    """A distance and a difference of heights, weighted, in dense matrices."""
    small = two_by_four()
    a, b, c = [p for p in small.xyz_m if p not in small.control and sum(q == p for _, q in small.rays) > 2][:3]
    d = float(np.linalg.norm(small.xyz_m[a] - small.xyz_m[b])) + 0.02
    dz = float(small.xyz_m[c][2] - small.xyz_m[b][2]) - 0.1
    small.relative = [
        {"type": "distance", "points": [a, b], "value": d, "sigma": 0.005},
        {"type": "coordinate_difference", "points": [b, c], "axis": "Z", "value": dz, "sigma": 0.05},
    ]

    def more(block: Block) -> list[Rows]:
        first = 6 * len(block.images) + 3 * np.array([block.points.id.tolist().index(p) for p in (a, b, c)])
        ab = np.concatenate([first[0] + np.arange(3), first[1] + np.arange(3)])[None]
        return [
            Rows(lambda z: np.sqrt(((z[:, :3] - z[:, 3:]) ** 2).sum(axis=1))[:, None] - d, ab, np.array([[0.005]])),
            Rows(lambda z: z[:, 1:] - z[:, :1] - dz, first[None, 1:] + 2, np.array([[0.05]])),
        ]

    both(small, tmp_path / "b", more=more).agree()


def test_plan_and_height_control_count_coordinate_by_coordinate(tmp_path: Path) -> None:
    small = two_by_four()
    small.control = dict(zip(small.control, ("XYZ", "XY", "Z", "XYZ", "Y", "Z", "XYZ")))
    result = both(small, tmp_path / "b")
    seen = len(small.rays)
    assert result.redundancy == 2 * seen + 14 - 6 * 8 - 3 * len({p for _, p in small.rays})
    result.agree()


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("sigma_um", [50.0, None], ids=["50 um", "free"])
@pytest.mark.parametrize(("name", "basis"), COLUMNS.items())
def test_parameters_are_those_of_their_columns_written_out(
    tmp_path: Path, name: str, basis: Basis, sigma_um: float | None
) -> None:
    (tmp_path / "own_set.py").write_text(OWN_SET)
    chosen: dict[str, Any] = {"set": name, "sigma_um": sigma_um, "interior": False}
    chosen |= {"balance_radius_mm": 70.0} if name == "bauer3" else {}
    chosen |= {"user": tmp_path / "own_set.py"} if name == "user" else {}
    result = both(
        two_by_four(),
        tmp_path / "b",
        basis=basis,
        prior_mm=None if sigma_um is None else 1e-3 * sigma_um,
        self_calibration=chosen,
    )
    result.agree()


def test_a_set_of_each_image_is_that_of_its_columns(tmp_path: Path) -> None:
    result = both(
        two_by_four(),
        tmp_path / "b",
        basis=COLUMNS["bauer3"],
        sets=np.arange(8),
        prior_mm=0.01,
        self_calibration={
            "set": "bauer3",
            "sigma_um": 10.0,
            "per": "image",
            "balance_radius_mm": 70.0,
            "interior": False,
        },
    )
    result.agree()
