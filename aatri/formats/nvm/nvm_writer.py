"""Writing of an oriented block as VisualSFM's NVM_V3; the form is that of `nvm_reader`.

Each image has a camera of its own: the focal length and r of its camera; coordinates count from the principal point, in
pixels as wide as high. Points are in the order of the block, their ids have no place.
"""

from pathlib import Path

import numpy as np

from aatri.errors import InputError
from aatri.formats.conventions.poses import quaternion_of_matrix, stated_rotation
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.results.sparse_rays import centred_cameras
from aatri.formats.text.written_files import write_files
from aatri.ids import shown
from aatri.progress import SILENT, Reporter

NAME = "model.nvm"


def write_nvm(oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT) -> None:
    """Write an oriented block as `model.nvm`.

    Raises
    ------
    InputError
        If a camera cannot be written as f, r, or the name of an image has blanks.
    ResourceError
        If the file cannot be written.
    """
    block, rays = oriented.block, oriented.model_rays
    lenses, xy_px = centred_cameras(oriented, ["nvm"], reporter, allowed_px=writing.lens_misfit_px)
    images, points = np.unique(rays.image), np.unique(rays.point)
    names = block.images.id[images].tolist()
    if blank := [name for name in names if len(name.split()) != 1]:
        what = f"names with blanks, which separate the words of NVM: {shown(blank)}"
        raise InputError(what, where=f"block {block.name}", remedy="rename the images, or export as colmap")
    quaternion = quaternion_of_matrix(stated_rotation(oriented.ground_from_image[images], "nvm")).tolist()
    lines = ["NVM_V3", "", str(len(images))]
    for name, row, q, centre in zip(names, images.tolist(), quaternion, oriented.position_m[images].tolist()):
        lens = lenses[int(block.images.camera[row])]
        lines.append(" ".join([name, *map(repr, (lens.focal_px[0], *q, *centre, lens.parameters["r"])), "0"]))
    number = {row: k for k, row in enumerate(images.tolist())}
    order = np.argsort(rays.point, kind="stable")
    first = np.searchsorted(rays.point[order], points)
    feature = np.arange(len(rays.image)) - np.searchsorted(rays.image, rays.image)
    lines += ["", str(len(points))]
    for xyz, of_point in zip(oriented.xyz_m[points].tolist(), np.split(order, first[1:])):
        marks = [
            f"{number[int(rays.image[k])]} {feature[k]} {x!r} {y!r}"
            for k, (x, y) in zip(of_point.tolist(), xy_px[of_point].tolist())
        ]
        lines.append(" ".join([*map(repr, xyz), "0 0 0", str(len(marks)), *marks]))
    write_files(folder, {NAME: "\n".join([*lines, "", "0"]) + "\n"})
