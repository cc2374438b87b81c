"""DBAT's camera calibration (camcal, model 3), adjusted densely here: every printed digit of its report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.camera.models.projection import pinhole
from aatri.geometry.collinearity import in_image_axes
from aatri.geometry.rotations import exp_rotation, rotation_from_angles, skew
from tests.camera.models.dbat_reference import dbat3, printed_principal_point

CONTROL = {1001: (0.0, 1.0, 0.0), 1002: (1.0, 1.0, 0.0), 1003: (0.0, 0.0, 0.0), 1004: (1.0, 0.0, 0.0)}
PIXEL_MM = 5.43764 / 1704

# camcal-dbatreport-model3.txt
PRINTED = {
    "c": ("7.457", "0.00105"),
    "as": ("0.000389598", "2.08e-05"),
    "px": ("3.61546", "0.00082"),
    "py": ("2.61329", "0.00098"),
    "K1": ("0.00458861", "2.21e-05"),
    "K2": ("-4.51351e-05", "2.65e-06"),
    "K3": ("-2.05253e-06", "1.01e-07"),
    "P1": ("-6.12803e-05", "3.52e-06"),
    "P2": ("-4.41172e-05", "3.94e-06"),
}


def _same_digits(value: float, printed: str) -> bool:
    digits = len(printed.lstrip("-").split("e")[0].replace(".", "").lstrip("0"))
    return float(f"{value:.{digits - 1}e}") == float(printed)


def _read(path: Path) -> tuple[Any, ...]:
    lines = [line.split() for line in path.read_text().splitlines()]
    X0, R, k = [], [], 5
    while len(lines[k]) == 2:
        x, y, z, kappa, phi, omega = map(float, lines[k + 1][1:])
        X0.append([x, y, z])
        R.append(rotation_from_angles(np.deg2rad([omega, phi, kappa])))
        k += 6
    points = {int(row[0]): [float(v) for v in row[1:4]] for row in lines[k:] if len(row) == 7}
    points |= CONTROL
    ids = sorted(points)
    marks = [row for row in lines[k:] if len(row) == 6 and "." in row[2]]
    image = np.array([int(row[0]) for row in marks])
    point = np.array([ids.index(int(row[1])) for row in marks])
    uv = np.array([[float(v) for v in row[2:4]] for row in marks])
    free = np.array([i not in CONTROL for i in ids])
    return np.array(X0), np.array(R), np.array([points[i] for i in ids]), free, image, point, uv


def test_calibration_report(shared_data: Path) -> None:
    X0, R, X, free, image, point, uv = _read(shared_data / "dbat/camcal/camcal-pmexport.txt")
    c, lens = 7.4653, np.array([0, 3.6173, 2.6128, 0.00498, -1e-4, 0, -6e-5, -4e-5])
    m, poses = len(uv), 6 * len(X0)
    row, column = np.arange(m), np.cumsum(free) - 1
    unknowns = 9 + poses + 3 * int(free.sum())
    assert (2 * m, unknowns) == (4148, 423)
    to_free = free[point]
    for _ in range(4):
        xy, by_u, by_c = pinhole(in_image_axes(X0[image], R[image], X[point]), np.array([c, 0.0, 0.0]))
        corrected, by_lens = dbat3(uv, lens, PIXEL_MM)
        by_point = np.einsum("nij,nkj->nik", by_u, R[image])
        by_pose = np.concatenate([-by_point, by_point @ skew(X[point] - X0[image])], axis=2)
        J = np.zeros((m, 2, unknowns))
        J[:, :, 0], J[:, :, 1:9] = by_c[:, :, 0], -by_lens
        for k in range(6):
            J[row, :, 9 + 6 * image + k] = by_pose[:, :, k]
        for k in range(3):
            J[row[to_free], :, 9 + poses + 3 * column[point[to_free]] + k] = by_point[to_free, :, k]
        v, A = ((xy - corrected) / (0.1 * PIXEL_MM)).ravel(), J.reshape(2 * m, unknowns) / (0.1 * PIXEL_MM)
        scale = np.linalg.norm(A, axis=0)
        inverse = np.linalg.inv((A / scale).T @ (A / scale)) / np.outer(scale, scale)
        step = -inverse @ (A.T @ v)
        c, lens = c + step[0], lens + step[1:9]
        pose = step[9 : 9 + poses].reshape(-1, 6)
        X0, R = X0 + pose[:, :3], exp_rotation(pose[:, 3:]) @ R
        X[free] += step[9 + poses :].reshape(-1, 3)
    sigma0 = np.sqrt(v @ v / (2 * m - unknowns))
    assert _same_digits(sigma0, "1.6148")
    sigma = dict(zip(PRINTED, sigma0 * np.sqrt(np.diag(inverse)[:9])))
    value = dict(zip(PRINTED, [c, *lens]))
    value["px"], by_aspect_px = printed_principal_point(lens[0], lens[1])
    sigma["px"] = sigma0 * np.sqrt(by_aspect_px @ inverse[1:3, 1:3] @ by_aspect_px)
    for name, (printed, printed_sigma) in PRINTED.items():
        assert _same_digits(value[name], printed), name
        assert _same_digits(sigma[name], printed_sigma), name
    assert inverse[5, 6] / np.sqrt(inverse[5, 5] * inverse[6, 6]) == pytest.approx(-0.979, abs=5e-4)
