"""Applanix' (POSPac) exterior orientation as text: a preamble, a line of units, names of columns, a row an image.

    (position in Meters, orientation in Degrees, lat, long in Deg)
    ID EVENT TIME(s) EASTING NORTHING ELLIPSOID HEIGHT OMEGA PHI KAPPA [LAT LONG]

R = Rx(omega) Ry(phi) Rz(kappa), image to ground, in the axes of the grid. TIME is seconds of the GPS week. Datum, grid,
lever arm and boresight of the preamble were applied by POSPac: they are told and not applied again; give `crs`.

Source: Esri, Applanix exterior orientation file; ArcGIS Reality, coordinate system conventions.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from aatri.codes import OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.parts.block_parts import PLANE, BlockParts
from aatri.formats.text.text_line import TextLine, places, word_lines
from aatri.progress import SILENT, Reporter

UNITS = re.compile(r"\(\s*position in Meters,\s*orientation in Degrees", re.IGNORECASE)
ANY_UNITS = re.compile(r"\(\s*position in", re.IGNORECASE)
COLUMNS = "EVENT TIME EASTING NORTHING HEIGHT OMEGA PHI KAPPA"
TOLD = re.compile(r"boresight|lever|datum|grid|mapping frame|zone", re.IGNORECASE)


def read_applanix(path: Path, reporter: Reporter = SILENT) -> BlockParts:
    """Read positions and attitudes.

    Raises
    ------
    InputError
        If units or columns are others, or a row is not of this form.
    """
    lines = word_lines(path, reporter)
    at = next((k for k, line in enumerate(lines) if ANY_UNITS.match(" ".join(line.words))), None)
    if at is None or at + 2 >= len(lines):
        where = f"{path}:{lines[-1].line}"
        raise InputError("no line `(position in Meters, orientation in Degrees, ...)`, or no rows", where=where,
                         remedy="export the exterior orientation from POSPac as text")  # fmt: skip
    if not UNITS.match(" ".join(lines[at].words)):
        raise lines[at].error(f"units {' '.join(lines[at].words)}", "export in metres and degrees")
    header = re.sub(
        r"\(S\)|ELLIPSOID|ORTHOMETRIC|#", "", " ".join(lines[at + 1].words).upper().replace(",", " ")
    ).split()
    wanted = COLUMNS.split()
    if header[: len(wanted) + 1] != ["ID", *wanted]:
        raise lines[at + 1].error(f"columns {' '.join(header)}", f"they are ID {COLUMNS}")
    rows, first = lines[at + 2 :], dict[str, TextLine]()
    for line in rows:
        line.of_width(len(header), "a row of the columns").once(line.words[0], first, "image")
    names = list(first)
    return BlockParts(
        "applanix",
        [path],
        name=path.stem,
        frame=PLANE,
        notes=[
            f"applied by POSPac: {' '.join(line.words)}" for line in lines[:at] if TOLD.search(" ".join(line.words))
        ],
        images={"id": names, "camera": "", "time_s": [line.number(2) for line in rows], **places(rows, [path])},
        exterior={
            "image": names,
            "position_m": [line.numbers(3, 6) for line in rows],
            "position_use": OBSERVED_VALUE,
            "angles_rad": np.radians([line.numbers(6, 9) for line in rows]),
            "angle_use": OBSERVED_VALUE,
            **places(rows, [path]),
        },
    )
