"""VisualSFM's NVM_V3.

    NVM_V3 [FixedK fx cx fy cy r]
    n, then n times    file f  qw qx qy qz  cx cy cz  r 0
    p, then p times    X Y Z  R G B  m  m times (image feature x y)
    ...                further models; 0 ends them

A block is one model: the one with most images is read, and the images of the others are named.

q turns ground to camera (x right, y down, z forward), cx cy cz is the centre; x, y are px from the image centre, y
down. r corrects the measurement: (1 + r |m|^2) m = (X/Z, Y/Z) with m in units of f.

Written, each image has a camera of its own, the focal length and r of its camera; coordinates count from the principal
point, in pixels as wide as high. Points are in the order of the block, their ids have no place.

Source: VisualSFM documentation, ccwu.me/vsfm/doc.html; Wu et al. 2011, Multicore bundle adjustment.
"""

from pathlib import Path

import numpy as np

from aatri.errors import InputError
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.poses import matrix_of_quaternion, quaternion_of_matrix, stated_rotation
from aatri.formats.nvm.sparse_model import SparseModel, parts_of_model
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, AS_USUAL, OF_MODELS, Format, Reading, Writing, begins
from aatri.formats.results.horizon import centred_cameras
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.text_line import TextLine, word_lines
from aatri.formats.text.written_files import write_files
from aatri.ids import several, shown
from aatri.progress import SILENT, Reporter

EXPORT = "the file is incomplete or no NVM_V3: export it again"


def read_nvm(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a model."""
    lines = word_lines(path, reporter, remark="#")
    if lines[0].words[0] != "NVM_V3":
        raise lines[0].error(f"begins with {lines[0].words[0][:20]!r}, not NVM_V3", EXPORT)
    if len(lines[0].words) > 1:
        raise lines[0].error("a calibration common to all (FixedK)", "export the model without fixed calibration")
    cameras, points = _largest(_models(lines), path, reporter)
    first: dict[str, TextLine] = {}
    lenses, poses = [], []
    for line in cameras:
        line.of_width(11, "an image `file f q q q q c c c r 0`").once(line.words[0], first, "image")
        f, *pose, r, _ = line.numbers(1)
        if f <= 0 or not any(pose[:4]):
            raise line.error(f"image {line.words[0]} has the focal length {f:g}, quaternion {pose[:4]}", EXPORT)
        lenses.append(Lens(line.words[0], "nvm", (2 * f, 2 * f), (f, f), parameters={"r": r}, where=line.where))
        poses.append(pose)
    rows = np.array(poses).reshape(-1, 7)
    xyz, marks, of_marks = [], [], []
    for k, line in enumerate(points):
        if len(line.words) < 7 or len(line.words) != 7 + 4 * line.count(6):
            raise line.error(
                several(len(line.words), "word"), "a point is `X Y Z R G B m` and m times `image feature x y`"
            )
        xyz.append(line.numbers(0, 3))
        for j in range(7, len(line.words), 4):
            image = line.count(j)
            if image >= len(lenses):
                raise line.error(f"image {image}, but there are {len(lenses)}, counted from 0", EXPORT)
            marks.append((image, k, *line.numbers(j + 2, j + 4)))
            of_marks.append(line.line)
    measured = np.array(marks).reshape(-1, 4)
    model = SparseModel(
        lenses,
        matrix_of_quaternion(rows[:, :4]),
        rows[:, 4:],
        np.array(xyz).reshape(-1, 3),
        measured[:, 0].astype(np.int32),
        measured[:, 1].astype(np.int32),
        measured[:, 2:],
        ([line.line for line in cameras], [line.line for line in points], of_marks),
    )
    return parts_of_model("nvm", path, model, "down", reporter)


def _models(lines: list[TextLine]) -> list[tuple[list[TextLine], list[TextLine]]]:
    """Lines of the images and points of each model."""
    models, at = list[tuple[list[TextLine], list[TextLine]]](), 1
    while not models or (at < len(lines) and lines[at].words[0].isdigit() and lines[at].count(0) > 0):
        cameras, at = _section(lines, at, "images")
        points, at = _section(lines, at, "points")
        models.append((cameras, points))
    return models


def _largest(
    models: list[tuple[list[TextLine], list[TextLine]]], path: Path, reporter: Reporter
) -> tuple[list[TextLine], list[TextLine]]:
    """The model with most images; those of the others are named."""
    largest = max(models, key=lambda model: len(model[0]))
    if others := [line.words[0] for model in models if model is not largest for line in model[0]]:
        what = (
            f"{len(models)} models: that of {several(len(largest[0]), 'image')} is read, "
            f"{several(len(others), 'image', 'is', 'are')} left out"
        )
        reporter.warn(f"{path}: {what}: {shown(others)}; another model is a file of its own")
    return largest


def _section(lines: list[TextLine], at: int, what: str) -> tuple[list[TextLine], int]:
    """So many lines as a count says, and where the next section begins."""
    if at >= len(lines) or len(lines[at].words) != 1:
        where = f"{lines[0].path}:{lines[min(at, len(lines) - 1)].line}"
        raise InputError(f"the number of {what} is not there", where=where, remedy=EXPORT)
    count = lines[at].count(0)
    if not (what == "images") <= count <= len(lines) - at - 1:
        raise lines[at].error(f"{count} {what}, and {several(len(lines) - at - 1, 'line')} below", EXPORT)
    return lines[at + 1 : at + 1 + count], at + 1 + count


NAME = "model.nvm"


def write_nvm(oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT) -> None:
    """Write an oriented block as `model.nvm`.

    Raises
    ------
    InputError
        If a camera cannot be written as f, r, or the name of an image has blanks.
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


NVM = Format(
    "nvm",
    "VisualSFM NVM",
    begins("NVM_V3"),
    "a first line NVM_V3",
    carries=OF_MODELS,
    page="docs/formats.md#nvm-and-bundler",
    read=read_nvm,
    write=write_nvm,
    written=OF_MODELS,
    estimates_cameras=True,
)
