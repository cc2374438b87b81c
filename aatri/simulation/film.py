"""From the photo system to what an instrument reads: film deformation, comparator, pixels.

Film, per image: comparator = T (I + A) photo + t with A = (sx, g; 0, sy): different scales in x and y and a shear of
the film, and T, t a small rotation and the shift of the film on the comparator. Fiducial marks and image points go the
same way, so that an affine interior orientation takes all of it back.
Digital: column = x / pixel + columns / 2, row = rows / 2 - y / pixel, origin at the top left corner, rows down.
Source: docs/formulas.md 2.2.
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.geometry.rotations import rotation_from_angles
from aatri.simulation.settings import CameraOptions, FilmOptions

CORNERS = {"1": (106.002, -106.003), "2": (-106.001, -106.004), "3": (-106.000, 106.002), "4": (105.999, 106.002)}
SIDES = {"5": (112.001, 0.002), "6": (-111.999, -0.001), "7": (0.003, 112.002), "8": (-0.002, -112.001)}
COMPARATOR_ORIGIN_MM = 150.0
"""Where the centre of a film lies on the comparator, in x and y, before its shift."""


def fiducial_marks(camera: CameraOptions) -> dict[str, tuple[float, float]]:
    """Calibrated marks of a film camera, mm, photo system; none for a digital one."""
    if camera.kind == "digital":
        return {}
    return CORNERS if camera.fiducials == 4 else CORNERS | SIDES


def placed(images: int, film: FilmOptions, rng: np.random.Generator) -> tuple[Float, Float]:
    """Matrix (images, 2, 2) and shift (images, 2), mm, from the photo system to the comparator."""
    size, sign = rng.uniform(*film.scale, (images, 2)), rng.choice([-1.0, 1.0], (images, 2))
    shear = film.shear * rng.uniform(-1.0, 1.0, images)
    turn = np.deg2rad(film.rotation_deg) * rng.uniform(-1.0, 1.0, images)
    shift = COMPARATOR_ORIGIN_MM + film.shift_mm * rng.uniform(-1.0, 1.0, (images, 2))
    deformed = np.tile(np.eye(2), (images, 1, 1))
    if film.deformation:
        deformed[:, [0, 1], [0, 1]] += size * sign
        deformed[:, 0, 1] = shear
    angles = np.zeros((images, 3))
    angles[:, 2] = turn
    return rotation_from_angles(angles)[:, :2, :2] @ deformed, shift


def comparator(photo_mm: Float, image: Int, placement: tuple[Float, Float]) -> Float:
    """Comparator readings of photo coordinates: (n, 2), mm; `placement` as `placed` gives it."""
    matrix, shift = placement
    return np.asarray(np.einsum("nij,nj->ni", matrix[image], photo_mm) + shift[image])


def pixels(photo_mm: Float, camera: CameraOptions) -> Float:
    """Column and row of photo coordinates."""
    columns, rows = camera.format
    return np.stack(
        [photo_mm[:, 0] / camera.pixel_size_mm + columns / 2, rows / 2 - photo_mm[:, 1] / camera.pixel_size_mm], axis=1
    )
