"""Ways to spoil a block by observations that are wrong together (campaign `groups`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from tests.stages.chain import Chain


@dataclass(frozen=True)
class Spoilt:
    """A block with a group that is wrong.

    Attributes
    ----------
    words : tuple of str
        What the warning that names it holds, all of them; of alternatives, parted by |, one.
    wrong : dict of str to (n,) int
        Rows of each kind that are wrong.
    """

    block: Block
    points: ImagePoints
    words: tuple[str, ...]
    wrong: dict[str, np.ndarray]


def _moved(chain: Chain, rows: np.ndarray, by_m: np.ndarray, *words: str) -> Spoilt:
    e = chain.block.exterior
    position = e.position_m.copy()
    position[rows] += by_m
    block = replace(chain.block, exterior=replace(e, position_m=position))
    return Spoilt(block, chain.refined, words, {"position": rows})


def _strip(chain: Chain, rng: np.random.Generator) -> tuple[str, np.ndarray]:
    block = chain.block
    name = str(rng.choice(block.strips.id))
    return name, np.flatnonzero(block.strips.id[block.images.strip[block.exterior.image]] == name)


def _all(chain: Chain) -> np.ndarray:
    return np.arange(len(chain.block.exterior))


def _position_sigma(chain: Chain) -> float:
    return float(np.sqrt(chain.block.exterior.position_covariance_m2[0, 0, 0]))


def _direction(rng: np.random.Generator, size: float) -> np.ndarray:
    d = rng.standard_normal(3)
    return size * d / np.linalg.norm(d)


def strip_shift(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Positions of a strip off by ten to thirty times their standard deviation."""
    name, rows = _strip(chain, rng)
    by_m = _direction(rng, rng.uniform(10, 30) * _position_sigma(chain))
    return _moved(chain, rows, by_m, f"positions of strip {name} are off together")


