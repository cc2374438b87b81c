"""Solution: orientations, ground points and cameras. Every method of orientation ends in one.

Rows of `images` and `points` are those of the Block. Rotations are `R`: X - X0 = lambda R (x, y, -c); their
covariances belong to the increment d on the ground side, R <- exp([d]x) R. Standard deviations are a priori: sigma0 is
not applied to them. NaN is *not determined*; covariances of methods that give none are NaN throughout.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.tables.schema import Artifact, Table, attribute, column, table


class ImageOrientations(Table):
    """Exterior orientation of all images of the Block."""

    id: Text = column("str", doc="id of the image")
    oriented: Bool = column("bool", doc="False if the image could not be oriented; then all else is NaN")
    position_m: Float = column("f8", 3, unit="m", doc="projection centre X0", optional=True)
    ground_from_image: Float = column("f8", 3, 3, doc="rotation matrix R", optional=True)
    covariance: Float = column("f8", 6, 6, unit="m and rad", doc="of X0 Y0 Z0 d1 d2 d3", optional=True)
    image_points: Int = column("i4", doc="image points used")


class SolvedPoints(Table):
    """Adjusted ground coordinates of all points of the Block."""

    id: Text = column("str", doc="id of the point")
    xyz_m: Float = column("f8", 3, unit="m", doc="coordinates; NaN if not determined", optional=True)
    covariance_m2: Float = column("f8", 3, 3, unit="m^2", doc="covariance", optional=True)
    rays: Int = column("i4", doc="image points used")


class SolvedCameras(Table):
    """Interior orientation of the cameras."""

    id: Text = column("str", doc="id of the camera")
    principal_distance_mm: Float = column("f8", unit="mm", doc="as adjusted; as given where it is not")
    principal_point_mm: Float = column(
        "f8", 2, unit="mm", doc="as adjusted, from the fiducial centre (film) or the image centre, x right, y up"
    )


class StripTransformations(Table):
    """Transformations of free strips, components or models to the ground."""

    id: Text = column("str", doc="id of the strip or component")
    model: Text = column("str", doc="similarity, polynomial_1, polynomial_2 ...")
    parameter: Text = column("str", doc="name of the parameter")
    value: Float = column("f8", doc="value")
    sigma: Float = column("f8", doc="standard deviation", optional=True)


class Parameters(Table):
    """Estimated parameters that are neither orientation nor point: additional, interior, drift ..."""

    group: Text = column("str", doc="interior, additional, drift ...")
    object: Text = column("str", doc="id of the image, camera or set")
    name: Text = column("str", doc="name of the parameter")
    value: Float = column("f8", doc="value")
    sigma: Float = column("f8", doc="standard deviation", optional=True)


class CalibratedSets(Table):
    """Sets of additional parameters that a self-calibration has estimated, and what their terms are scaled with."""

    object: Text = column("str", doc="id of the camera, session or image, as in parameters")
    camera: Text = column("str", doc="id of the camera")
    per: Text = column("str", doc="camera, flight, session or image: what shares them")
    set: Text = column("str", doc="name of the set")
    parameters: Int = column("i4", doc="how many of its parameters are those of the object, in the order of parameters")
    interior: Bool = column("bool", doc="c, x0 and y0 stand before the parameters of the set")
    principal_distance_mm: Float = column("f8", unit="mm", doc="nominal: what the parameters correct")
    principal_point_mm: Float = column("f8", 2, unit="mm", doc="nominal, as subtracted")
    half_format_mm: Float = column("f8", 2, unit="mm", doc="half width and height of the format")
    base_mm: Float = column("f8", unit="mm", doc="photo base b")
    distortion: Text = column(
        "str", absent=True, doc="known distortion that the parameters come on top of, with values"
    )


class ParameterCovariances(Table):
    """Covariances of the camera parameters, additional and of camera models, each pair once, with the variances."""

    first: Int = column("i4", doc="row in parameters", refers="parameters")
    second: Int = column("i4", doc="row in parameters, not before first", refers="parameters")
    covariance: Float = column("f8", doc="in the product of the units of both values", optional=True)


class PointCovariances(Table):
    """Covariances between adjusted points, each pair once, with those of each point itself."""

    first: Int = column("i4", doc="row in points", refers="points")
    second: Int = column("i4", doc="row in points, not before first", refers="points")
    covariance_m2: Float = column("f8", 3, 3, unit="m^2", doc="coordinates of first by those of second", optional=True)


class ErrorFields(Table):
    """Image error of each camera or session: all additional parameters together, on a grid over the format."""

    object: Text = column("str", doc="id of the camera or session, as in parameters")
    xy_mm: Float = column("f8", 2, unit="mm", doc="from the nominal principal point")
    error_um: Float = column("f8", 2, unit="um", doc="dx, dy: measured minus ideal coordinates")
    sigma_um: Float = column("f8", 2, unit="um", doc="standard deviation of dx, dy", optional=True)
    shape_um: Float = column("f8", 2, unit="um", doc="dx, dy without what the orientation of an image would take up")


class ProposedNumbers(Table):
    """Observations left out that fit under the number of another point."""

    kind: Text = column("str", doc="image_point or control")
    row: Int = column("i4", doc="row in its table of the Block; -1 if it has none", optional=True)
    image: Text = column("str", doc="id of the image, empty if none")
    point: Text = column("str", doc="id of the point under whose number it was given")
    proposed: Text = column("str", doc="id of the point that it fits")
    exchanged: Bool = column("bool", doc="that point's own observation fits under this number: both are exchanged")


class VarianceComponents(Table):
    """Standard deviations of groups of observations, from their own residuals, as factors on those given."""

    group: Text = column("str", doc="kind of observation, part, camera, flight, group")
    observations: Int = column("i4", doc="components in use")
    redundancy: Float = column("f8", doc="sum of their redundancy numbers")
    factor: Float = column("f8", doc="on the standard deviations given; 1 where not estimable")
    low: Float = column("f8", doc="lower 95 % limit of the true factor", optional=True)
    high: Float = column("f8", doc="upper 95 % limit", optional=True)
    verdict: Text = column("str", doc="fits, proposed, applied or not estimable (redundancy below 10)")


class IndependentErrors(Table):
    """How many independent errors the correlated ones of some points amount to: (tr C)^2 / tr C^2."""

    points: Text = column("str", doc="new (beside the truth), check (beside the given), left_out (control predicted)")
    count: Float = column("f8", 3, doc="of X, Y, Z; NaN where no point has the coordinate", optional=True)


class Orderings(Table):
    """Orders of elimination of the images: the one in use, and the textbook's across and along the strips."""

    ordering: Text = column("str", doc="nested_dissection, minimum_degree, auto, across_strips or along_strips")
    used: Bool = column("bool", doc="this adjustment was made in it")
    textbook_images: Int = column("i4", doc="half bandwidth 2N+2 or n+3 of N strips of n images; -1 none")
    images: Int = column("i4", doc="half bandwidth found, with the diagonal, without the border")
    unknowns: Int = column("i8", doc="the same in unknowns")
    border: Int = column("i8", doc="unknowns of the border: those that very many images meet")
    stored: Int = column("i8", doc="elements of the factor")
    gflop: Float = column("f8", doc="1e9 multiplications and additions of one factorisation, predicted")


