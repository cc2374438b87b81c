"""A made-up block of free strips: known ground points, known images, each strip in a frame of its own."""

from __future__ import annotations

import numpy as np

from aatri.artifacts import block as b
from aatri.artifacts import strips as s
from aatri.artifacts.block import CONTROL, NO_ROLE, Block
from aatri.artifacts.image_points import (
    Corrections,
    FiducialResiduals,
    ImageIds,
    ImagePoints,
    Interior,
    Measurements,
    PointIds,
)
from aatri.artifacts.suspects import Suspects
from aatri.geometry.rotations import exp_rotation

C_MM = 153.84
HEIGHT_M = 385.0
BASE_M = 220.0
SPACING_M = 390.0
ORIGIN_M = np.array([446000.0, 4504000.0, 20.0])


class MadeBlock:
    """Strips along X, images every `BASE_M`; ground points on a grid that neighbouring strips share."""

    def __init__(
        self, n_strips: int = 2, n_images=6, *, seed: int = 1, deformation=None, noise_m: float = 0.0, gap_m=0.0
    ) -> None:
        rng = np.random.default_rng(seed)
        self.truth_R, self.truth_X0, self.image_strip = [], [], []
        for strip in range(n_strips):
            for k in range(n_images):
                self.image_strip.append(strip)
                self.truth_X0.append(rng.normal([BASE_M * k, (SPACING_M + gap_m) * strip, HEIGHT_M], 3))
                self.truth_R.append(exp_rotation(rng.normal(0, 0.01, 3)))
        self.truth_X0, self.truth_R = np.array(self.truth_X0) + ORIGIN_M, np.array(self.truth_R)
        self.image_strip = np.array(self.image_strip)
        x = np.arange(0, BASE_M * (n_images - 1) + 1, BASE_M / 2)
        y = np.add.outer((SPACING_M + gap_m) * np.arange(n_strips), [-180.0, 0.0, 180.0, 205.0]).ravel()
        grid = np.stack(np.meshgrid(x, np.unique(y), indexing="ij"), -1).reshape(-1, 2)
        self.truth = np.column_stack([grid, np.zeros(len(grid))]) + rng.normal(0, [4, 4, 15], (len(grid), 3)) + ORIGIN_M
        self.frames = [
            (rng.normal(0, 3, 3), float(rng.uniform(0.8, 1.2)) / BASE_M, exp_rotation(rng.normal(0, 0.5, 3)))
            for _ in range(n_strips)
        ]
        self._measure()
        self._strips(rng, deformation, noise_m)
        self.given = {}
        self.sigma = {}
        self.observed_positions = {}

    def _measure(self) -> None:
        rows = []
        for i, (X0, R) in enumerate(zip(self.truth_X0, self.truth_R)):
            u = (self.truth - X0) @ R
            xy = -C_MM * u[:, :2] / u[:, 2:]
            rows += [(i, p, *xy[p]) for p in np.flatnonzero((abs(xy) < 110).all(1))]
        self.rows = np.array(rows)

    def _strips(self, rng: np.random.Generator, deformation, noise_m: float) -> None:
        self.strip_points = []
        image, point = self.rows[:, 0].astype(int), self.rows[:, 1].astype(int)
        for strip, frame in enumerate(self.frames):
            mine = np.bincount(point[self.image_strip[image] == strip], minlength=len(self.truth)) > 1
            for p in np.flatnonzero(mine):
                X = self.truth[p] + (deformation(strip, self.truth[p] - ORIGIN_M) if deformation else 0.0)
                X = X + (rng.normal(0, noise_m, 3) if noise_m else 0.0)
                self.strip_points.append((strip, p, self._into(frame, X)))

    def _into(self, frame, X):
        t, scale, R = frame
        return t + scale * R @ (X - self.truth_X0[0])

    def control(self, points, roles=(1, 1, 1), sigma_m: float = 0.0, error_m=(0, 0, 0)):
        """Make points control."""
        for p in points:
            self.given[p] = (np.array(roles), self.truth[p] + error_m, sigma_m)
        return self

    def corners(self):
        """The four points nearest to the corners of the block."""
        low, high = self.truth[:, :2].min(0), self.truth[:, :2].max(0)
        at = [(low[0], low[1]), (low[0], high[1]), (high[0], low[1]), (high[0], high[1])]
        return [int(np.argmin(np.linalg.norm(self.truth[:, :2] - c, axis=1))) for c in at]

    def positions(self, images, sigma_m: float = 0.1, error_m=None, lever_arm_m=(0, 0, 0)):
        """Observe positions of images, of the antenna if there is a lever arm."""
        self.lever_arm_m = np.array(lever_arm_m, dtype=float)
        for i in images:
            error = np.zeros(3) if error_m is None else error_m[i]
            self.observed_positions[i] = (self.truth_X0[i] + self.truth_R[i] @ self.lever_arm_m + error, sigma_m)
        return self

    def block(self):
        n_images, n_points = len(self.truth_X0), len(self.truth)
        tables = {f: cls.empty() for f, cls in _tables().items()}
        tables["cameras"] = b.Cameras(
            id=["rc30"],
            kind=["film"],
            image_coordinates=["photo"],
            pixel_size_mm=[[np.nan] * 2],
            pixel_origin=[""],
            pixel_y=[""],
            format=[[230.0, 230.0]],
            principal_distance_mm=[C_MM],
            principal_point_mm=[[0.0, 0.0]],
            symmetry_point_mm=[[0.0, 0.0]],
            distortion=["none"],
            lever_arm_m=[getattr(self, "lever_arm_m", np.zeros(3))],
            boresight_rad=[[0.0] * 3],
            mount_deg=[0],
        )
        tables["strips"] = b.StripIds(id=[str(k + 1) for k in range(len(self.frames))])
        text = [""] * n_images
        tables["images"] = b.Images.of(
            id=[f"{i:03d}" for i in range(n_images)],
            camera=np.zeros(n_images, np.int32),
            strip=self.image_strip,
            sequence=np.arange(n_images, dtype=float),
            time_s=np.full(n_images, np.nan),
            flight=text,
            session=text,
            rig=text,
            member=text,
            active=np.ones(n_images, bool),
            file=np.full(n_images, -1),
            line=np.full(n_images, -1),
        )
        tables["points"] = b.Points(id=[f"p{k:03d}" for k in range(n_points)])
        points = sorted(self.given)
        if points:
            tables["ground_points"] = b.GroundPoints(
                point=points,
                xyz_m=[np.where(self.given[p][0] == 1, self.given[p][1], np.nan) for p in points],
                covariance_m2=[np.eye(3) * self.given[p][2] ** 2 for p in points],
                role=[np.where(self.given[p][0] == 1, CONTROL, NO_ROLE) for p in points],
                datum=np.ones(len(points), bool),
                file=np.full(len(points), -1),
                line=np.full(len(points), -1),
            )
        images = sorted(self.observed_positions)
        if images:
            n = len(images)
            tables["exterior"] = b.Exterior(
                image=images,
                position_m=[self.observed_positions[i][0] for i in images],
                position_covariance_m2=[np.eye(3) * self.observed_positions[i][1] ** 2 for i in images],
                angles_rad=np.full((n, 3), np.nan),
                angle_sigma_rad=np.full((n, 3), np.nan),
                position_use=np.ones(n, np.int32),
                angle_use=np.zeros(n, np.int32),
                refers_to=np.full(n, int(self.lever_arm_m.any())),
                drift_group=[""] * n,
                file=np.full(n, -1),
                line=np.full(n, -1),
            )
        return Block(
            name="made",
            rotation="omega-phi-kappa",
            earth_curvature="ignore",
            terrain_height_m=0.0,
            undulation_m=np.nan,
            heading="true",
            **tables,
        )

    def image_points(self):
        block, m = self.block(), len(self.rows)
        return ImagePoints(
            images=ImageIds(id=block.images.id),
            points=PointIds(id=block.points.id),
            measurements=Measurements(
                image=self.rows[:, 0].astype(int),
                point=self.rows[:, 1].astype(int),
                xy_mm=self.rows[:, 2:],
                sigma_mm=np.full((m, 2), 0.005),
                active=np.ones(m, bool),
            ),
            interior=Interior.empty(),
            fiducial_residuals=FiducialResiduals.empty(),
            corrections=Corrections.empty(),
            suspects=Suspects.empty(),
        )

    def strips(self, sigma_m: float = 0.015):
        block = self.block()
        strip = np.array([row[0] for row in self.strip_points])
        scale = np.array([self.frames[k][1] for k in strip])
        shape = np.diag([1.0, 1.0, 3.0]) * sigma_m**2
        turned = np.array([self.frames[k][2] @ shape @ self.frames[k][2].T for k in strip])
        return s.Strips(
            images=ImageIds(id=block.images.id),
            points=PointIds(id=block.points.id),
            strips=s.FreeStrips(id=block.strips.id),
            strip_images=s.StripImages(
                strip=self.image_strip,
                image=np.arange(len(self.truth_X0)),
                position=[self._into(self.frames[k], X) for k, X in zip(self.image_strip, self.truth_X0)],
                strip_from_image=[self.frames[k][2] @ R for k, R in zip(self.image_strip, self.truth_R)],
            ),
            strip_points=s.StripPoints(
                strip=strip,
                point=[row[1] for row in self.strip_points],
                xyz=[row[2] for row in self.strip_points],
                covariance=scale[:, None, None] ** 2 * turned,
                models=np.ones(len(strip), np.int32),
            ),
            joints=s.Joints.empty(),
            discrepancies=s.Discrepancies.empty(),
            gaps=s.Gaps.empty(),
            suspects=Suspects.empty(),
        )


def _tables():
    from aatri.tables.schema import may_be_absent, tables_of

    return {name: cls for name, cls in tables_of(Block).items() if not may_be_absent(Block, name)}


class Heard:
    """A reporter that keeps what it is told."""

    def __init__(self) -> None:
        self.warnings, self.lines = [], []

    def log(self, message: str) -> None:
        self.lines.append(message)

    def warn(self, message: str) -> None:
        self.warnings.append(message)

    def progress(self, done, total, what="") -> None:
        pass
