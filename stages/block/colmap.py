"""COLMAP: a sparse model, text or binary, as a block.

Reads cameras, image points, and as start values orientations and points. Positions of the images may be observations,
points may be control by a ground_points.csv. A pixel is taken as 0.001 mm. The form of the files and the camera models
are described in docs/formats.md.
"""

from aatri.artifacts.block import Block
from aatri.formats.colmap.reader import read_colmap
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read


class ColmapOptions(ReadingOptions):
    """Options of block/colmap."""

    path: InputPath = Field(description="folder of the model: cameras, images and points3D, .txt or .bin")
    image_sigma_px: float = Field(1.0, gt=0, description="standard deviation of image coordinates, px")
    position_sigma: float | None = Field(
        None,
        gt=0,
        description="positions of the images are observed with this standard deviation, m; null: start values",
    )
    control: InputPath | None = Field(None, description="ground_points.csv with the ids of the model's points, in m")
    calibrate: bool = Field(False, description="c, principal point and distortion are unknown and free, not fixed")


@stage(version=1, uses=())
def colmap(*, options: ColmapOptions, context: Context = SILENT) -> Block:
    """Read a sparse model."""
    block = read_colmap(
        options.path,
        image_sigma_px=options.image_sigma_px,
        position_sigma_m=options.position_sigma,
        control=options.control,
        calibrate=options.calibrate,
        reporter=context,
    )
    return as_read(block, options, context)
