"""Pix4D's `*_calibrated_camera_parameters.txt`, with the offset and the projection matrices that lie beside it.

    7 lines that say what follows, then per image
    name width height / K (3 lines) / R1 R2 R3 / T1 T2 / centre / R (3 lines)       px, m

R turns ground to camera (x right, y down, z forward); the principal point counts from the upper left corner, as the
offsets of the `.cam` file do from half the size. The distortion is OpenCV's: R1 R2 R3 are k1 k2 k3, T1 T2 are p1 p2.
Centres are reduced by `*_offset.xyz`, which is added. Where `*_pmatrix.txt` is there, K [R | -R X] of every image is
compared with it. Images of equal interior orientation are of one camera.

Source: support.pix4d.com, articles 202977149 (internal, external parameters) and 202559089; matrices of 168 images.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError, raise_all
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.conventions.poses import ground_from_image, is_rotation
from aatri.formats.limits import MATRIX_DIGIT
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, FileView, Format, Reading, all_files
from aatri.formats.text.text_line import TextLine, places, word_lines
from aatri.ids import several, shown
from aatri.progress import SILENT, Reporter

ENDING = "calibrated_camera_parameters.txt"
HEAD = "fileName imageWidth imageHeight"
EXPORT = "export the parameters again in Pix4D"
SHAPE = (3, 3, 3, 3, 3, 2, 3, 3, 3, 3)
"""Words of the lines of an image."""


def read_pix4d(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a folder of parameters, or its file of camera parameters.

    Raises
    ------
    InputError
        If a file is missing or not of its form, or the matrices contradict it.
    """
    file = _one(path, ENDING) if path.is_dir() else path
    if file is None:
        raise InputError(f"no file *_{ENDING}", where=str(path), remedy="name the folder `params` of the project")
    beside = file.name.removesuffix(ENDING)
    lines = word_lines(file, reporter)
    if " ".join(lines[0].words) != HEAD:
        raise lines[0].error(f"the first line is not {HEAD!r}", EXPORT)
    images, first = lines[7:], dict[str, TextLine]()
    if not images or len(images) % len(SHAPE):
        raise lines[-1].error(f"{several(len(images), 'line')} of images, {len(SHAPE)} each", EXPORT)
    heads = [_named(line, 2) for line in images[:: len(SHAPE)]]
    images[:: len(SHAPE)] = heads
    rows = [_image(images[k : k + len(SHAPE)], first) for k in range(0, len(images), len(SHAPE))]
    values = np.array(rows)
    files, notes = [file], list[str]()
    _compare_matrices(file.with_name(f"{beside}pmatrix.txt"), heads, values, files, reporter)
    offset = _offset_m(file.with_name(f"{beside}offset.xyz"), files, notes, reporter)
    interior, first_of, camera = np.unique(values[:, :16], axis=0, return_index=True, return_inverse=True)
    names = [f"camera {k + 1}" for k in range(len(interior))] if len(interior) > 1 else ["camera"]
    lenses = [_lens(name, row, heads[k].where) for name, row, k in zip(names, interior, first_of.tolist())]
    of_images = [line.words[0] for line in heads]
    return BlockParts(
        "pix4d",
        files,
        name=beside.rstrip("_") or file.parent.name,
        notes=notes,
        **camera_parts(lenses, reporter, allowed_px=reading.lens_misfit_px),
        images={"id": of_images, "camera": [names[k] for k in camera.ravel()], **places(heads, files)},
        exterior={
            "image": of_images,
            "position_m": values[:, 16:19] + offset,
            "ground_from_image": ground_from_image(values[:, 19:].reshape(-1, 3, 3), "pix4d"),
            **places(heads, files),
        },
    )


def _one(folder: Path, ending: str) -> Path | None:
    ending_in = sorted(p for p in folder.iterdir() if p.name.endswith(ending))
    if len(ending_in) > 1:
        names = shown([p.name for p in ending_in])
        raise InputError(f"several projects: {names}", where=str(folder), remedy="name the file of one of them")
    return ending_in[0] if ending_in else None


