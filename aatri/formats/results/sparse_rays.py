"""Rays and cameras for programs whose cameras have one focal length and the principal point in the image centre."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.arrays import Float
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import as_program_states
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.progress import Reporter


def centred_cameras(
    oriented: OrientedBlock, forms: Sequence[str], reporter: Reporter, *, allowed_px: float
) -> tuple[dict[int, Lens], Float]:
    """Cameras by row, and the rays of the model (m, 2) from the principal point, y down, in pixels of their width.

    A distortion is in units of the focal length, so that another height of the pixels does not change it.

    Raises
    ------
    InputError
        If a distortion is none of the forms within `allowed_px`.
    """
    rays = oriented.model_rays
    camera, xy_px = oriented.block.images.camera[rays.image], rays.xy_px.copy()
    lenses = {}
    for k in np.unique(camera).tolist():
        lens = oriented.lenses[k]
        (width, height), (fx, fy), point = lens.size_px, lens.focal_px, np.array(lens.principal_point_px)
        xy_px[camera == k] = (xy_px[camera == k] - point) * [1.0, fx / fy]
        square = (width + 2 * abs(point[0]), (height + 2 * abs(point[1])) * fx / fy)
        centred = replace(lens, size_px=square, focal_px=(fx, fx), principal_point_px=(0.0, 0.0))
        lenses[k] = as_program_states(centred, forms, reporter, allowed_px=allowed_px)
    return lenses, xy_px
