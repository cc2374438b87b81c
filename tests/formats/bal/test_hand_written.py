"""A BAL problem of two cameras and four points, written by hand: what each figure becomes, and where it stops."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.errors import AatriError
from aatri.formats.bal.problem import read_problem
from aatri.geometry.rotations import rotation_from_angles
from tests.reading import read_bal

CAMERAS = np.array(
    [[0.1, -0.2, 0.3, 1.0, -2.0, -9.0, 500.0, 1e-3, -2e-4], [-0.3, 0.1, 2.0, -1.5, 0.5, -12.0, 620.0, -3e-3, 5e-5]]
)
"""Rotation vector, translation, f, k1, k2: P = R X + t, p = -P / P.z, f (1 + k1 |p|^2 + k2 |p|^4) p, in pixels."""
POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, -1.0], [-2.0, 1.0, 0.5], [0.5, -1.5, 1.0]])


def problem(cameras: np.ndarray = CAMERAS, points: np.ndarray = POINTS) -> list[str]:
    """The lines of the file; every camera sees every point, without error."""
    lines = [f"{len(cameras)} {len(points)} {len(cameras) * len(points)}"]
    for j, X in enumerate(points):
        for i, (w, t, (f, k1, k2)) in enumerate((c[:3], c[3:6], c[6:]) for c in cameras):
            P = Rotation.from_rotvec(w).apply(X) + t
            p = -P[:2] / P[2]
            x, y = f * (1 + k1 * (p @ p) + k2 * (p @ p) ** 2) * p
            lines.append(f"{i} {j} {float(x)!r} {float(y)!r}")
    return lines + [repr(float(v)) for v in cameras.ravel()] + [repr(float(v)) for v in points.ravel()]


def read(folder: Path, lines: list[str], **options: object):
    path = folder / "problem.txt"
    path.write_text("\n".join(lines) + "\n")
    return read_bal(path, **options)


def test_the_block_photographs_its_points_as_the_problem_does(tmp_path: Path) -> None:
    block = read(tmp_path, problem(), image_sigma_px=0.5)
    R = Rotation.from_rotvec(CAMERAS[:, :3]).as_matrix()
    for k in range(2):
        np.testing.assert_allclose(block.exterior.position_m[k], -R[k].T @ CAMERAS[k, 3:6], atol=1e-12)
        np.testing.assert_allclose(rotation_from_angles(block.exterior.angles_rad[k]), R[k].T, atol=1e-12)
    np.testing.assert_allclose(block.ground_points.xyz_m, POINTS)
    np.testing.assert_allclose(block.cameras.principal_distance_mm, [0.5, 0.62])
    rows = block.image_points
    assert len(rows) == 8
    for i, p, xy in zip(rows.image, rows.point, rows.xy):
        u = R[i] @ (POINTS[p] - block.exterior.position_m[i])  # the camera looks along -z
        ideal = -u[:2] / u[2]
        f, k1, k2 = CAMERAS[i, 6:]
        r2 = ideal @ ideal
        np.testing.assert_allclose(xy, f * (1 + k1 * r2 + k2 * r2 * r2) * ideal, rtol=1e-12)
    assert (rows.sigma_mm == 0.0005).all()
    assert (block.cameras.pixel_size_mm == 0.001).all()
    assert block.cameras.pixel_y.tolist() == ["up", "up"]
    named = {
        (int(c), str(n)): (v, bool(free))
        for c, n, v, free in zip(*(getattr(block.camera_parameters, n) for n in ("camera", "name", "value", "free")))
    }
    assert named[0, "k1"] == (1e-3, True)
    assert named[1, "k2"] == (5e-5, True)
    assert rows.line[(rows.image == 1) & (rows.point == 2)].tolist() == [7]
    assert block.images.line.tolist() == [10, 19]


def read_problem_of(lines: list[str], folder: Path) -> None:
    """Read the figures alone; what cannot be used of a block is another matter."""
    path = folder / "figures.txt"
    path.write_text("\n".join(lines) + "\n")
    read_problem(path)


LIMITS = {
    # case: line, a text that is allowed, one that is not, what is said of it
    "last camera": (2, "1 0 0.1 0.2", "2 0 0.1 0.2", "camera 2, but there are 2"),
    "first camera": (2, "0 0 0.1 0.2", "-1 0 0.1 0.2", "camera -1, but there are 2"),
    "last point": (9, "1 3 0.1 0.2", "1 4 0.1 0.2", "point 4, but there are 4"),
    "first point": (9, "1 0 0.1 0.2", "1 -1 0.1 0.2", "point -1, but there are 4"),
    "a whole number": (9, "1 3.0 0.1 0.2", "1 3.5 0.1 0.2", "point 3.5, but there are 4"),
    "focal length": (16, "0.001", "0", "focal length 0"),
    "second focal length": (25, "0.001", "-0.001", "focal length -0.001"),
    "a number": (30, "1e99", "1e999", "no number"),
    "counts": (1, "2 4 8", "2 4 0", "does not begin with the numbers"),
}


@pytest.mark.parametrize("case", LIMITS)
def test_a_figure_is_taken_up_to_its_limit_and_no_farther(tmp_path: Path, case: str) -> None:
    line, inside, outside, what = LIMITS[case]
    before, after = problem()[: line - 1], problem()[line:]
    read_problem_of([*before, inside, *after], tmp_path)
    with pytest.raises(AatriError, match=what) as caught:
        read(tmp_path, [*before, outside, *after])
    assert f"problem.txt:{line}: " in str(caught.value)


def test_a_number_too_few_or_too_many_is_noticed(tmp_path: Path) -> None:
    for lines in (problem()[:-1], [*problem(), "1.0"]):
        with pytest.raises(AatriError, match=r"numbers where 2 cameras, 4 points and 8 observations need 65"):
            read(tmp_path, lines)
