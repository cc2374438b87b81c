"""A small block flown, photographed and surveyed by formulas written here, with one thing wrong where it is asked for.

    u = R'(X - X0)          apparent ray: nadir angle t + K tan t, in its vertical plane (refraction)
    x = -c u1 / u3, y = -c u2 / u3;     measured + correction (k1) = ideal, principal point and film after that

Two or three strips of five or six images look at the same ground whatever their tilt: strips alternate in direction,
and so does their tilt. Nothing here is taken from aatri.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from tests.campaigns.legal.cell import Cell

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]

HEIGHT_M, GROUND_M, RELIEF_M = 500.0, 100.0, 30.0
CAMERAS = {"film": (153.84, 115.0), "digital": (35.0, 22.5)}
"""Principal distance and half format, mm."""
PIXEL_MM = 0.009
IMAGE_MM = {"film": 0.005, "digital": 0.003}
FIDUCIAL_MM, CONTROL_M, POSITION_M, ATTITUDE_DEG = 0.002, (0.02, 0.02, 0.03), 0.05, 0.005
"""True standard deviations."""
BESIDE = {"c": 0.02, "x0": 0.02, "y0": -0.015, "k1": 2e-7}
"""By how much a camera whose parameters are free differs from what block.yaml says; mm, mm^-2."""


@dataclass
class Rays:
    """Measured image points: rows of images and points, photo coordinates from the principal point (mm)."""

    image: Int
    point: Int
    xy_mm: Float


@dataclass
class Scene:
    """The truth, what was measured, and which of it is wrong."""

    cell: Cell
    strip: Int
    sequence: Int
    position_m: Float
    R: Float
    xyz_m: Float
    true_rays: Rays
    xy_mm: Float = field(default_factory=lambda: np.zeros((0, 2)))
    """Measured: principal point and lens included, before film or pixels."""
    control: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    control_m: Float = field(default_factory=lambda: np.zeros((0, 3)))
    check: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    check_m: Float = field(default_factory=lambda: np.zeros((0, 3)))
    positioned: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    positions_m: Float = field(default_factory=lambda: np.zeros((0, 3)))
    angles_deg: Float = field(default_factory=lambda: np.zeros((0, 3)))
    wrong_rays: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    wrong_control: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    wrong_positions: Int = field(default_factory=lambda: np.zeros(0, np.int64))
    wrong_image: int = -1
    far_point: int = -1

    @property
    def image_ids(self) -> list[str]:
        return [f"s{s + 1}i{k + 1}" for s, k in zip(self.strip, self.sequence)]

    @property
    def point_ids(self) -> list[str]:
        return [f"p{k + 1}" for k in range(len(self.xyz_m))]


def scene_of(cell: Cell) -> Scene:
    """Fly, photograph and survey a block."""
    rng = np.random.default_rng([cell.seed, 19])
    scene = _flown(cell, rng)
    _weaken(scene)
    _measure(scene, rng)
    _survey(scene, rng)
    _spoil(scene, rng)
    return scene


def rotation(omega: float, phi: float, kappa: float) -> Float:
    """Turns about x, then the moved y, then the moved z: X - X0 ~ R (x, y, -c)."""
    (a, b, c), (p, q, r) = np.cos([omega, phi, kappa]), np.sin([omega, phi, kappa])
    about_x = np.array([[1, 0, 0], [0, a, -p], [0, p, a]])
    about_y = np.array([[b, 0, q], [0, 1, 0], [-q, 0, b]])
    about_z = np.array([[c, -r, 0], [r, c, 0], [0, 0, 1]])
    return np.asarray(about_x @ about_y @ about_z)


def angles_deg(R: Float) -> Float:
    """Omega, phi, kappa of rotations (n, 3, 3), by the elements of their product."""
    phi = np.arcsin(R[:, 0, 2])
    return np.degrees(np.stack([np.arctan2(-R[:, 1, 2], R[:, 2, 2]), phi, np.arctan2(-R[:, 0, 1], R[:, 0, 0])], axis=1))


def true_camera(cell: Cell) -> dict[str, float]:
    """Interior orientation as it is."""
    other = cell.parameters == "free"
    base = {"c": CAMERAS[cell.camera][0], "x0": 0.011, "y0": -0.004, "k1": 1e-8 if cell.camera == "film" else 5e-6}
    return {name: value + (_beside(cell, name) if other else 0.0) for name, value in base.items()}


def stated_camera(cell: Cell) -> dict[str, float]:
    """Interior orientation as block.yaml has it."""
    return {
        name: v - (_beside(cell, name) if cell.parameters == "free" else 0.0) for name, v in true_camera(cell).items()
    }


def _beside(cell: Cell, name: str) -> float:
    return BESIDE[name] * (0.02 if name == "k1" and cell.camera == "film" else 1.0)


def _flown(cell: Cell, rng: np.random.Generator) -> Scene:
    c, half = CAMERAS[cell.camera]
    strips, images = int(rng.integers(2, 4)), int(rng.integers(5, 7))
    side = 2 * half / c * HEIGHT_M
    base, spacing, tilt = 0.37 * side, 0.62 * side, np.radians(float(cell.tilt))
    across = np.array([0.0, 1.0]) if rng.integers(2) else np.array([1.0, 0.0])  # omega or phi
    strip, sequence, X0, R = [], [], [], []
    for s in range(strips):
        east, lean = 1 - 2 * (s % 2), tilt * (1 if s % 2 else -1)
        for k in range(images):
            looked_at = np.array([(k - (images - 1) / 2) * base * east, s * spacing])
            away = np.array([0.0, -1.0]) if across[1] else np.array([1.0, 0.0])
            place = looked_at + away * np.tan(lean) * HEIGHT_M + rng.normal(0, 0.012 * side, 2)
            turns = rng.normal(0, [0.008, 0.008, 0.015])
            turns[0 if across[1] else 1] += lean
            level = rotation(turns[0], turns[1], 0.0)
            R.append(level @ rotation(0.0, 0.0, turns[2] + (0 if east > 0 else np.pi)))
            X0.append([*place, GROUND_M + HEIGHT_M + rng.normal(0, 0.01 * HEIGHT_M)])
            strip.append(s)
            sequence.append(k)
    east = np.arange(-(images - 1) / 2 * base - 0.45 * side, (images - 1) / 2 * base + 0.45 * side, 0.5 * base)
    north = np.arange(-0.45 * side, (strips - 1) * spacing + 0.46 * side, 0.19 * side)
    plan = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    plan = plan + rng.uniform(-0.06, 0.06, plan.shape) * side
    height = GROUND_M + RELIEF_M * np.sin(plan[:, 0] / 170) * np.cos(plan[:, 1] / 130)
    xyz = np.column_stack([plan, height])
    X0_m, rotations = np.array(X0), np.array(R)
    rays = _photographed(X0_m, rotations, xyz, cell)
    often = np.bincount(rays.point, minlength=len(xyz)) > 1
    kept = often[rays.point]
    new = np.cumsum(often) - 1
    rays = Rays(rays.image[kept], new[rays.point[kept]], rays.xy_mm[kept])
    return Scene(cell, np.array(strip), np.array(sequence), X0_m, rotations, xyz[often], rays)


def refraction(height_m: float) -> float:
    """K of the ARDC 1959 atmosphere (Manual of Photogrammetry), rad, for the ground of these blocks."""
    H, h = height_m / 1000, GROUND_M / 1000
    return 1e-6 * (2410 * H / (H * H - 6 * H + 250) - 2410 * h / (h * h - 6 * h + 250) * h / H)


def _photographed(X0: Float, R: Float, xyz: Float, cell: Cell) -> Rays:
    """All rays that fall into the format."""
    c, half = CAMERAS[cell.camera]
    images, points, coordinates = [], [], []
    for k in range(len(X0)):
        xy, front = _image_of(xyz, X0[k], R[k], c)
        seen = np.flatnonzero(front & (np.abs(xy) < 0.96 * half).all(axis=1))
        images.append(np.full(len(seen), k))
        points.append(seen)
        coordinates.append(xy[seen])
    return Rays(np.concatenate(images), np.concatenate(points), np.concatenate(coordinates))


def _image_of(xyz: Float, X0: Float, R: Float, c: float) -> tuple[Float, npt.NDArray[np.bool_]]:
    u = xyz - X0
    plan, down = np.hypot(u[:, 0], u[:, 1]), -u[:, 2]
    nadir = np.arctan2(plan, down)
    bent = nadir + refraction(X0[2]) * np.tan(nadir)
    apparent = np.column_stack([u[:, :2] * (np.tan(bent) / np.maximum(np.tan(nadir), 1e-12))[:, None], u[:, 2]])
    q = apparent @ R
    return -c * q[:, :2] / q[:, 2:], (q[:, 2] < -1.0)


def _weaken(scene: Scene) -> None:
    """The second strip and its neighbours share three points and no more."""
    if scene.cell.wrong != "weak":
        return
    rays = scene.true_rays
    mine = scene.strip[rays.image] == 1
    shared = np.intersect1d(rays.point[mine], rays.point[~mine])
    x = scene.xyz_m[shared, 0]
    kept = shared[[int(np.argmin(np.abs(x - at))) for at in np.quantile(x, (0.1, 0.5, 0.9))]]
    stays = ~(mine & np.isin(rays.point, np.setdiff1d(shared, kept)))
    scene.true_rays = Rays(rays.image[stays], rays.point[stays], rays.xy_mm[stays])


def _measure(scene: Scene, rng: np.random.Generator) -> None:
    camera, rays = true_camera(scene.cell), scene.true_rays
    ideal = rays.xy_mm * camera["c"] / CAMERAS[scene.cell.camera][0]
    measured = ideal
    for _ in range(20):
        measured = ideal - measured * camera["k1"] * (measured**2).sum(axis=1)[:, None]
    noise = rng.normal(0, IMAGE_MM[scene.cell.camera], measured.shape)
    if scene.cell.noise != "normal":
        quality = rng.uniform(0.6, 1.6, len(scene.R))[rays.image]
        if scene.cell.noise == "t5":
            noise = IMAGE_MM[scene.cell.camera] * rng.standard_t(5, measured.shape) * np.sqrt(3 / 5)
        noise *= quality[:, None]
    scene.xy_mm = measured + np.array([camera["x0"], camera["y0"]]) + noise


def _survey(scene: Scene, rng: np.random.Generator) -> None:
    cell, rays = scene.cell, np.bincount(scene.true_rays.point, minlength=len(scene.xyz_m))
    firm = np.flatnonzero(rays > 2)
    xy = scene.xyz_m[firm, :2] - scene.xyz_m[firm, :2].mean(axis=0)
    ends = {"none": [], "one": [0.3], "two": [3.7, 0.55]}.get(cell.control, list(np.arange(8) * np.pi / 4))
    chosen = [int(firm[np.argmax(xy @ [np.cos(a), np.sin(a)])]) for a in ends]
    if cell.control == "full":
        inner = np.setdiff1d(firm[np.argsort((xy**2).sum(axis=1))[: len(firm) // 2]], chosen)
        chosen += rng.choice(inner, 4, replace=False).tolist()
    scene.control = np.unique(np.array(chosen, np.int64))
    rest = np.setdiff1d(firm, scene.control)
    scene.check = np.sort(rng.choice(rest, 4, replace=False))
    scene.control_m = scene.xyz_m[scene.control] + rng.normal(0, CONTROL_M, (len(scene.control), 3))
    scene.check_m = scene.xyz_m[scene.check] + rng.normal(0, CONTROL_M, (4, 3))
    n = len(scene.R)
    if cell.positions != "none":
        half = np.sort(rng.choice(n, n // 2, replace=False))
        scene.positioned = np.arange(n) if cell.positions == "all" else half
    scene.positions_m = scene.position_m[scene.positioned] + rng.normal(0, POSITION_M, (len(scene.positioned), 3))
    if cell.attitudes == "all":
        scene.angles_deg = angles_deg(scene.R) + rng.normal(0, ATTITUDE_DEG, (n, 3))


def _spoil(scene: Scene, rng: np.random.Generator) -> None:
    """One thing wrong."""
    cell, rays, n = scene.cell, scene.true_rays, len(scene.R)
    often = np.bincount(rays.point, minlength=len(scene.xyz_m))[rays.point]
    if cell.wrong == "gross":
        rows = rng.choice(np.flatnonzero(often > 2), max(2, round(0.01 * len(often))), replace=False)
        angle, size = rng.uniform(0, 2 * np.pi, len(rows)), rng.uniform(20, 400, len(rows)) * IMAGE_MM[cell.camera]
        scene.xy_mm[rows] += size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        scene.wrong_rays = rows
    elif cell.wrong == "control" and len(scene.control):
        row = int(rng.integers(len(scene.control)))
        scene.control_m[row, rng.integers(3)] += rng.choice([-1.0, 1.0])
        scene.wrong_control = np.array([row])
    elif cell.wrong == "position" and len(scene.positioned):
        row = int(rng.integers(len(scene.positioned)))
        scene.positions_m[row, rng.integers(3)] += rng.choice([-2.0, 2.0])
        scene.wrong_positions = np.array([row])
    elif cell.wrong in ("few", "shuffled"):
        scene.wrong_image = int(rng.integers(n))
        mine = np.flatnonzero(rays.image == scene.wrong_image)
        if cell.wrong == "few":
            _without(scene, rng.choice(mine, len(mine) - 4, replace=False))
        else:
            scene.xy_mm[mine] = scene.xy_mm[np.roll(rng.permutation(mine), 1)]
            scene.wrong_rays = mine
    elif cell.wrong == "parallel":
        _far_away(scene, rng)


def _without(scene: Scene, rows: Int) -> None:
    rays, kept = scene.true_rays, np.setdiff1d(np.arange(len(scene.true_rays.image)), rows)
    scene.true_rays = Rays(rays.image[kept], rays.point[kept], rays.xy_mm[kept])
    scene.xy_mm = scene.xy_mm[kept]


def _far_away(scene: Scene, rng: np.random.Generator) -> None:
    """A point that three images of a strip see in the same direction."""
    camera, rays = true_camera(scene.cell), scene.true_rays
    images = np.flatnonzero(scene.strip == 0)[1:4]
    middle = -scene.R[images, :, 2].mean(axis=0)
    u = scene.R[images].transpose(0, 2, 1) @ (middle + np.array([0.05, 0.04, 0.0]))
    xy = -camera["c"] * u[:, :2] / u[:, 2:]
    scene.far_point = len(scene.xyz_m)
    scene.xyz_m = np.vstack([scene.xyz_m, np.full(3, np.nan)])
    scene.true_rays = Rays(
        np.append(rays.image, images), np.append(rays.point, np.full(3, scene.far_point)), np.vstack([rays.xy_mm, xy])
    )
    noise = rng.normal(0, IMAGE_MM[scene.cell.camera], xy.shape)
    scene.xy_mm = np.vstack([scene.xy_mm, xy + np.array([camera["x0"], camera["y0"]]) + noise])
