"""A project of OpenSfM whose image points are computed by OpenSfM's own formulas, written out here once more."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

LATITUDE, LONGITUDE, HEIGHT = 47.0, 8.0, 400.0
WIDTH, HEIGHT_PX = 4000, 3000
CAMERAS: dict[str, dict[str, Any]] = {
    "perspective": {"focal": 0.85, "k1": -0.05, "k2": 0.01},
    "brown": {
        "focal_x": 0.85,
        "focal_y": 0.86,
        "c_x": 0.01,
        "c_y": -0.02,
        "k1": -0.05,
        "k2": 0.01,
        "k3": 0.001,
        "p1": 1e-3,
        "p2": -2e-3,
    },
    "fisheye": {"focal": 0.6, "k1": 0.02, "k2": -0.01},
}


def _normalised(kind: str, P: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Points in the camera's axes as OpenSfM projects them."""
    c = CAMERAS[kind]
    x, y = P[:, 0] / P[:, 2], P[:, 1] / P[:, 2]
    r2 = x * x + y * y
    if kind == "perspective":
        d = 1 + r2 * (c["k1"] + r2 * c["k2"])
        return c["focal"] * np.stack([d * x, d * y], axis=1)
    if kind == "fisheye":
        r = np.hypot(P[:, 0], P[:, 1])
        theta = np.arctan2(r, P[:, 2])
        d = theta * (1 + theta**2 * (c["k1"] + theta**2 * c["k2"]))
        return c["focal"] * (d / r)[:, None] * P[:, :2]
    d = 1 + r2 * (c["k1"] + r2 * (c["k2"] + r2 * c["k3"]))
    xd = x * d + 2 * c["p1"] * x * y + c["p2"] * (r2 + 2 * x * x)
    yd = y * d + 2 * c["p2"] * x * y + c["p1"] * (r2 + 2 * y * y)
    return np.stack([c["focal_x"] * xd + c["c_x"], c["focal_y"] * yd + c["c_y"]], axis=1)


def write_project(folder: Path, kind: str = "brown") -> Path:
    """reconstruction.json and tracks.csv: 2 x 3 images, nearly vertical, over 24 points."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(1)
    points = np.array([[20.0 * i, 20.0 * j, rng.uniform(-3, 3)] for i in range(6) for j in range(4)])
    down = np.diag([1.0, -1.0, -1.0])
    shots, lines = {}, ["OPENSFM_TRACKS_VERSION_v2"]
    for k in range(6):
        R = down @ Rotation.from_rotvec(rng.normal(scale=0.05, size=3)).as_matrix()
        X0 = np.array([25.0 * (k % 3) + 20, 30.0 * (k // 3) + 15, 90.0])
        name = f"IMG_{k}.JPG"
        shots[name] = {
            "camera": "c",
            "rotation": Rotation.from_matrix(R).as_rotvec().tolist(),
            "translation": (-R @ X0).tolist(),
            "capture_time": 100.0 + k,
        }
        xy = _normalised(kind, (points - X0) @ R.T)
        for j, (x, y) in enumerate(xy.tolist()):
            if abs(x) < 0.5 and abs(y) < 0.5 * HEIGHT_PX / WIDTH:
                lines.append(f"{name}\t{j}\t{j}\t{x!r}\t{y!r}\t0.001\t1\t2\t3\t-1\t-1")
    camera = {"projection_type": kind, "width": WIDTH, "height": HEIGHT_PX, **CAMERAS[kind]}
    reconstruction = {
        "cameras": {"c": camera},
        "shots": shots,
        "points": {str(j): {"coordinates": p, "color": [0, 0, 0]} for j, p in enumerate(points.tolist())},
        "reference_lla": {"latitude": LATITUDE, "longitude": LONGITUDE, "altitude": HEIGHT},
    }
    (folder / "reconstruction.json").write_text(json.dumps([reconstruction], indent=1))
    (folder / "tracks.csv").write_text("\n".join(lines) + "\n")
    return folder
