"""The principal distance and the flying height: which designs separate them, in a whole block.

Four strips of eight images, 60/30 %, c = 100 mm, H = 1000 m, 3 um, nine control points of 2 cm, free c, x0, y0, k1, k2.
Reference values of the same design: largest correlation of c with a Z0 0.999998 flat and vertical, 0.999999 with
crossed strips flown 20 % higher, 0.971 with images 15 degrees oblique, 0.16 with projection centres of 5 cm.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.adjustment.statistics.significance import correlated_with_others, estimates
from aatri.camera.parameters.advice import advise
from aatri.camera.parameters.brown import BROWN_CONRADY
from aatri.camera.parameters.parameter_set import chosen, scale_of_format
from aatri.geometry.collinearity import collinearity, in_image_axes, project
from aatri.geometry.rotations import rotation_from_angles

C_MM, H, HALF = 100.0, 1000.0, np.array([50.0, 50.0])
NEARLY_FLAT = 0.01


def flight(design: str) -> tuple[Any, Any]:
    side = 2 * HALF[0] / C_MM * H
    X0, angles = [], []
    for strip in range(4):
        for i in range(8):
            X0.append([i * 0.4 * side, strip * 0.7 * side, H])
            tilt = np.deg2rad(15) * (-1) ** i if design == "oblique" else 0.0
            angles.append([tilt, 0.0, np.pi * (strip % 2)])
    if design == "crossed":
        for x in (0.7 * side, 2.1 * side):
            X0 += [[x, y, 1.2 * H] for y in np.arange(0.0, 2.2 * side, 0.48 * side)]
        angles += [[0.0, 0.0, np.pi / 2]] * (len(X0) - len(angles))
    return np.array(X0), np.array([rotation_from_angles(np.array(a)) for a in angles])


def points_of(relief: float) -> Any:
    rng = np.random.default_rng(1)
    side = 2 * HALF[0] / C_MM * H
    plan = rng.uniform([-0.3 * side, -0.3 * side], [3.1 * side, 2.4 * side], (400, 2))
    plan[:9] = [[x, y] for x in (0.0, 1.4 * side, 2.8 * side) for y in (0.0, 1.05 * side, 2.1 * side)]
    return np.column_stack([plan, rng.uniform(-0.5, 0.5, 400) * relief * H])


def largest(design: str, relief: float) -> tuple[str, float, float]:
    """Z0 that c is most correlated with, the correlation, and the standard deviation of c, mm; dense algebra."""
    (X0, R), X = flight(design), points_of(relief)
    camera = chosen(BROWN_CONRADY, ["c", "x0", "y0", "k1", "k2"])
    image, point = (a.ravel() for a in np.meshgrid(np.arange(len(X0)), np.arange(len(X)), indexing="ij"))
    xy = project(in_image_axes(X0[image], R[image], X[point]), np.full(len(image), C_MM))
    inside = (np.abs(xy) <= HALF).all(axis=1)
    inside &= (np.bincount(point[inside], minlength=len(X)) >= 2)[point]
    image, point = image[inside], point[inside]
    xy, by_pose, by_point = collinearity(X0[image], R[image], X[point], np.full(len(image), C_MM))
    poses = 6 * len(X0)
    J = np.zeros((len(image), 2, poses + 5))
    for k in range(6):
        J[np.arange(len(image)), :, 6 * image + k] = by_pose[:, :, k]
    J[:, :, poses:] = -camera.basis(xy, scale_of_format(HALF, C_MM))
    J, by_point = J / 0.003, by_point / 0.003
    N = np.zeros((poses + 5, poses + 5))
    for p in np.unique(point):
        rows = point == p
        A, B = J[rows].reshape(-1, poses + 5), by_point[rows].reshape(-1, 3)
        AB = A.T @ B
        N += A.T @ A - AB @ np.linalg.solve(B.T @ B + (np.eye(3) / 0.02**2 if p < 9 else 0.0), AB.T)
    if design == "gnss":
        position = (6 * np.arange(len(X0))[:, None] + np.arange(3)).ravel()
        N[position, position] += 1 / 0.05**2
    scale = np.sqrt(np.diag(N))
    C = np.linalg.inv(N / np.outer(scale, scale)) / np.outer(scale, scale)
    Z0 = 6 * np.arange(len(X0)) + 2
    e = estimates(camera.parameters, np.zeros(5), C[poses:, poses:])
    names = [f"Z0 of image {i}" for i in range(len(X0))]
    pairs = correlated_with_others(e, C[poses:, Z0], np.diag(C)[Z0], names, limit=0.0)
    worst = next(p for p in pairs if p.first == "c")
    return worst.second, worst.correlation, float(np.sqrt(C[poses, poses]))


@pytest.mark.parametrize(
    ("design", "relief", "low", "high", "determinable"),
    [
        ("vertical", NEARLY_FLAT, 0.9999, 1.0, False),
        ("crossed", NEARLY_FLAT, 0.9999, 1.0, False),
        ("oblique", NEARLY_FLAT, 0.96, 0.98, True),
        ("gnss", NEARLY_FLAT, 0.13, 0.19, True),
        ("vertical", 0.05, 0.9990, 0.9999, False),
        ("vertical", 0.1, 0.997, 0.9999, None),
        ("vertical", 0.2, 0.996, 0.999, True),
        ("oblique", 0.2, 0.78, 0.86, True),
    ],
)
def test_designs(design: str, relief: float, low: float, high: float, determinable: bool | None) -> None:
    other, rho, _ = largest(design, relief)
    assert low <= abs(rho) <= high
    found = advise([("c", other, rho)])
    assert bool(found) == (abs(rho) >= 0.95)
    if determinable is None:  # at the limit: the reference has 0.998
        determinable = abs(rho) < 0.999
    assert all(a.determinable == determinable for a in found)
