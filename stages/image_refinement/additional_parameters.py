"""Additional parameters that another block has determined: what a test field says of the camera is corrected here.

    (x, y) <- (x, y) + K(x, y) p       p the parameters of the finished bundle `calibration`, as they are

K is evaluated at the coordinates that the corrections before have left, as in the adjustment of the test field: give
both blocks the same refinement before. p corrects the nominal camera, so principal distance and point, format and id of
the camera must be the same in both blocks. The correction counts as exact; to keep the covariance of p in the
adjustment, give the finished bundle to `bundle_adjustment/bundle` as `calibration` instead.

Source: Kraus, Photogrammetry, calibration over a test field; parameter sets: aatri.camera.parameters.
"""

from aatri.adapters.cameras.calibration import calibrated_correction, calibration_of
from aatri.adapters.refinement.corrections import with_corrections
from aatri.arrays import finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.camera.parameters.catalogue import parameter_set, with_interior
from aatri.camera.parameters.user import user_set
from aatri.errors import SpecError
from aatri.formats.text.text_file import read_lines
from aatri.geometry.vectors import largest_length
from aatri.plugin import SILENT, CodePath, Context, Field, Options, stage


class AdditionalParametersOptions(Options):
    """Where the terms of a user's set come from."""

    user: CodePath | None = Field(
        None, description="file of the set, where the calibration has set: user; its code runs"
    )


@stage(version=1, uses=())
def additional_parameters(
    block: Block,
    image_points: ImagePoints,
    calibration: Solution,
    *,
    options: AdditionalParametersOptions = AdditionalParametersOptions(),
    context: Context = SILENT,
) -> ImagePoints:
    """Image points corrected by the additional parameters of another block."""
    if "additional parameters" in image_points.corrections.name:
        raise SpecError("the additional parameters have been corrected already", remedy="correct them once")
    calibrated = calibration_of(calibration)
    if calibrated.set != "user":
        parameters = parameter_set(calibrated.set)
    elif options.user is None:
        raise SpecError("the calibration has a set of the user's own", remedy="user: my_parameters.py")
    else:
        parameters = user_set("\n".join(read_lines(options.user)), str(options.user))
    parameters = with_interior(parameters) if calibrated.interior else parameters
    correction_mm = calibrated_correction(block, image_points, parameters, calibrated)
    m = image_points.measurements
    largest = largest_length(correction_mm[m.active & finite_rows(correction_mm)])
    units = ", ".join(id for part in calibrated.parts if part.per != "image" for id in part.ids[:4])
    context.log(f"{calibrated.set} of {units}: at most {1e3 * largest:.2f} um")
    return with_corrections(image_points, m.xy_mm + correction_mm, ["additional parameters"], [largest])
