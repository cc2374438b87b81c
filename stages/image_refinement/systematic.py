"""Image refinement: lens distortion, atmospheric refraction, earth curvature, in this order, each at most once.

    1  distortion        measured -> perfect central projection, by the camera's model
    2  refraction        r <- r - K (r + r^3 / c^2)         K of the heights of station and terrain above sea level
    3  earth_curvature   r <- r + H' r^3 / (2 R c^2)        H' flying height above the terrain; map frames only

Each is evaluated at the coordinates the one before has left, x, y and r from the principal point. Methods and sources:
aatri.camera.

Earth curvature is corrected only where the block says `earth_curvature: correct` (a map frame with levelled heights);
in a Cartesian frame there is nothing to correct. The closed forms hold for near-vertical images. Rays of images whose
attitudes are known, and tilted by more than 5 degrees, are corrected each in its own vertical plane; with `solution`, a
finished orientation, those of all images.

`atmosphere`: the closed form of the Manual of Photogrammetry (ARDC 1959), or `standard`, the layered U.S. Standard
Atmosphere 1976; below 1 km the former is about 22 % smaller.

The height of a station is that of its exterior position, observed or approximate (of the antenna where that is what it
refers to). Without a position it is estimated: c times ground over photo distances of the control points in the image,
above their mean height, the median over the strip; else the median of the stations that are known. The height of the
terrain is the block's `terrain_height`, or the mean of the control, or what c times base over parallax of neighbouring
images with positions leaves. Where none of this is known the correction is left out, and told with its size.
"""

from typing import Literal

from aatri.adapters.refinement.corrections import IN_ORDER, systematically_corrected
from aatri.adapters.solution import check_same_block
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.notes import tell
from aatri.plugin import SILENT, Context, Field, Options, stage


class SystematicOptions(Options):
    """Which corrections are applied."""

    distortion: bool = Field(True, description="correct lens distortion by the camera's model")
    refraction: bool = Field(True, description="correct atmospheric refraction; of tilted images with `solution`")
    atmosphere: Literal["coefficients", "standard"] = Field(
        "coefficients", description="of refraction: coefficients (closed form, ARDC 1959), or standard (layered, 1976)"
    )
    earth_curvature: bool = Field(True, description="correct earth curvature, if the block asks for it (map frame)")


def _uses(options: SystematicOptions) -> tuple[str, ...]:
    """What is switched off leaves what it would be made of; a curvature that is switched off is left out knowingly."""
    of_terrain = ("images.strip", "terrain_height") if options.refraction or options.earth_curvature else ()
    return (*of_terrain, "earth_curvature:correct", *(("cameras.distortion",) if options.distortion else ()))


@stage(version=2, uses=_uses)
def systematic(
    block: Block,
    image_points: ImagePoints,
    solution: Solution | None = None,
    *,
    options: SystematicOptions = SystematicOptions(),
    context: Context = SILENT,
) -> ImagePoints:
    """Photo coordinates freed from the systematic errors that are known beforehand."""
    check_same_block(block, solution=solution)
    requested = [name for name in IN_ORDER if getattr(options, name)]
    corrected, notes = systematically_corrected(block, image_points, requested, solution, options.atmosphere)
    tell(notes, context)
    return corrected
