"""Writing of an oriented block as lists: orientations in the columns of a program, control, image points.

    orientations.txt    the columns of a preset or those that are named, with its header and its separator
    control.csv         point,X,Y,Z,sX,sY,sZ,role; a coordinate that is not known is empty
    image_points.csv    image,point,x,y,sx,sy: px from the upper left corner, y down

Numbers have all their digits. Standard deviations `sX` ... of orientations are those of the result, or of the observed
positions of a block without one.
"""

import math
from pathlib import Path

import numpy as np

from aatri.arrays import Float, Int
from aatri.errors import GeometryError, SpecError
from aatri.formats.conventions.poses import carrier_angles
from aatri.formats.lists.list_columns import ANGLES, PRESETS, ROTATION, ListPreset, columns_named
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.column_names import standard_deviations
from aatri.formats.results.exported_files import control_points
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.csv_cells import shielded
from aatri.formats.text.written_files import write_files
from aatri.geometry.rotations import angles_from_rotation
from aatri.progress import SILENT, Reporter

UNIT = {"deg": 180 / math.pi, "gon": 200 / math.pi, "rad": 1.0}
USUAL = "pix4d"


def write_lists(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write an oriented block as lists.

    Raises
    ------
    GeometryError
        If there is nothing that lists hold.
    SpecError
        If the columns are none of orientations.
    """
    rows = np.flatnonzero(oriented.oriented)
    control = control_points(oriented)
    files = {}
    if len(rows):
        files["orientations.txt"] = _orientations(oriented, rows, writing)
    if control:
        lines = ["point,X,Y,Z,sX,sY,sZ,role"]
        for p in control:
            xyz = [repr(v) if k else "" for v, k in zip(p.xyz_m.tolist(), p.known)]
            sigma = [repr(v) if k and v > 0 else "" for v, k in zip(p.sigma_m.tolist(), p.known)]
            lines.append(",".join([_cell(p.id), *xyz, *sigma, "check" if p.is_check else "control"]))
        files["control.csv"] = "\n".join(lines) + "\n"
    if len(oriented.block.image_points):
        files["image_points.csv"] = _image_points(oriented)
        reporter.log("image_points.csv counts px from the upper left corner, y down; lists have no camera")
    if not files:
        raise GeometryError("neither orientations nor control nor image points", remedy="give a source that has some")
    write_files(folder, files)


def _image_points(oriented: OrientedBlock) -> str:
    block, rays = oriented.block, oriented.rays
    values = np.hstack([oriented.from_corner_px(rays), rays.sigma_px]).tolist()
    names = zip(block.images.id[rays.image].tolist(), block.points.id[rays.point].tolist())
    lines = [",".join([_cell(i), _cell(p), *map(repr, row)]) for (i, p), row in zip(names, values)]
    return "\n".join(["image,point,x,y,sx,sy", *lines, ""])


def _cell(name: str) -> str:
    quoted = name.replace('"', '""')
    return f'"{quoted}"' if any(sign in name for sign in ',;"\t') else shielded(name)


def _orientations(oriented: OrientedBlock, rows: Int, writing: Writing) -> str:
    stated = writing.columns or USUAL
    preset = PRESETS.get(stated) or ListPreset(columns_named(stated), " ", " ".join(columns_named(stated).names))
    columns = preset.columns
    system = writing.rotation or columns.system
    if "image" not in columns.names or system is None or not {*columns.names} >= {*ANGLES[system]}:
        what = f"columns {' '.join(columns.words)} are no list of orientations with {system or 'three angles'}"
        raise SpecError(what, remedy="name `image X Y Z` and three angles, or a preset")
    cells = _cells(oriented, rows, system, UNIT[writing.angle or columns.angle or "deg"])
    if unknown := {*columns.names} - cells.keys():
        what = f"columns: {', '.join(sorted(unknown))} is nothing that is written"
        raise SpecError(what, remedy=f"written are {', '.join(cells)}")
    written = [
        [repr(-float(cell)) for cell in cells[name]] if word.startswith("-") and name != "-" else cells[name]
        for word, name in zip(columns.words, columns.names)
        if word != "-?"
    ]
    lines = [preset.header.format(n=len(rows))] if preset.header else []
    for row in zip(*written):
        if preset.separator == " " and any(len(cell.split()) != 1 for cell in row):
            what = f"image {row[columns.names.index('image')]!r}: a cell is empty or has blanks, which separate columns"
            raise SpecError(what, remedy="rename the image, or choose columns: metashape or contextcapture")
        lines.append(preset.separator.join(row))
    return "\n".join([*lines, ""])


def _cells(oriented: OrientedBlock, rows: Int, system: str, unit: float) -> dict[str, list[str]]:
    """The cells of each column that is written."""
    block, R = oriented.block, oriented.ground_from_image[rows]
    angles = (carrier_angles(R)[:, ::-1] if system == "yaw-pitch-roll" else angles_from_rotation(R, system)) * unit
    values: dict[str, Float] = dict(zip(("X", "Y", "Z"), oriented.position_m[rows].T))
    values |= dict(zip(ANGLES[system], angles.T)) | dict(zip(ROTATION, R.reshape(-1, 9).T))
    values |= dict(zip(("sX", "sY", "sZ"), _sigma_m(oriented)[rows].T))
    cells = {name: [repr(v) if v == v else "" for v in column.tolist()] for name, column in values.items()}
    cells["time"] = [repr(t) if t == t else "0" for t in block.images.time_s[rows].tolist()]
    cells["image"] = block.images.id[rows].tolist()
    cells["camera"] = block.cameras.id[block.images.camera[rows]].tolist()
    return cells | {"-": [str(k) for k in range(1, len(rows) + 1)]}


def _sigma_m(oriented: OrientedBlock) -> Float:
    """Standard deviations of the positions (n, 3), NaN where there are none."""
    if oriented.solution is not None:
        covariance = oriented.solution.images.covariance[:, :3, :3]
    else:
        covariance = np.full((len(oriented.block.images), 3, 3), np.nan)
        covariance[oriented.block.exterior.image] = oriented.block.exterior.position_covariance_m2
    return standard_deviations(covariance)
