"""Relative orientation without start beside OpenCV's and PoseLib's five-point RANSAC, on the same pairs in one run.

Pairs are those of `tests/campaigns/essential.py`: base over depth 0.1 to 1, 20 to 100 points, 0.5 px, a share of wrong
points. All take one thread and end with the same confidence (OpenCV 0.99999, PoseLib 0.99999) and threshold, 3 sigma of
the image coordinates. Times are those of a pair; errors are the larger of rotation and base, degrees. What cannot be
imported is left out by name.

    python benchmarks/essential_against_peers.py [pairs] [outliers, percent]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from scipy.spatial.transform import Rotation

from tests.campaigns.essential import C_MM, PIXEL_MM, SIGMA_MM, Trial, rays_of, trial

FOCAL = C_MM / PIXEL_MM
CENTRE = np.array([2736.0, 1824.0])
CONFIDENCE, THRESHOLD_PX = 0.99999, 3.0 * SIGMA_MM / PIXEL_MM
FLIP = np.diag([1.0, -1.0, -1.0])  # their cameras look along +z, y down

Method = Callable[[Any, Any], tuple[Any, Any]]
"""Pixels left and right -> rotation and base as here."""


def pixels(xy_mm: Any) -> Any:
    """Columns and rows."""
    return xy_mm * [1.0, -1.0] / PIXEL_MM + CENTRE


def opencv() -> Method:
    import cv2

    cv2.setNumThreads(1)
    K = np.array([[FOCAL, 0, CENTRE[0]], [0, FOCAL, CENTRE[1]], [0, 0, 1]])

    def orient(left: Any, right: Any) -> tuple[Any, Any]:
        E, mask = cv2.findEssentialMat(left, right, K, cv2.RANSAC, CONFIDENCE, THRESHOLD_PX)
        if E is None:
            return np.eye(3), np.array([1.0, 0, 0])
        _, R, t, _ = cv2.recoverPose(E[:3], left, right, K, mask=mask)
        return FLIP @ R.T @ FLIP, FLIP @ (-R.T @ t[:, 0])

    return orient


def poselib() -> Method:
    import poselib as lib

    camera = {"model": "PINHOLE", "width": 5472, "height": 3648, "params": [FOCAL, FOCAL, *CENTRE]}
    options = {"max_epipolar_error": THRESHOLD_PX, "success_prob": CONFIDENCE}

    def orient(left: Any, right: Any) -> tuple[Any, Any]:
        pose, _ = lib.estimate_relative_pose(left, right, camera, camera, options)
        t = np.asarray(pose.t)
        return FLIP @ pose.R.T @ FLIP, FLIP @ (-pose.R.T @ t / np.linalg.norm(t))

    return orient


def off(t: Trial, R: Any, b: Any) -> float:
    """Larger error of rotation and base, degrees."""
    turned = Rotation.from_matrix(R @ t.rotation.T).magnitude()
    return float(np.degrees(max(turned, 2 * np.arcsin(min(0.5 * np.linalg.norm(b - t.base), 1.0)))))


def ours(trials: list[Trial]) -> tuple[float, list[float]]:
    """Time a pair in ms, errors."""
    from aatri.adjustment import threads
    from aatri.orientation.relative.essential import essential_orientations

    threads.default_threads = lambda: 1
    rays, start = rays_of(trials)
    essential_orientations(*rays_of(trials[:2]))
    began = time.perf_counter()
    found = essential_orientations(rays, start).orientations
    spent = time.perf_counter() - began
    return 1e3 * spent / len(trials), [
        off(t, found.left_from_right[k], found.base[k]) if found.formed[k] else 180.0 for k, t in enumerate(trials)
    ]


def main() -> None:
    """Run, and print a table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    share = float(sys.argv[2]) / 100 if len(sys.argv) > 2 else 0.3
    rng = np.random.default_rng(1)
    trials = [trial(rng, noise=1.0, outliers=share) for _ in range(count)]
    rows = []
    for name, make in (("OpenCV", opencv), ("PoseLib", poselib)):
        try:
            orient = make()
        except ImportError as error:
            sys.stdout.write(f"left out: {error}\n")
            continue
        given = [(pixels(t.left), pixels(t.right)) for t in trials]
        began = time.perf_counter()
        found = [orient(*pair) for pair in given]
        spent = time.perf_counter() - began
        rows.append((name, 1e3 * spent / count, [off(t, *pose) for t, pose in zip(trials, found)]))
    rows.append(("aatri, adjusted and tested", *ours(trials)))
    sys.stdout.write(
        f"{count} pairs, {share:.0%} wrong points\n{'':28}{'ms':>8}{'median':>10}{'95 %':>10}{'> 2 deg':>9}\n"
    )
    for name, ms, errors in rows:
        median, high = np.quantile(errors, [0.5, 0.95])
        sys.stdout.write(f"{name:28}{ms:8.2f}{median:10.4f}{high:10.4f}{sum(e > 2 for e in errors):9d}\n")


if __name__ == "__main__":
    main()
