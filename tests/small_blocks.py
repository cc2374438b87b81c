"""Small legal blocks of any kind, made up here by a few lines of geometry, and taken through whole chains of stages.

Images look down, or tilted towards a common place, at hilly ground; a block is changed (images, points, rays, control,
positions, distances taken away or added) before it is written as a block folder, as a user's would be.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.geometry.similarity import closed_form, transform
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.initial_orientation.graph import GraphOptions, graph
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.film_blocks import Told

C_MM, HALF_MM, HEIGHT_M, BASE_M = 100.0, 75.0, 500.0, 300.0
SIGMA_MM = 0.003


@dataclass
class Small:
    """A block to be: what is there, what of it is known.

    Attributes
    ----------
    position_m, rotation : dict of str to array
        Of the images: X0, and R from image to ground.
    strip : dict of str to (str, int)
        Strip and sequence.
    xyz_m : dict of str to array
        Of the points.
    rays : dict of (str, str) to (2,) array, mm
        What images see of points.
    control : dict of str to str
        Axes of points that are control: XYZ, XY, Z ...
    observed : dict of str to str
        Axes of the positions that are observed.
    attitudes : list of str
        Images with observed angles.
    geodetic, relative : list
        Rows of geodetic.csv and entries of relative_control.yaml.
    """

    position_m: dict[str, Any]
    rotation: dict[str, Any]
    strip: dict[str, tuple[str, int]]
    xyz_m: dict[str, Any]
    rays: dict[tuple[str, str], Any] = field(default_factory=dict)
    control: dict[str, str] = field(default_factory=dict)
    observed: dict[str, str] = field(default_factory=dict)
    attitudes: list[str] = field(default_factory=list)
    geodetic: list[str] = field(default_factory=list)
    relative: list[dict[str, Any]] = field(default_factory=list)
    camera: dict[str, Any] = field(default_factory=dict)
    more_cameras: dict[str, Any] = field(default_factory=dict)
    camera_of: dict[str, str] = field(default_factory=dict)
    noise: float = 1.0

    def seen_by(self, image: str) -> list[str]:
        return [point for one, point in self.rays if one == image]

    def without_rays(self, *images: str, keep: int = 0) -> None:
        """Images lose all rays but the first `keep`."""
        for image in images:
            for point in self.seen_by(image)[keep:]:
                del self.rays[image, point]

    def write(self, folder: Path) -> Path:
        """The block folder."""
        folder.mkdir(parents=True)
        head = {
            "aatri_block": 1,
            "name": "small",
            "frames": {"map": {"axes": ["east", "north", "up"], "crs": "local"}},
            "earth_curvature": "ignore",
            "terrain_height": 20.0,
            "rotation": "omega-phi-kappa",
            "units": {
                "ground": "m",
                "angle": "deg",
                "sigma_image": "um",
                "sigma_ground": "m",
                "sigma_angle": "deg",
                "time": "s",
            },
            "sigma": {"image": 1e3 * SIGMA_MM, "control": [0.02] * 3, "position": [0.05] * 3, "attitude": [0.005] * 3},
            "cameras": {
                "a": {
                    "kind": "digital",
                    "image_coordinates": "photo",
                    "principal_distance": C_MM,
                    "principal_point": [0.0, 0.0],
                    "format": [30000, 30000],
                    "pixel": {"size": 0.005},
                    **self.camera,
                },
                **self.more_cameras,
            },
        }
        errors = np.random.default_rng(1).normal(0, self.noise, (1000, 6))
        angles_deg = dict(zip(self.strip, errors[500:, 3:] * 0.005))
        places_m = dict(zip(self.strip, errors[500:, :3] * 0.05))
        write = {
            "images.csv": [
                "image,camera,strip,sequence",
                *(f"{i},{self.camera_of.get(i, 'a')},{s},{k}" for i, (s, k) in self.strip.items()),
            ],
            "image_points.csv": [
                "image,point,x,y",
                *(f"{i},{p},{x!r},{y!r}" for (i, p), (x, y) in ((key, xy.tolist()) for key, xy in self.rays.items())),
            ],
            "ground_points.csv": [
                "point,X,Y,Z",
                *(
                    f"{p}," + _cells(self.xyz_m[p] + 0.02 * off[:3], axes)
                    for (p, axes), off in zip(self.control.items(), errors)
                ),
            ],
            "exterior.csv": [
                "image,X,Y,Z,sX,sY,sZ,a1,a2,a3,s1,s2,s3",
                *(self._exterior(i, places_m[i], angles_deg[i]) for i in self.strip),
            ],
            "geodetic.csv": ["type,from,to,value,sigma,via,from_kind,to_kind,set", *self.geodetic],
        }
        (folder / "block.yaml").write_text(yaml.safe_dump(head, sort_keys=False))
        for name, lines in write.items():
            lines = [line for line in lines if line]
            if len(lines) > 1:
                (folder / name).write_text("\n".join([*lines, ""]))
        if self.relative:
            (folder / "relative_control.yaml").write_text(yaml.safe_dump(self.relative))
        return folder

    def _exterior(self, image: str, off_m: Any, off_deg: Any) -> str:
        axes = self.observed.get(image, "")
        if not axes and image not in self.attitudes:
            return ""
        angles = [""] * 6
        if image in self.attitudes:
            angles = [*map(repr, (omega_phi_kappa_deg(self.rotation[image]) + off_deg).tolist()), *["0.005"] * 3]
        sigmas = ",".join("0.05" if axis in axes else "" for axis in "XYZ")
        return f"{image},{_cells(self.position_m[image] + off_m, axes)},{sigmas},{','.join(angles)}"


def _cells(xyz: Any, axes: str) -> str:
    return ",".join(repr(float(value)) if axis in axes else "" for axis, value in zip("XYZ", xyz))


def omega_phi_kappa_deg(R: Any) -> Any:
    """R = R1(omega) R2(phi) R3(kappa): intrinsic turns about x, y, z."""
    return Rotation.from_matrix(R).as_euler("XYZ", degrees=True)


def flown(
    strips: int = 1,
    per_strip: int = 3,
    *,
    tilt_deg: float = 0.0,
    seed: int = 1,
    points: int = 14,
    apart_m: float = 450.0,
    noise: float = 1.0,
    relief_m: float = 60.0,
) -> Small:
    """Strips of images over hilly ground, with control at the corners and positions of all images; one camera tilted.

    Parameters
    ----------
    points : int
        New points per image, about.
    """
    rng = np.random.default_rng(seed)
    position, rotation, strip = {}, {}, {}
    away = HEIGHT_M * np.tan(np.radians(tilt_deg))
    for s in range(strips):
        for k in range(per_strip):
            name = f"{s + 1}{k + 1:02d}"
            strip[name] = f"S{s + 1}", k + 1
            position[name] = np.array([BASE_M * k, apart_m * s - away, HEIGHT_M]) + rng.normal(0, 8.0, 3)
            wobble = np.radians(rng.normal(0, 1.5, 3))
            # tilted: the view goes forward along Y
            rotation[name] = Rotation.from_euler("XYZ", np.array([np.radians(tilt_deg), 0, 0]) + wobble).as_matrix()
    low = np.array([-0.5 * BASE_M, -0.5 * apart_m])
    high = np.array([BASE_M * (per_strip - 0.5), apart_m * (strips - 0.5)])
    n = points * strips * per_strip
    corner = np.array([[a, b] for a in (low[0], high[0]) for b in (low[1], high[1])]) * 0.7
    corner += 0.3 * (low + high) / 2
    xy = np.concatenate([corner, rng.uniform(low, high, (n, 2))])
    z = 20.0 + relief_m * np.sin(xy[:, 0] / 170.0) * np.cos(xy[:, 1] / 210.0) + rng.uniform(-10, 10, len(xy))
    ids = [f"C{k + 1}" if k < len(corner) else f"p{k}" for k in range(len(xy))]
    made = Small(position, rotation, strip, dict(zip(ids, np.column_stack([xy, z]))), noise=noise)
    measure(made, rng, noise)
    made.control = {f"C{k + 1}": "XYZ" for k in range(len(corner))}
    made.observed = dict.fromkeys(position, "XYZ")
    return made


def measure(small: Small, rng: np.random.Generator, noise: float = 1.0) -> None:
    """All that images see of the points, with noise: x = -c u1 / u3, y = -c u2 / u3, u = R'(X - X0)."""
    small.rays = {}
    for i in small.position_m:
        for p, X in small.xyz_m.items():
            u = small.rotation[i].T @ (X - small.position_m[i])
            xy = -C_MM * u[:2] / u[2]
            if u[2] < 0 and np.abs(xy).max() < HALF_MM:
                small.rays[i, p] = xy + noise * rng.normal(0, SIGMA_MM, 2)


