"""A small block without any error, worked out here by rotations of scipy and a few lines of geometry.

Two strips of three images 400 m apart, strips 450 m apart, 600 m above hilly ground, all of them turned by some degrees
and by any kappa. It goes to the stages as a user's would: as a block folder, read by `block/tables`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from aatri.artifacts import solution as s
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.suspects import Suspects
from aatri.progress import Silent
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.interior_orientation.calibrated import calibrated

C_MM = 100.0
PRINCIPAL_POINT_MM = np.array([0.02, -0.01])
HEIGHT_M = 600.0
ANGLES_RAD = np.array(
    [
        [0.05, -0.03, 0.2],
        [-0.04, 0.06, -1.4],
        [0.02, 0.07, 3.0],
        [-0.06, -0.05, 1.7],
        [0.07, 0.01, -2.6],
        [0.01, -0.08, 0.9],
    ]
)
"""omega, phi, kappa."""


@dataclass(frozen=True)
class Hand:
    """The block as it is, and what is written of it.

    Attributes
    ----------
    position_m, rotation : (6, 3), (6, 3, 3) float64
        Of the images i0 ... i5: X0, and R from image to ground.
    xyz_m : (n, 3) float64
        Of the points p00 ...
    image, point, xy_mm : (m,), (m,), (m, 2)
        What the images see, from the principal point, in the order of the Block's rows.
    """

    position_m: Any
    rotation: Any
    xyz_m: Any
    image: Any
    point: Any
    xy_mm: Any
    camera: Mapping[str, Any] = field(default_factory=dict)

    @property
    def image_ids(self) -> list[str]:
        return [f"i{k}" for k in range(len(self.position_m))]

    @property
    def point_ids(self) -> list[str]:
        return [f"p{k:02}" for k in range(len(self.xyz_m))]


def hand(origin_m: Sequence[float] = (0.0, 0.0, 0.0), relief_m: float = 50.0) -> Hand:
    """The block, wherever its origin lies."""
    origin = np.array(origin_m)
    position = np.array([[400.0 * k, 450.0 * j, HEIGHT_M + 10.0 * k - 5.0 * j] for j in range(2) for k in range(3)])
    rotation = Rotation.from_euler("XYZ", ANGLES_RAD).as_matrix()
    east, north = (a.ravel() for a in np.meshgrid(np.linspace(-150, 950, 6), np.linspace(-250, 700, 5)))
    up = relief_m * np.sin(0.011 * east + 0.5) * np.cos(0.008 * north)
    xyz = np.stack([east, north, up], axis=1)
    image, point = (a.ravel() for a in np.indices((6, len(xyz))))
    xy = projected(position, rotation, xyz, image, point)
    seen = (np.abs(xy) < 115.0).all(axis=1)
    return Hand(position + origin, rotation, xyz + origin, image[seen], point[seen], xy[seen])


def projected(position: Any, rotation: Any, xyz: Any, image: Any, point: Any) -> Any:
    """x = -c u1/u3, y = -c u2/u3, u = R'(X - X0)."""
    return np.array(
        [-C_MM * u[:2] / u[2] for u in (rotation[i].T @ (xyz[p] - position[i]) for i, p in zip(image, point))]
    )


def angles_deg(of: Hand, system: str) -> Any:
    """a1, a2, a3 of R = Rx(omega) Ry(phi) Rz(kappa), or of R = Ry(-phi) Rx(omega) Rz(kappa)."""
    rotations = Rotation.from_matrix(of.rotation)
    if system == "omega-phi-kappa":
        return np.degrees(rotations.as_euler("XYZ"))
    minus_phi, omega, kappa = rotations.as_euler("YXZ", degrees=True).T
    return np.stack([-minus_phi, omega, kappa], axis=1)


