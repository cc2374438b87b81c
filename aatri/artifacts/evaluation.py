"""Evaluation: accuracy of a Solution, empirical and theoretical, summarised and per point; errors of free strips."""

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.tables.schema import Artifact, Table, attribute, column, table


class Figures(Table):
    """Figures of accuracy, by name; what was not determined has no row."""

    name: Text = column("str", doc="name, with unit: check_rmse_x_m ...")
    value: Float = column("f8", doc="value in the unit of the name")


class Differences(Table):
    """Differences at control, check and new points: solution minus given, or minus truth."""

    point: Text = column("str", doc="id of the point")
    kind: Text = column("str", doc="control, left_out (control predicted without itself), check or truth")
    difference_m: Float = column(
        "f8", 3, unit="m", doc="difference; NaN where the coordinate does not take part", optional=True
    )
    sigma_m: Float = column("f8", 3, unit="m", doc="theoretical standard deviation; NaN unknown", optional=True)
    rays: Int = column("i4", doc="image points used")


class SingleModels(Table):
    """Stereo pairs restituted one by one with the orientations of the block; differences: model minus the other."""

    left: Text = column("str", doc="id of the left image")
    right: Text = column("str", doc="id of the right image")
    points: Int = column("i4", doc="points with both rays in use")
    base_m: Float = column("f8", unit="m", doc="length of the base")
    parallax_rms_um: Float = column("f8", unit="um", doc="y-parallaxes in the normal case", optional=True)
    parallax_max_um: Float = column("f8", unit="um", doc="the largest", optional=True)
    parallax_max_at: Text = column("str", doc="id of its point")
    w_rms: Float = column(
        "f8", doc="what the two rays leave, over its standard deviation: near 1, or below", optional=True
    )
    adjusted_rms_m: Float = column("f8", 3, unit="m", doc="minus the adjusted coordinates", optional=True)
    control_points: Int = column("i4", doc="control points among them")
    control_rms_m: Float = column("f8", 3, unit="m", doc="minus the given coordinates there", optional=True)
    check_points: Int = column("i4", doc="check points among them")
    check_rms_m: Float = column("f8", 3, unit="m", doc="minus the given coordinates there", optional=True)


class ModelSetUps(Table):
    """Stereo pairs as a plotter sets them up: x along the base, z up across it; y-axes of both images are parallel."""

    left: Text = column("str", doc="id of the left image")
    right: Text = column("str", doc="id of the right image")
    origin_m: Float = column("f8", 3, unit="m", doc="left projection centre, on the ground")
    base_m: Float = column("f8", 3, unit="m", doc="from left to right projection centre, on the ground")
    ground_from_model: Float = column("f8", 3, 3, doc="rotation: columns are x, y, z of the model on the ground")
    left_rad: Float = column("f8", 3, unit="rad", doc="phi, omega, kappa of the left image in the model")
    right_rad: Float = column("f8", 3, unit="rad", doc="phi, omega, kappa of the right image in the model")
    epipolar_from_left: Float = column("f8", 3, 3, doc="rotation of rays (x, y, -c) to the epipolar image")
    epipolar_from_right: Float = column("f8", 3, 3, doc="the same of the right image")
    scale_number: Float = column("f8", doc="of the images: distance of the points along z over c")
    points: Int = column("i4", doc="rows in pass_points")


class PassPoints(Table):
    """Points of the set-ups: on the ground, in the model and in both epipolar images, and what is left at them."""

    left: Text = column("str", doc="id of the left image")
    right: Text = column("str", doc="id of the right image")
    point: Text = column("str", doc="id of the point")
    role: Text = column("str", doc="control, check or new")
    ground_m: Float = column("f8", 3, unit="m", doc="adjusted coordinates", optional=True)
    model_m: Float = column(
        "f8", 3, unit="m", doc="of its two rays in the model, from the left projection centre", optional=True
    )
    left_mm: Float = column("f8", 2, unit="mm", doc="corrected coordinates in the left epipolar image", optional=True)
    right_mm: Float = column("f8", 2, unit="mm", doc="in the right one", optional=True)
    parallax_um: Float = column("f8", unit="um", doc="y-parallax that is left", optional=True)
    residual_m: Float = column("f8", 3, unit="m", doc="model minus adjusted coordinates, on the ground", optional=True)