def two_apart(**options: Any) -> Small:
    """Two blocks far from each other in one folder."""
    a, b = flown(**options, seed=1), flown(**options, seed=2)
    far = np.array([20_000.0, 0.0, 0.0])
    name = "B{}".format
    return Small(
        a.position_m | {name(i): x + far for i, x in b.position_m.items()},
        a.rotation | {name(i): R for i, R in b.rotation.items()},
        a.strip | {name(i): (name(s), k) for i, (s, k) in b.strip.items()},
        a.xyz_m | {name(p): x + far for p, x in b.xyz_m.items()},
        a.rays | {(name(i), name(p)): xy for (i, p), xy in b.rays.items()},
        a.control | {name(p): axes for p, axes in b.control.items()},
        a.observed | {name(i): axes for i, axes in b.observed.items()},
    )


@dataclass(frozen=True)
class Done:
    """A block at the end of a chain."""

    block: Block
    initial: Solution
    bundle: Solution
    warnings: list[str]
    lines: list[str]


def adjusted_by(chain: str, folder: Path, **options: Any) -> Done:
    """The block of a folder through the default chain, or through initial_orientation/graph."""
    told = Told()
    block = tables(options=TablesOptions(path=folder), context=told)
    interior = calibrated(block, context=told)
    if chain == "graph":
        chosen = {k: v for k, v in options.items() if k in GraphOptions.model_fields}
        initial = graph(block, interior, options=GraphOptions(**chosen), context=told, rng=np.random.default_rng(1))
        points = interior
    else:
        points = systematic(
            block, interior, options=SystematicOptions(refraction=False, earth_curvature=False), context=told
        )
        models = dependent(block, points, context=told)
        strips = scale_transfer(block, models, context=told)
        absolute = similarity(block, strips, points, context=told)
        initial = polynomial(block, points, strips, absolute, context=told)
    chosen = {k: v for k, v in options.items() if k in BundleOptions.model_fields}
    done = bundle(block, points, initial, options=BundleOptions(**chosen), context=told)
    return Done(block, initial, done, told.warnings, told.lines)


def off_m(small: Small, solution: Solution, *, free: bool = False) -> float:
    """Largest distance of an oriented projection centre from the truth, after a similarity where the datum is free."""
    some = solution.images.oriented
    true = np.array([small.position_m[i] for i in solution.images.id[some]])
    x = solution.images.position_m[some]
    if free:
        known = np.isfinite(solution.points.xyz_m).all(axis=1)
        of_points = np.array([small.xyz_m[p] for p in solution.points.id[known]])
        x = transform(
            closed_form(np.concatenate([x, solution.points.xyz_m[known]]), np.concatenate([true, of_points])), x
        )
    return float(np.linalg.norm(x - true, axis=1).max())
