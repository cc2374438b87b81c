"""Sparse models of computer vision (NVM, Bundler) as parts of a block: cameras, orientations, points with their images.

A model has its own Cartesian frame of any scale. Orientations and points are start values. Pixels are 0.001 mm, for the
models state none. They count from the image centre; but some writers count from the upper left corner, and no file says
the size of its images. That is seen by coordinates of which none is negative; the centre is then where the model's own
points say that it is: the median of what image points differ from projections, to a half pixel.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from aatri.arrays import Float, Int
from aatri.codes import APPROXIMATE
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.conventions.poses import ground_from_image
from aatri.formats.parts.block_parts import LOCAL, BlockParts
from aatri.progress import SILENT, Reporter


class SparseModel(NamedTuple):
    """A sparse model.

    lenses : a camera per image, in its order; their ids are those of the images.
    stated : (n, 3, 3) rotations as the program states them, and centres (n, 3).
    xyz : (p, 3) points.
    image, point : (m,) rows of the image points, with xy_px (m, 2) from the image centre.
    lines : lines of the file of images, points and image points.
    """

    lenses: list[Lens]
    stated: Float
    centres: Float
    xyz: Float
    image: Int
    point: Int
    xy_px: Float
    lines: tuple[Sequence[int], Sequence[int], Sequence[int]]


def parts_of_model(program: str, path: Path, model: SparseModel, y: str, reporter: Reporter = SILENT) -> BlockParts:
    """The parts of a block that a sparse model gives; `y` is up or down."""
    names = [lens.id for lens in model.lenses]
    points = np.array([str(k) for k in range(len(model.xyz))], dtype=np.str_)
    cameras = camera_parts(model.lenses, reporter)
    notes, centre_px = _centre_px(model) if y == "down" else ([], None)
    cameras["cameras"] |= {"pixel_y": y} | (
        {"pixel_origin": "image-centre", "format": np.nan} if centre_px is None else {"format": 2 * centre_px}
    )
    of_images, of_points, of_marks = model.lines
    return BlockParts(
        program,
        [path],
        name=path.stem,
        frame=LOCAL,
        notes=notes,
        **cameras,
        images={"id": names, "camera": names, "line": of_images},
        exterior={
            "image": names,
            "position_m": model.centres,
            "ground_from_image": ground_from_image(model.stated, program),
            "line": of_images,
        },
        image_points={
            "image": np.array(names)[model.image],
            "point": points[model.point],
            "xy": model.xy_px,
            "line": of_marks,
        },
        ground_points={"point": points, "xyz_m": model.xyz, "sigma_m": 0.0, "role": APPROXIMATE, "line": of_points},
    )


def _centre_px(model: SparseModel) -> tuple[list[str], Float | None]:
    """The image centre (2,) of coordinates that count from the upper left corner, with a note; else None."""
    if not len(model.xy_px) or (model.xy_px < 0).any():
        return [], None
    R = ground_from_image(model.stated, "nvm")
    u = np.einsum("nij,ni->nj", R[model.image], model.xyz[model.point] - model.centres[model.image])
    apart = np.zeros_like(model.xy_px)
    for k, lens in enumerate(model.lenses):
        rows = model.image == k
        apart[rows] = model.xy_px[rows] - lens.projected(u[rows, :2] * [-1.0, 1.0] / u[rows, 2:])
    centre = np.round(2 * np.median(apart, axis=0)) / 2
    size = "image coordinates count from the upper left corner of images of {:g} x {:g}, by the model's own points"
    return [size.format(*(2 * centre))], np.asarray(centre)