class StripErrors(Table):
    """Errors of free strips laid on the truth by their first model, at the right projection centre of the n-th."""

    model: Int = column("i4", doc="n: number of the model in its strip, from 1")
    strips: Int = column("i4", doc="strips that reach so far")
    mean: Float = column("f8", 3, unit="first base", doc="mean error of the place, in the axes of the ground")
    rms: Float = column("f8", 3, unit="first base", doc="its root mean square")
    law: Float = column("f8", 3, unit="first base", doc="sigma_b sqrt(n (n + 1)(2n + 1) / 6), sigma_b fitted")
    turned_rad: Float = column("f8", 3, unit="rad", doc="root mean square of the error of the attitude")
    turned_law_rad: Float = column("f8", 3, unit="rad", doc="sigma sqrt(n), sigma fitted")


class Displacements(Table):
    """Points at two epochs: the later minus the earlier, beside those that have not moved."""

    point: Text = column("str", doc="id of the point")
    xyz_m: Float = column("f8", 3, unit="m", doc="coordinates at the earlier epoch", optional=True)
    moved: Bool = column("bool", doc="not congruent with the others")
    displacement_m: Float = column(
        "f8", 3, unit="m", doc="displacement if it has moved; NaN where the others do not determine it", optional=True
    )
    covariance_m2: Float = column("f8", 3, 3, unit="m^2", doc="of the displacement", optional=True)
    statistic: Float = column("f8", doc="test of the point, chi2 of its coordinates without movement", optional=True)
    limit: Float = column("f8", doc="largest that chance explains")
    probability: Float = column("f8", doc="of a test as large by chance", optional=True)
    detectable_m: Float = column(
        "f8", unit="m", doc="displacement found with 80 % in the direction determined worst", optional=True
    )


class ParameterChanges(Table):
    """Parameters of cameras at two epochs: the later calibration minus the earlier."""

    object: Text = column("str", doc="id of the camera or session, as in parameters")
    name: Text = column("str", doc="name of the parameter")
    moved: Bool = column("bool", doc="does not agree with the earlier calibration")
    change: Float = column("f8", doc="later minus earlier, in the unit of the parameter", optional=True)
    sigma: Float = column("f8", doc="standard deviation of the change", optional=True)
    difference: Float = column("f8", doc="plain difference of both values")
    statistic: Float = column("f8", doc="test of the parameter, chi2 of 1 without a change", optional=True)
    limit: Float = column("f8", doc="largest that chance explains")
    probability: Float = column("f8", doc="of a test as large by chance", optional=True)
    detectable: Float = column("f8", doc="change found with 80 %, in the unit of the parameter", optional=True)


class LayoutPoints(Table):
    """Points of a planned block: what they will be worth, and what control there would gain."""

    point: Text = column("str", doc="id of the point")
    xyz_m: Float = column("f8", 3, unit="m", doc="coordinates", optional=True)
    sigma_m: Float = column("f8", 3, unit="m", doc="standard deviations", optional=True)
    moved_m: Float = column(
        "f8", 3, unit="m", doc="largest effect of a detectable error of one of its observations", optional=True
    )
    mean_gain: Float = column(
        "f8", doc="share of the sum of all variances that control here takes away; NaN where it is", optional=True
    )
    worst_gain: Float = column("f8", doc="share of the largest variance", optional=True)
    order: Int = column("i4", doc="1, 2 ...: next control, chosen one beside the other; 0 not chosen")


class Evaluation(Artifact):
    """Accuracy of a Solution, or of free strips; what has moved between two epochs; what a layout is worth."""

    verdict: str = attribute(doc="what is known of the accuracy, and from what, a line for each statement")
    figures: Figures = table()
    differences: Differences = table()
    models: SingleModels | None = table(default=None)
    set_ups: ModelSetUps | None = table(default=None)
    pass_points: PassPoints | None = table(default=None)
    strip_errors: StripErrors | None = table(default=None)
    displacements: Displacements | None = table(default=None)
    parameter_changes: ParameterChanges | None = table(default=None)
    layout_points: LayoutPoints | None = table(default=None)

    def metrics(self) -> dict[str, float | int | None]:
        """All figures; counts as integers. Those of the independent check are None where it has not been made."""
        values = zip(self.figures.name, self.figures.value)
        figures = {
            str(n): int(v)
            if str(n).endswith(("_points", "_parameters", "_degrees", "models", "images", "_observations"))
            else _plain(float(v))
            for n, v in values
        }
        others = (self.displacements, self.parameter_changes, self.layout_points)
        if any(other is not None for other in others):
            return figures
        return figures | {name: None for name in _OF_THE_CHECK if name not in figures}


_OF_THE_CHECK = tuple(f"check_{figure}_{axis}_m" for figure in ("rmse", "bias", "max") for axis in "xyz")


def _plain(value: float) -> float | None:
    return None if np.isnan(value) else value