def strip_drift(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Positions of a strip that drift, to twenty standard deviations at its ends."""
    name, rows = _strip(chain, rng)
    time = chain.block.images.time_s[chain.block.exterior.image[rows]]
    time = (time - time.mean()) / np.abs(time - time.mean()).max()
    by = time[:, None] * _direction(rng, 20 * _position_sigma(chain))
    return _moved(chain, rows, by, f"positions of strip {name} are off together")


def heights(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Heights of all positions off by 5 to 20 m."""
    by = np.array([0.0, 0.0, rng.choice([-1, 1]) * rng.uniform(5, 20)])
    words = "the result contradicts its own tests", "heights of positions and control"
    return _moved(chain, _all(chain), by, *words)


def lever_arm(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """A lever arm of some decimetres that nobody gives."""
    arm = rng.choice([-1, 1], 2) * rng.uniform(8, 20, 2) * _position_sigma(chain)
    R = chain.bundle.images.ground_from_image[chain.block.exterior.image]
    return _moved(chain, _all(chain), R @ np.array([*arm, 0.0]), "along the axes of the camera")


def _camera(chain: Chain, words: str, images: np.ndarray | None = None, **change: np.ndarray | float) -> Spoilt:
    """Image points as another camera has them: c scaled, shifted, radial distortion and affinity at the corner."""
    m, block = chain.refined.measurements, chain.block
    rows = np.arange(len(m)) if images is None else np.flatnonzero(np.isin(m.image, images))
    xy, r0 = m.xy_mm.copy(), float(np.linalg.norm(m.xy_mm[m.active], axis=1).max())
    x = xy[rows] / r0
    by = x * r0 * float(change.get("scale", 0.0)) + np.asarray(change.get("shift", 0.0))
    by += x * (x**2).sum(axis=1, keepdims=True) * float(change.get("radial", 0.0))
    by += x * [1.0, -1.0] * float(change.get("affinity", 0.0))
    xy[rows] += by
    return Spoilt(block, replace(chain.refined, measurements=replace(m, xy_mm=xy)), (words,), {})


def principal_distance(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """A principal distance wrong by 5 or 29 %."""
    factor = float(rng.choice([0.95, 1.05, 1.29]))
    c = chain.block.cameras.principal_distance_mm
    block = replace(chain.block, cameras=replace(chain.block.cameras, principal_distance_mm=c * factor))
    return Spoilt(block, chain.refined, ("ask for a principal distance of",), {})


def principal_point(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """A principal point off by 1 % of c: the same as a lever arm where all fly one height; both are named."""
    c = float(chain.block.cameras.principal_distance_mm[0])
    spoilt = _camera(chain, "principal point|lever arm", shift=0.01 * c * rng.choice([-1, 1], 2))
    return replace(spoilt, wrong={"position": _all(chain)})


def radial(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """A radial distortion of 30 to 60 sigma at the corner that nobody gives."""
    size = rng.choice([-1, 1]) * rng.uniform(30, 60) * chain.refined.measurements.sigma_mm[0, 0]
    return _camera(chain, "radial distortion of", radial=size)


def affinity(chain: Chain, rng: np.random.Generator, images: np.ndarray | None = None, of: str = "") -> Spoilt:
    """Another scale in x than in y: 10 to 100 sigma at the corner."""
    size = rng.choice([-1, 1]) * rng.uniform(10, 100) * chain.refined.measurements.sigma_mm[0, 0]
    return _camera(chain, f"{of} ask for an affinity", images, affinity=size)


def strip_affinity(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """The same of one strip, as of another film."""
    name, rows = _strip(chain, rng)
    return affinity(chain, rng, chain.block.exterior.image[rows], f"image points of strip {name}")


def image_affinity(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """The same of one image."""
    image = rng.choice(chain.block.exterior.image, 1)
    return affinity(chain, rng, image, f"image points of image {chain.block.images.id[image[0]]}")


def strip_camera(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """A strip flown with another camera: c 0.5 % longer, principal point 20, distortion 30 sigma off."""
    name, rows = _strip(chain, rng)
    sigma = chain.refined.measurements.sigma_mm[0, 0]
    change = {"scale": 0.005, "shift": 20 * sigma * rng.choice([-1, 1], 2), "radial": 30 * sigma}
    return _camera(chain, f"image points of strip {name} ask for", chain.block.exterior.image[rows], **change)


def neighbourhood(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Twelve image points near each other moved together by 12 sigma."""
    m = chain.refined.measurements
    rays = np.bincount(m.point[m.active], minlength=len(chain.block.points))
    image = int(rng.choice(chain.block.exterior.image))
    mine = np.flatnonzero((m.image == image) & m.active & (rays[m.point] > 2))
    apart = np.linalg.norm(m.xy_mm[mine] - m.xy_mm[rng.choice(mine)], axis=1)
    rows, angle = mine[np.argsort(apart)[:12]], rng.uniform(0, 2 * np.pi)
    xy = m.xy_mm.copy()
    xy[rows] += 12 * m.sigma_mm[rows] * [np.cos(angle), np.sin(angle)]
    points = replace(chain.refined, measurements=replace(m, xy_mm=xy))
    around = np.flatnonzero(np.isin(m.point, m.point[rows]))  # where two images would explain as much, both go
    return Spoilt(
        chain.block, points, ("neighbourhood of", f"in image {chain.block.images.id[image]}"), {"image_point": around}
    )


def attitude_strip(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Attitudes of a strip off by ten to thirty times their standard deviation."""
    name, rows = _strip(chain, rng)
    e = chain.block.exterior
    angles = e.angles_rad.copy()
    angles[rows] += _direction(rng, rng.uniform(10, 30)) * e.angle_sigma_rad[rows]
    block = replace(chain.block, exterior=replace(e, angles_rad=angles))
    return Spoilt(block, chain.refined, (f"attitudes of strip {name} are off together",), {"attitude": rows})


def boresight(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """A boresight of ten to thirty standard deviations that nobody gives."""
    cameras = chain.block.cameras
    turned = cameras.boresight_rad + _direction(rng, rng.uniform(10, 30)) * chain.block.exterior.angle_sigma_rad[0, 0]
    block = replace(chain.block, cameras=replace(cameras, boresight_rad=turned))
    return Spoilt(block, chain.refined, ("have a common offset of",), {"attitude": _all(chain)})


def exchanged_images(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Positions and angles of two images exchanged."""
    e = chain.block.exterior
    rows = rng.choice(len(e), 2, replace=False)
    order = np.arange(len(e))
    order[rows] = rows[::-1]
    block = replace(chain.block, exterior=replace(e, position_m=e.position_m[order], angles_rad=e.angles_rad[order]))
    words = ("position: these two fit if their numbers are exchanged", *map(str, chain.block.images.id[e.image[rows]]))
    return Spoilt(block, chain.refined, words, {"position": rows, "attitude": rows})


def exchanged_control(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Two control points of all with each other's coordinates."""
    g = chain.block.ground_points
    rows = rng.choice(np.flatnonzero((g.role == 1).all(axis=1)), 2, replace=False)
    xyz = g.xyz_m.copy()
    xyz[rows] = xyz[rows[::-1]]
    block = replace(chain.block, ground_points=replace(g, xyz_m=xyz))
    words = ("control: these two fit if their numbers are exchanged", *map(str, chain.block.points.id[g.point[rows]]))
    return Spoilt(block, chain.refined, words, {"control": rows})


def _with_two_cameras(block: Block) -> tuple[Block, np.ndarray]:
    """The middle strip flown with another camera of the same kind, and the images of it."""
    cameras, images = block.cameras, block.images
    other = np.flatnonzero(block.strips.id[images.strip] == block.strips.id[1])
    camera = images.camera.copy()
    camera[other] = len(cameras)
    both = cameras.take(np.zeros(2, dtype=np.int64))
    both = replace(both, id=np.array([*cameras.id.tolist(), "other"]))
    return replace(block, cameras=both, images=replace(images, camera=camera)), other


def camera_of_two(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """The principal distance of one of two cameras wrong by 5 or 29 %."""
    block, _ = _with_two_cameras(chain.block)
    c = block.cameras.principal_distance_mm * [1.0, rng.choice([0.95, 1.05, 1.29])]
    block = replace(block, cameras=replace(block.cameras, principal_distance_mm=c))
    return Spoilt(block, chain.refined, ("of camera other ask for a principal distance of",), {})


def sigma_of_two(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Image points of one of two cameras three times worse than stated."""
    block, images = _with_two_cameras(chain.block)
    m = chain.refined.measurements
    rows = np.flatnonzero(np.isin(m.image, images))
    xy = m.xy_mm.copy()
    xy[rows] += np.sqrt(8.0) * m.sigma_mm[rows] * rng.standard_normal((len(rows), 2))
    points = replace(chain.refined, measurements=replace(m, xy_mm=xy))
    return Spoilt(block, points, ("standard deviations do not fit the residuals", "other 2.|other 3."), {})


def flight_drift(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Positions of a flight of two strips that drift, to twenty standard deviations at its ends."""
    block, e = chain.block, chain.block.exterior
    first = np.isin(block.strips.id[block.images.strip], block.strips.id[:2])
    images = replace(block.images, flight=np.where(first, "first", "second"))
    rows = np.flatnonzero(first[e.image])
    time = images.time_s[e.image[rows]] - images.time_s[e.image[rows]].mean()
    by = (time / np.abs(time).max())[:, None] * _direction(rng, 20 * _position_sigma(chain))
    spoilt = _moved(chain, rows, by, "positions of flight first are off together")
    return replace(spoilt, block=replace(spoilt.block, images=images))


def clean(chain: Chain, rng: np.random.Generator) -> Spoilt:
    """Nothing is wrong."""
    return Spoilt(chain.block, chain.refined, (), {})


WAYS: tuple[Callable[[Chain, np.random.Generator], Spoilt], ...] = (
    clean,
    strip_shift,
    strip_drift,
    heights,
    lever_arm,
    principal_distance,
    principal_point,
    radial,
    affinity,
    strip_camera,
    strip_affinity,
    image_affinity,
    neighbourhood,
    attitude_strip,
    boresight,
    exchanged_images,
    exchanged_control,
    camera_of_two,
    sigma_of_two,
    flight_drift,
)
