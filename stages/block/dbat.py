"""DBAT's files: a PhotoModeler text export with a control point file.

Reads image points, the camera, start values of orientations and object points, and control, fixed or weighted. The
camera is that of DBAT's model 1 (`brown`) or 3 (`dbat3`). An object point that its image points cannot determine is
refused, as DBAT does, unless it is to be set aside. The form of the files is described in docs/formats.md.
"""

from typing import Literal

from aatri.artifacts.block import Block
from aatri.formats.dbat.reader import CameraModel, read_dbat
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read


class DbatOptions(ReadingOptions):
    """Options of block/dbat."""

    path: InputPath = Field(description="the export, *-pmexport.txt")
    control: InputPath | None = Field(None, description="control point file; null: no control, the datum is free")
    camera_model: CameraModel = Field("brown", description="brown (DBAT's model 1) or dbat3 (its model 3)")
    calibrate: bool = Field(False, description="the interior orientation is unknown and free, not fixed")
    image_sigma_px: float | None = Field(
        None, gt=0, description="standard deviation of image coordinates, px; null: that of each mark"
    )
    undetermined_points: Literal["refuse", "set_aside"] = Field(
        "refuse", description="object points seen in no image, or in one and without control"
    )


@stage(version=1, uses=())
def dbat(*, options: DbatOptions, context: Context = SILENT) -> Block:
    """Read a PhotoModeler export and its control points."""
    block = read_dbat(
        options.path,
        options.control,
        camera_model=options.camera_model,
        calibrate=options.calibrate,
        image_sigma_px=options.image_sigma_px,
        set_aside=options.undetermined_points == "set_aside",
        reporter=context,
    )
    return as_read(block, options, context)
