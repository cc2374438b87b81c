"""A portable frame by its distances is the body of its marks: against dense least squares, six unknowns a set-up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from aatri.errors import GeometryError
from aatri.geometry.portable_frame import BodyDistances, body_distances
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.bundle_adjustment.test_networks import HEAD

MARKS = np.array([[0, 0, 0], [1.2, 0.1, 0], [0.2, 1.1, 0.1], [0.4, 0.3, 0.9], [1.0, 0.9, 0.5]])
N, SIGMA = len(MARKS), 2e-3
PLACES = (
    (np.array([0.3, -0.2, 1.1]), np.array([10.0, 5.0, 1.0])),
    (np.array([-1.0, 0.4, 2.0]), np.array([14.0, 9.0, 2.0])),
)


def covariance() -> np.ndarray:
    """Of all coordinates of the marks: 0.3 mm, correlated."""
    A = np.random.default_rng(4).normal(size=(3 * N, 3 * N))
    return 9e-8 * (np.eye(3 * N) + 0.5 * A @ A.T / (3 * N))


def set_up(body: np.ndarray, turn: np.ndarray, place: np.ndarray) -> np.ndarray:
    return np.asarray(body @ Rotation.from_rotvec(turn).as_matrix().T + place)


def written(folder: Path, seen: np.ndarray, frame: BodyDistances, group: str = "") -> None:
    """A network of two set-ups, each mark with observed coordinates; the frame in the first, the second like it."""
    (folder / "block.yaml").write_text(HEAD)
    ids = [[f"S{s}M{k}" for k in range(N)] for s in range(2)]
    rows = [
        f"{ids[s][k]},{','.join(map(repr, seen[s, k].tolist()))},{SIGMA},{SIGMA},{SIGMA},control"
        for s in range(2)
        for k in range(N)
    ]
    (folder / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sX,sY,sZ,role", *rows]) + "\n")
    sigma = np.sqrt(np.diagonal(frame.covariance_m2))
    lines = [
        f"distance,{ids[0][a]},{ids[0][b]},{float(d)!r},{float(s)!r},{group}"
        for (a, b), d, s in zip(frame.pairs, frame.length_m, sigma)
    ]
    (folder / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma,group", *lines]) + "\n")
    between = [
        f"geodetic,{i + 1},{j + 1},{float(frame.covariance_m2[i, j])!r}"
        for i in range(len(sigma))
        for j in range(i + 1, len(sigma))
    ]
    (folder / "covariances.csv").write_text("\n".join(["table,row_a,row_b,value", *between]) + "\n")
    equal = [
        f"- {{type: equal_distance, pairs: [[{ids[0][a]}, {ids[0][b]}], [{ids[1][a]}, {ids[1][b]}]], exact: true}}"
        for a, b in frame.pairs
    ]
    (folder / "relative_control.yaml").write_text("\n".join(equal) + "\n")


@pytest.mark.parametrize("scale", [False, True], ids=["six parameters", "seven parameters"])
def test_two_set_ups_of_a_frame_have_the_coordinates_and_covariances_of_the_body(tmp_path: Path, scale: bool) -> None:
    rng, C = np.random.default_rng(7), covariance()
    given = MARKS + (np.linalg.cholesky(C) @ rng.normal(size=3 * N)).reshape(N, 3)
    true = 1.0002 * MARKS if scale else MARKS
    seen = np.array([set_up(true, *place) for place in PLACES]) + rng.normal(0, SIGMA, (2, N, 3))
    written(tmp_path, seen, body_distances(given, C), "frame" if scale else "")
    options = BundleOptions.model_validate({"blunders": "none", "tolerance": 1e-9, "distances": {"addition": False}})
    solution = bundle(tables(options=TablesOptions(path=tmp_path)), options=options)

    W = np.linalg.inv(np.linalg.cholesky(C))

    def places(x: np.ndarray) -> np.ndarray:
        body = x[: 3 * N].reshape(N, 3) * (1 + x[-1] * scale)
        return np.array([set_up(body, *x[3 * N + 6 * s : 3 * N + 6 * s + 6].reshape(2, 3)) for s in range(2)])

    def residuals(x: np.ndarray) -> np.ndarray:
        return np.concatenate([W @ (x[: 3 * N] - given.ravel()), (places(x) - seen).ravel() / SIGMA])

    start = np.concatenate([given.ravel(), *(np.concatenate(p) for p in PLACES), [0.0] if scale else []])
    dense = least_squares(residuals, start, x_scale="jac", method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    Q = np.linalg.inv(dense.jac.T @ dense.jac)
    A = dense.jac[3 * N :] * SIGMA
    order = [solution.points.id.tolist().index(f"S{s}M{k}") for s in range(2) for k in range(N)]
    sigma = np.sqrt(np.diagonal(A @ Q @ A.T)).reshape(-1, 3)
    off = (solution.points.xyz_m[order] - places(dense.x).reshape(-1, 3)) / sigma
    assert np.abs(off).max() < 5e-3  # of second order in 2 mm over 1 m
    found = np.sqrt(np.einsum("nii->ni", solution.points.covariance_m2[order]))
    np.testing.assert_allclose(found, sigma, rtol=2e-3)
    assert solution.redundancy == 2 * 3 * N + 3 * N - (3 * N + 12 + scale)
    if scale:
        of_scale = solution.parameters.value[solution.parameters.name == "scale"]
        np.testing.assert_allclose(of_scale, -dense.x[-1], atol=5e-3 * np.sqrt(Q[-1, -1]))


def test_marks_in_a_plane_are_distances_within_it_and_the_plane() -> None:
    """Across it they are known to 0.2 mm, within to 0.1 mm; three of them are a triangle, two a bar."""
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 2, 0]], dtype=float)
    turned = set_up(flat, *PLACES[0])
    turn = np.kron(np.eye(5), Rotation.from_rotvec(PLACES[0][0]).as_matrix())
    C = turn @ np.diag(np.tile([1e-8, 1e-8, 4e-8], 5)) @ turn.T
    found = body_distances(turned, C)
    assert found.pairs.shape == (7, 2)
    assert found.plane_sigma_m == pytest.approx(2e-4, rel=1e-9)
    assert np.linalg.cond(found.covariance_m2) < 1e6
    assert len(body_distances(turned[:3], C[:9, :9]).pairs) == 3
    bar = body_distances(turned[:2], C[:6, :6])
    assert bar.length_m == pytest.approx([1.0])
    assert bar.covariance_m2 == pytest.approx(np.array([[2e-8]]))
    assert np.isnan(bar.plane_sigma_m)


def test_a_board_measured_with_errors_across_it_is_flat_and_marks_far_off_it_are_a_solid_body() -> None:
    """0.3 mm off by chance, distances of a metre would hold it across by errors as large as themselves."""
    flat, sigma = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 2, 0]], dtype=float), 3e-4
    rng, C = np.random.default_rng(3), sigma**2 * np.eye(15)
    boards = [body_distances(set_up(flat + rng.normal(0, sigma, (5, 3)), *PLACES[0]), C) for _ in range(50)]
    assert {len(board.pairs) for board in boards} == {7}
    planes = np.array([board.plane_sigma_m for board in boards])
    expected = sigma**2 * (1 + 2 / 5)  # its own errors, and how far off it was measured: chi2 of 5 - 3, over five
    assert np.mean(planes**2) == pytest.approx(expected, rel=4 * 0.4 / 1.4 / np.sqrt(50))
    lifted = flat + np.array([[0, 0, 0.02]] + [[0, 0, 0]] * 4)
    assert len(body_distances(lifted, C).pairs) == 9


def test_marks_on_a_line_or_at_one_place_are_refused() -> None:
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 2, 0]], dtype=float)
    with pytest.raises(GeometryError, match="on a line"):
        body_distances(np.outer(np.arange(4.0), [1.0, 2.0, 0.5]), 1e-8 * np.eye(12))
    with pytest.raises(GeometryError, match="1 marks are no body"):
        body_distances(flat[:1], 1e-8 * np.eye(3))
    with pytest.raises(GeometryError, match="same place"):
        body_distances(np.vstack([flat[:4], flat[:1]]), 1e-8 * np.eye(15))


def test_the_chosen_distances_determine_all_others() -> None:
    found = body_distances(MARKS, covariance())
    assert found.pairs.shape == (3 * N - 6, 2)
    assert len({tuple(p) for p in found.pairs.tolist()}) == 3 * N - 6
    assert np.linalg.cond(found.covariance_m2) < 1e6
