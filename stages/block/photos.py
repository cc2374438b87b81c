"""Photographs: images, cameras, positions and attitudes from what the files themselves say (EXIF, XMP).

    c_px = f35 diagonal_px / 43.27 mm        focal length of EXIF, weighted by 30 % and never held
    X0   = observed position                 RTK standard deviations of the packet, else 3, 3, 10 m
    R    = gimbal                            2 degrees

Cameras are those of one make, model, lens, size and focal length; their principal point and distortion (brown) are
free. Pixels count as they lie in the file, whatever viewers are to turn. A flight is the photographs of a folder and
camera without a long gap in time. There are no image points yet: a stage of the role `tie_points` finds them.

Source: JEITA CP-3451 (Exif 2.32); CIPA DCG-001-2018; DJI, manuals of Zenmuse P1 and Mavic 3M.
"""

from aatri.artifacts.block import Block
from aatri.formats.navigation.photo_folder import ATTITUDE_SIGMA_DEG, POSITION_SIGMA_M, read_photographs
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.not_stated import NotStated
from aatri.plugin import SILENT, Context, Field, InputPath, Options, stage


class PhotosOptions(Options):
    """Options of block/photos."""

    path: InputPath = Field(description="folder of the photographs, with the folders in it")
    crs: str | None = Field(None, description="coordinate system of the block; null: the UTM zone of the positions")
    vertical: str | None = Field(None, description="its height system; null: ellipsoidal")
    position_sigma: tuple[float, float, float] = Field(
        POSITION_SIGMA_M, description="standard deviations of positions without their own: east, north, height, m"
    )
    attitude_sigma_deg: float = Field(
        ATTITUDE_SIGMA_DEG, gt=0, description="standard deviation of attitudes of the gimbal, degrees"
    )
    flight_gap_s: float = Field(600.0, gt=0, description="so long without an exposure a new flight begins, s")
    shift: bool = Field(
        False,
        description="the positions of a flight share an unknown shift; needs control that says where the block is",
    )


@stage(version=1, uses=())
def photos(*, options: PhotosOptions, context: Context = SILENT) -> Block:
    """Read the heads of photographs."""
    parts = read_photographs(
        options.path,
        position_sigma_m=options.position_sigma,
        attitude_sigma_deg=options.attitude_sigma_deg,
        flight_gap_s=options.flight_gap_s,
        shift=options.shift,
        reporter=context,
    )
    for note in parts.notes:
        context.warn(note)
    parts.notes.clear()
    return assembled([parts], NotStated(crs=options.crs, vertical=options.vertical), reporter=context)
