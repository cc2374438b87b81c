"""Strips of images over relief, photographed by plain collinearity, as Block and ImagePoints."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from aatri.artifacts import block as b
from aatri.artifacts import image_points as ip
from aatri.artifacts.suspects import Suspects
from tests.made_solutions import made_block

C_MM = 150.0
HALF_FORMAT_MM = 112.0
BASE_M = 220.0
HEIGHT_M = 400.0


@dataclasses.dataclass(frozen=True)
class Made:
    """Block, image points and the truth."""

    block: b.Block
    image_points: ip.ImagePoints
    X0: Any
    R: Any
    ground: Any

    def row(self, image: int, point: int) -> int:
        """Row of a measurement."""
        m = self.image_points.measurements
        return int(np.flatnonzero((m.image == image) & (m.point == point))[0])

    def moved(self, rows: Any, by_mm: Any) -> Made:
        """With errors added to measurements."""
        xy = self.image_points.measurements.xy_mm.copy()
        xy[rows] += by_mm
        return self.measured(xy_mm=xy)

    def measured(self, **changes: Any) -> Made:
        """With columns of the measurements replaced."""
        measurements = dataclasses.replace(self.image_points.measurements, **changes)
        return dataclasses.replace(self, image_points=dataclasses.replace(self.image_points, measurements=measurements))


def made_strips(n_images: int = 5, n_strips: int = 1, *, noise_mm: float = 0.0, seed: int = 1, **changes: Any) -> Made:
    """Strips flown to and fro with tilts of 2 degrees, uneven bases and heights; 3 x 3 points around each nadir."""
    rng = np.random.default_rng(seed)
    X0, R, ground = _flight(rng, n_images, n_strips)
    image, point, xy = _photographed(X0, R, ground)
    xy = xy + noise_mm * rng.normal(size=xy.shape)
    n, m = len(X0), len(image)
    base = made_block()
    text = np.full(n, "")
    images = {
        "id": [f"{k // n_images + 1}-{k % n_images:02d}" for k in range(n)],
        "camera": np.zeros(n, int),
        "strip": np.arange(n) // n_images,
        "sequence": 10.0 * (np.arange(n) % n_images),
        "time_s": np.full(n, np.nan),
        "flight": text,
        "session": text,
        "rig": text,
        "member": text,
        "active": np.ones(n, bool),
        "file": np.full(n, -1),
        "line": np.zeros(n, int),
    }
    points = [f"p{k:04d}" for k in range(len(ground))]
    block = dataclasses.replace(
        base,
        images=b.Images.of(**(images | changes)),
        strips=b.StripIds(id=[str(k + 1) for k in range(n_strips)]),
        points=b.Points(id=points),
        ground_points=b.GroundPoints.empty(),
        true_images=None,
        true_points=None,
        image_points=b.MeasuredPoints(
            image=image,
            point=point,
            xy=xy,
            sigma_mm=np.full((m, 2), 0.005),
            group=np.full(m, ""),
            active=np.ones(m, bool),
            row_time_s=np.full(m, np.nan),
            file=np.full(m, -1),
            line=np.zeros(m, int),
        ),
    )
    image_points = ip.ImagePoints(
        images=ip.ImageIds(id=block.images.id),
        points=ip.PointIds(id=points),
        measurements=ip.Measurements(
            image=image, point=point, xy_mm=xy, sigma_mm=np.full((m, 2), 0.005), active=np.ones(m, bool)
        ),
        interior=ip.Interior.empty(),
        fiducial_residuals=ip.FiducialResiduals.empty(),
        corrections=ip.Corrections.empty(),
        suspects=Suspects.empty(),
    )
    return Made(block, image_points, X0, R, ground)


def _flight(rng: Any, n_images: int, n_strips: int) -> tuple[Any, Any, Any]:
    X0, R, ground = [], [], []
    for strip in range(n_strips):
        back = strip % 2
        along = BASE_M * np.arange(n_images)[:: -1 if back else 1] + rng.normal(0, 8, n_images)
        side = 500.0 * strip + rng.normal(0, 8, n_images)
        X0 += list(np.column_stack([along, side, HEIGHT_M + rng.normal(0, 8, n_images)]))
        turn = Rotation.from_euler("z", np.pi * back)
        R += [(Rotation.from_rotvec(rng.normal(0, 0.03, 3)) * turn).as_matrix() for _ in range(n_images)]
        x = np.repeat(BASE_M * np.arange(n_images), 9)
        y = np.tile(np.repeat([-220.0, 0.0, 220.0], 3), n_images) + 500.0 * strip
        ground += list(np.column_stack([x, y, np.zeros_like(x)]) + rng.uniform(-20, 20, (len(x), 3)))
    return np.array(X0), np.array(R), np.array(ground)


def _photographed(X0: Any, R: Any, ground: Any) -> tuple[Any, Any, Any]:
    image, point, xy = [], [], []
    for k in range(len(X0)):
        u = (ground - X0[k]) @ R[k]
        at = -C_MM * u[:, :2] / u[:, 2:]
        seen = np.flatnonzero((np.abs(at) < HALF_FORMAT_MM).all(axis=1))
        image.append(np.full(len(seen), k))
        point.append(seen)
        xy.append(at[seen])
    return np.concatenate(image), np.concatenate(point), np.concatenate(xy)
