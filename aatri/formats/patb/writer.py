"""Writing of orientations as PATB's `.ori`: three records of fixed width a photo, coordinates to 1e-5 m.

    I16, 16X, 3F16.5    number  X Y Z
    5F16.12             a11 a12 a13 a21 a22
    4F16.12             a23 a31 a32 a33

The matrix is R = Rx(omega) Ry(phi) Rz(kappa), image to ground, x right, y up. Photos are numbers: where the ids are
none, `photos.csv` says which is which.

Source: PCI Geomatics, support document 204186705; "PATB convention" in support.pix4d.com 202559089.
"""

from pathlib import Path

import numpy as np

from aatri.errors import GeometryError
from aatri.formats.conventions.poses import stated_rotation
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.exported_files import short_names
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import write_files
from aatri.progress import SILENT, Reporter

LONGEST = 9
"""Digits of a photo number: readers take it for a whole number of four bytes."""


def write_patb(oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT) -> None:
    """Write the oriented images as `orientations.ori`.

    Raises
    ------
    GeometryError
        If no image is oriented.
    ResourceError
        If a file cannot be written.
    """
    rows = np.flatnonzero(oriented.oriented)
    if not len(rows):
        raise GeometryError("no image has position and rotation", remedy="export a result, or give start values")
    photos, table = short_names(oriented.block.images.id[rows].tolist(), LONGEST, numbers=True)
    matrices = stated_rotation(oriented.ground_from_image[rows], "patb").reshape(-1, 9).tolist()
    lines = []
    for photo, xyz, a in zip(photos, oriented.position_m[rows].tolist(), matrices):
        lines.append(f"{photo:>16}{'':16}" + "".join(f"{value:16.5f}" for value in xyz))
        lines += ["".join(f"{value:16.12f}" for value in a[:5]), "".join(f"{value:16.12f}" for value in a[5:])]
    files = {"orientations.ori": "\n".join(lines) + "\n"} | ({"photos.csv": table} if table else {})
    write_files(folder, files)
    reporter.log("the matrices are R = Rx(omega) Ry(phi) Rz(kappa), image to ground; coordinates end at 1e-5 m")