def read(
    folder: Path,
    of: Hand,
    *,
    ground: str = "",
    exterior: str = "",
    rotation: str = "omega-phi-kappa",
    xy_mm: Any = None,
    camera: Mapping[str, Any] | None = None,
    more: Mapping[str, Any] | None = None,
) -> tuple[Block, ImagePoints]:
    """The block and its photo coordinates, with these ground points and exterior rows."""
    folder.mkdir(parents=True, exist_ok=True)
    about = {
        "aatri_block": 1,
        "name": "hand",
        "frames": {"map": {"axes": ["east", "north", "up"], "crs": "local"}},
        "earth_curvature": "ignore",
        "rotation": rotation,
        "units": {"ground": "m", "angle": "deg", "sigma_image": "um", "sigma_ground": "m", "sigma_angle": "deg"},
        "sigma": {
            "image": 5,
            "control": [0.02, 0.02, 0.03],
            "position": [0.1, 0.1, 0.1],
            "attitude": [0.01, 0.01, 0.02],
        },
        "cameras": {
            "c": {
                "kind": "film",
                "image_coordinates": "photo",
                "format": [230, 230],
                "principal_distance": C_MM,
                "principal_point": PRINCIPAL_POINT_MM.tolist(),
                "distortion": {"model": "none"},
                **(camera or {}),
            }
        },
        **(more or {}),
    }
    (folder / "block.yaml").write_text(yaml.safe_dump(about))
    rows = [f"{name},c,s{k // 3},{k % 3}" for k, name in enumerate(of.image_ids)]
    (folder / "images.csv").write_text("\n".join(["image,camera,strip,sequence", *rows]) + "\n")
    measured = (of.xy_mm if xy_mm is None else xy_mm) + PRINCIPAL_POINT_MM
    rows = [f"i{i},p{p:02},{x!r},{y!r}" for i, p, (x, y) in zip(of.image, of.point, measured.tolist())]
    (folder / "image_points.csv").write_text("\n".join(["image,point,x,y", *rows]) + "\n")
    (folder / "ground_points.csv").write_text(ground or "point,X,Y,Z\n")
    if exterior:
        (folder / "exterior.csv").write_text(exterior)
    block = tables(options=TablesOptions(path=folder))
    return block, calibrated(block)


def ground_rows(of: Hand, points: Sequence[int], tail: str = "", head: str = "", off: Any = 0.0) -> str:
    """ground_points.csv of these points; `tail` are the further cells of every row, `off` is added."""
    xyz = (of.xyz_m[list(points)] + off).tolist()
    rows = [f"p{p:02},{x!r},{y!r},{z!r}{tail}" for p, (x, y, z) in zip(points, xyz)]
    return "\n".join([f"point,X,Y,Z{head}", *rows]) + "\n"


def start(of: Hand, block: Block, suspects: Suspects | None = None, **changes: Any) -> s.Solution:
    """A solution to begin with: the block as it is, with changes of `position_m`, `rotation`, `xyz_m`."""
    of = replace(of, **changes)
    n, m = len(of.position_m), len(of.xyz_m)
    return s.Solution(
        method="hand/made",
        observations=0,
        unknowns=0,
        redundancy=0,
        sigma0=np.nan,
        sigma0_um=np.nan,
        iterations=0,
        images=s.ImageOrientations(
            id=block.images.id,
            oriented=np.isfinite(of.position_m).all(axis=1),
            position_m=of.position_m,
            ground_from_image=of.rotation,
            covariance=np.full((n, 6, 6), np.nan),
            image_points=np.zeros(n, int),
        ),
        points=s.SolvedPoints(
            id=block.points.id, xyz_m=of.xyz_m, covariance_m2=np.full((m, 3, 3), np.nan), rays=np.zeros(m, int)
        ),
        cameras=s.SolvedCameras(id=["c"], principal_distance_mm=[C_MM], principal_point_mm=[PRINCIPAL_POINT_MM]),
        transformations=s.StripTransformations.empty(),
        parameters=s.Parameters.empty(),
        residuals=s.Residuals.empty(),
        history=s.Iterations.empty(),
        suspects=Suspects.empty() if suspects is None else suspects,
    )


def suspected(kind: str, rows: Sequence[int], verdict: str = "rejected") -> Suspects:
    """Suspects of one kind, by row of their table."""
    n = len(rows)
    return Suspects(
        kind=[kind] * n,
        row=list(rows),
        image=[""] * n,
        point=[""] * n,
        stage=["earlier"] * n,
        size=np.full(n, 1.0),
        unit=["mm"] * n,
        sigma=np.full(n, 0.1),
        test=np.full(n, 10.0),
        verdict=[verdict] * n,
    )


class Heard(Silent):
    """Keeps what a stage says."""

    def __init__(self) -> None:
        self.logged: list[str] = []
        self.warned: list[str] = []

    def log(self, message: str) -> None:
        self.logged.append(message)

    def warn(self, message: str) -> None:
        self.warned.append(message)