def _named(line: TextLine, numbers: int) -> TextLine:
    """The line with its first words as one name, which may have blanks; so many numbers stand behind it."""
    return replace(line, words=[" ".join(line.words[:-numbers]), *line.words[-numbers:]])


def _image(lines: list[TextLine], first: dict[str, TextLine]) -> list[float]:
    """width height K R1 R2 R3 T1 T2 centre R of an image."""
    for line, width in zip(lines, SHAPE):
        line.of_width(width, "what the first lines say")
    lines[0].once(lines[0].words[0], first, "image")
    values = lines[0].numbers(1) + [v for line in lines[1:] for v in line.numbers()]
    K, R = np.array(values[2:11]).reshape(3, 3), np.array(values[19:]).reshape(3, 3)
    if min(values[0], values[1], K[0, 0], K[1, 1]) <= 0 or (K[[1, 2, 2], [0, 0, 1]] != 0).any() or K[2, 2] != 1:
        raise lines[1].error("this is no camera matrix fx s cx / 0 fy cy / 0 0 1", EXPORT)
    if K[0, 1] != 0:
        raise lines[1].error(f"a skew of {K[0, 1]:g} px", "no camera here has one: calibrate without")
    if not is_rotation(R):
        raise lines[-3].error("this is no rotation matrix", EXPORT)
    return values


def _lens(name: str, row: Float, where: str) -> Lens:
    width, height, fx, _, cx, _, fy, cy, _, _, _, *distortion = row.tolist()
    parameters = dict(zip(("R1", "R2", "R3", "T1", "T2"), distortion))
    centre = (cx - width / 2, cy - height / 2)
    return Lens(name, "pix4d", (width, height), (fx, fy), centre, parameters, where=where)


def _offset_m(path: Path, files: list[Path], notes: list[str], reporter: Reporter) -> Float:
    """What all coordinates are reduced by, (3,)."""
    if not path.is_file():
        notes.append(f"{path.name} is not there: coordinates are taken as they stand, without an offset")
        return np.zeros(3)
    files.append(path)
    return np.array(word_lines(path, reporter)[0].of_width(3, "X Y Z of the offset").numbers())


def _compare_matrices(path: Path, heads: list[TextLine], values: Float, files: list[Path], reporter: Reporter) -> None:
    """Faults where K [R | -R X] is not the matrix that Pix4D wrote."""
    if not path.is_file():
        return
    files.append(path)
    K, X, R = values[:, 2:11].reshape(-1, 3, 3), values[:, 16:19], values[:, 19:].reshape(-1, 3, 3)
    P = K @ np.concatenate([R, -R @ X[:, :, None]], axis=2)
    of_image = {line.words[0]: k for k, line in enumerate(heads)}
    problems = []
    for stated_line in word_lines(path, reporter):
        line = _named(stated_line, 12)
        stated = np.array(line.of_width(13, "an image and its matrix").numbers(1)).reshape(3, 4)
        k = of_image.get(line.words[0])
        if k is not None and (apart := float(np.abs(stated - P[k]).max())) > MATRIX_DIGIT:
            what = f"the matrix of {line.words[0]} is {apart:.3g} beside that of its parameters"
            problems.append(line.error(what, "the files are of different runs: export them together"))
    raise_all(problems)


def _recognised(view: FileView) -> str:
    if not view.is_folder:
        return f"a first line {HEAD}" if view.head.startswith(HEAD) else ""
    return next((name for name in view.names if name.endswith(ENDING) and _recognised(view.of(name))), "")


PIX4D = Format(
    "pix4d",
    "Pix4D parameters",
    _recognised,
    "`*_calibrated_camera_parameters.txt`",
    carries=("cameras", "distortion", "start orientations"),
    page="docs/formats.md#pix4d-parameters",
    read=read_pix4d,
    files_of=all_files,
    estimates_cameras=True,
)