class DatumCarriers(Table):
    """What a free datum rests on; coordinates and covariances are of this datum, and of none outside the block."""

    kind: Text = column("str", doc="point or image: inner constraints over it; held: scalars of images are held")
    id: Text = column("str", doc="id of the point or image, empty if held")


class Iterations(Table):
    """History of the adjustment."""

    cost: Float = column("f8", doc="sum of squares of the weighted residuals before the step")
    decrement: Float = column("f8", doc="Newton decrement of the step, in standard deviations", optional=True)
    damping: Float = column("f8", doc="Levenberg-Marquardt damping; 0 Gauss-Newton")


class Solution(Artifact):
    """Orientations, ground points, cameras: the result of an orientation or adjustment."""

    method: str = attribute(doc="role/variant that made it")
    observations: int = attribute(doc="number of observations")
    unknowns: int = attribute(doc="number of unknowns")
    redundancy: int = attribute(doc="observations minus unknowns")
    sigma0: float = attribute(doc="standard deviation a posteriori over that given; NaN without redundancy")
    sigma0_um: float = attribute(unit="um", doc="sigma0 in the image; NaN where no image points are adjusted")
    iterations: int = attribute(doc="iterations of the last adjustment")
    images: ImageOrientations = table()
    points: SolvedPoints = table()
    cameras: SolvedCameras = table()
    transformations: StripTransformations = table()
    parameters: Parameters = table()
    residuals: Residuals = table()
    history: Iterations = table()
    suspects: Suspects = table()
    tests: Tests | None = table(default=None)
    calibrated_sets: CalibratedSets | None = table(default=None)
    parameter_covariances: ParameterCovariances | None = table(default=None)
    point_covariances: PointCovariances | None = table(default=None)
    error_fields: ErrorFields | None = table(default=None)
    variance_components: VarianceComponents | None = table(default=None)
    independent_errors: IndependentErrors | None = table(default=None)
    orderings: Orderings | None = table(default=None)
    datum: DatumCarriers | None = table(default=None)
    uncontrolled: Uncontrolled | None = table(default=None)
    proposed_numbers: ProposedNumbers | None = table(default=None)
    sigma0_redundancy: float = attribute(doc="redundancy that sigma0 counts, where it is less", default=float("nan"))
    sigma_scale: float = attribute(doc="standard deviations that the covariances take, over those given", default=1.0)
    contradictions: int = attribute(doc="model errors found whose effect is beyond the standard deviations", default=0)

    @property
    def counted_redundancy(self) -> int:
        """Redundancy of sigma0, as its global test takes it."""
        return self.redundancy if np.isnan(self.sigma0_redundancy) else round(self.sigma0_redundancy)

    @property
    def remaining_sigma0(self) -> float:
        """The part of sigma0 that the covariances do not have: a posteriori over the standard deviations in use."""
        return self.sigma0 / self.sigma_scale

    def metrics(self) -> dict[str, float | int | None]:
        """Counts, redundancy and sigma0."""
        determined = np.isfinite(self.points.xyz_m)  # of a network without images a height, or a place, is all there is
        optional: dict[str, float] = {} if np.isnan(self.sigma0_um) else {"sigma0_um": self.sigma0_um}
        if not np.isnan(self.sigma0_redundancy):
            optional["sigma0_redundancy"] = self.sigma0_redundancy
        if self.sigma_scale != 1.0:
            optional["sigma_scale"] = self.sigma_scale
        return {
            "images": int(self.images.oriented.sum()),
            "points": int((determined.all(axis=1) if len(self.images) else determined.any(axis=1)).sum()),
            "image_points": int(self.images.image_points.sum()),
            "observations": self.observations,
            "unknowns": self.unknowns,
            "redundancy": self.redundancy,
            "sigma0": None if np.isnan(self.sigma0) else self.sigma0,
            **optional,
            "iterations": self.iterations,
            "suspects": len(self.suspects),
            "contradictions": self.contradictions,
            **_image_errors(self.error_fields),
        }


def _image_errors(fields: ErrorFields | None) -> dict[str, float]:
    """Root mean square and largest length over the format; the worst camera or session."""
    if fields is None or not len(fields):
        return {}
    length = np.linalg.norm(fields.error_um, axis=1)
    lengths = [length[fields.object == name] for name in np.unique(fields.object)]
    return {"image_error_rms_um": max(float(np.sqrt((e**2).mean())) for e in lengths),
            "image_error_max_um": float(length.max())}  # fmt: skip
