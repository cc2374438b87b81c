"""Bundle block adjustment: poses and ground points from all rays together, with self-calibration.

    x = -c u1 / u3,   y = -c u2 / u3,   u = R'(X - X0)

Unknowns: X0 and R of every image (R <- exp([d]x) R), X of every point; exact control is held, weighted control and
GNSS positions (X0 + R a, a the lever arm) are observed. Points are eliminated one by one while the normal equations of
the images are factorised front by front; Gauss-Newton with Levenberg-Marquardt fall-back until the Newton decrement is
below 1e-3. Standard deviations follow from the exact inverse, a priori (sigma0 = 1).

`interior_unknowns`: each film image carries the 4, 6 or 8 unknowns of the film correction that its fiducials leave
open, weighted by the covariance of its interior orientation. `self_calibration`: a set of additional parameters, a
correction K(x, y) p added to the measurement, per camera, session or image. `calibration`, a finished bundle of the
same cameras (a test field), gives the parameters of its set as observations here, with their covariance. Camera models
whose parameters the block leaves open (`sigmas`) are adjusted as such.

Gross errors (`blunders`): least squares; where a |w| is above the limit, once more with robust weights, and data
snooping from there, at observations, points and images of all kinds together; what fits in the end comes back. `robust`
alone weights down and rejects nothing: such a solution has neither sigma0 nor standard deviations. `none` uses
everything, also what an earlier stage has left out.

`information`: the reduced normal equations of another block (information/reduced) stand for all its observations; the
adjustment is that of both blocks.

Start: `initial` if given, else the orientations of the block itself; images and points without a start get one by
resection and intersection. What an earlier stage rejected stays out unless it fits the adjusted block after all.

Source: Kraus, Photogrammetry; Chinese lecture notes on the bundle method, with their errors put right.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal, Self

from pydantic import field_validator, model_validator

from aatri.adapters.bundle.bundle_solution import bundle_solution, with_datum, with_share
from aatri.adapters.bundle.bundle_tables import point_covariances, proposed_numbers, report_orderings, uncontrolled_of
from aatri.adapters.suspects import after
from aatri.adjustment.iterative.forecast import Solver
from aatri.adjustment.structure.index_problem import Ordering
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.information import Information
from aatri.artifacts.needed_datum import datum_needed
from aatri.artifacts.solution import Solution
from aatri.checks.after.of_bundle import findings_after
from aatri.checks.after.rejections import exchanged_proposals
from aatri.checks.after.uncontrolled import uncontrolled_observations
from aatri.checks.at_start.information import check_sets
from aatri.checks.finding import Finding, report
from aatri.options import Reliability
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.result import without_covariances
from aatri.orientation.bundle.settings import Datum, DatumOver
from aatri.plugin import SILENT, Context, Field, Need, stage

from ._adjusted import adjusted_bundle
from ._adjusting import AdjustmentOptions
from ._self_calibration import SelfCalibration, camera_tables, units_named
from ._uses import used
from ._variance_components import VarianceComponentOptions

GONE = {
    "huber": "`huber: K` is now `blunders: {method: robust, weights: huber, bound: K}`",
    "huber_rejects": "`huber_rejects: L` is now `blunders: {method: robust, limit: L}`; `robust_snooping`, the "
    "default, needs no second bundle",
}
"""Options there were, and what to write instead."""


class BundleOptions(AdjustmentOptions):
    """Options of the bundle adjustment."""

    interior_unknowns: bool = Field(
        True,
        description="carry the film correction of each image with measured fiducials as weighted unknowns",
    )
    readout_sigma: float | None = Field(
        0.0,
        ge=0,
        description="standard deviation of the readout of a rolling shutter, as a share of what row_time says: 0 as it "
        "says, null free",
    )
    velocity_sigma: float | None = Field(
        0.0,
        ge=0,
        description="rolling shutter: standard deviation of the velocity of an image by the images before and after, "
        "m/s: 0 as they say, null free for each image",
    )
    self_calibration: SelfCalibration | None = Field(
        None, description="set of additional parameters: a name, or a mapping with set, per, sigma_um"
    )
    datum: Datum = Field(
        "given",
        description="given by control and positions; minimal: for a block without any, seven scalars are held; free: "
        "inner constraints for what control and positions leave open",
    )
    datum_over: DatumOver = Field(
        "points",
        description="what a free datum rests on: all points, the projection centres of all images, or the points that "
        "the block marks (column datum)",
    )
    standard_deviations: bool | None = Field(
        None,
        description="of all orientations and points; null: where memory holds the factor; true: an error elsewhere",
    )
    reliability: Reliability = False
    point_covariances: list[str] = Field(
        [],
        description="points whose covariances with each other are kept, by id with * and ?, for comparisons of epochs",
    )
    variance_components: VarianceComponentOptions | None = Field(
        None,
        description="standard deviations of groups of observations from their residuals: a mapping with groups, apply",
    )
    blunders: SearchOptions = Field(
        SearchOptions(), description="search for gross errors: a method, or a mapping with method, limit, max_share ..."
    )
    ordering: Ordering = Field(
        "auto",
        description="order of elimination of the images; auto: the better of nested_dissection and minimum_degree",
    )
    reproducible: bool = Field(False, description="the same bits for any number of threads")
    memory_gb: float | None = Field(
        None, gt=0, description="limit of the memory; beyond it the factor goes to disk; null: 80 % of the machine's"
    )
    parts: int = Field(
        1,
        ge=1,
        description="parts in which the block is adjusted, each by its own worker of a cluster; tests of groups and "
        "others that need the factor of the whole are left out, standard deviations are not",
    )
    solver: Solver = Field(
        "auto", description="direct, or conjugate_gradients without standard deviations; auto: by the memory needed"
    )

    @field_validator("self_calibration", mode="before")
    @classmethod
    def _set_by_name(cls, value: object) -> object:
        return {"set": value} if isinstance(value, str) else value

    @field_validator("blunders", mode="before")
    @classmethod
    def _method_by_name(cls, value: object) -> object:
        return {"method": value} if isinstance(value, str) else value

    @model_validator(mode="before")
    @classmethod
    def _gone(cls, value: object) -> object:
        options = value if isinstance(value, Mapping) else {}
        for name, remedy in GONE.items():
            if name in options:
                raise ValueError(remedy)
        return value

    @model_validator(mode="after")
    def _no_statistics_of_weights(self) -> Self:
        if self.datum_over != "points" and self.datum != "free":
            raise ValueError("datum_over goes with datum: free")
        removes = self.self_calibration is not None and self.self_calibration.remove
        if self.blunders.method == "robust" and (self.reliability or removes or self.variance_components):
            requested = "self_calibration.remove" if removes else "variance_components"
            requested = "reliability" if self.reliability else requested
            raise ValueError(
                f"blunders: robust gives no statistics: {requested} needs least squares, as robust_snooping ends with"
            )
        return self


def bundle_uses(options: BundleOptions) -> tuple[str, ...]:
    """What a bundle uses of the block, by its options."""
    units, components = units_named(options.self_calibration), options.variance_components
    by_flight = options.positions.drift != "none" and options.positions.per == "flight"
    in_groups = options.blunders.method != "robust"  # positions and attitudes of a flight may be off together
    return used(
        marked=options.datum_over == "marked",
        sessions="session" in units,
        levels=components.groups if components is not None else (),
        row_times=True,
        flights="flight" in units,
        observed_flights=by_flight or in_groups,
    )


def bundle_needs(options: BundleOptions) -> tuple[Need, ...]:
    """What a bundle needs of the block, by its options."""
    if options.datum != "given":
        return ()
    positions = options.positions
    shift: Literal["none", "group", "all"] = "group" if positions.per == "group" else "all"
    needed = datum_needed(positions=positions.use, shift="none" if positions.drift == "none" else shift)
    return tuple(replace(need, or_port="information") for need in needed)


@stage(version=7, uses=bundle_uses, needs=bundle_needs)
def bundle(
    block: Block,
    image_points: ImagePoints | None = None,
    initial: Solution | None = None,
    calibration: Solution | None = None,
    information: Information | None = None,
    *,
    options: BundleOptions = BundleOptions(),
    context: Context = SILENT,
) -> Solution:
    """Adjust the block."""
    adjusted = adjusted_bundle(block, image_points, initial, calibration, information, options, context)
    source, done, chosen = adjusted.source, adjusted.done, adjusted.chosen
    groups, suspects = adjusted.groups, adjusted.suspects
    searched = options.blunders.method != "none"
    requested = options.standard_deviations is not False or options.reliability
    shown = done if requested else replace(done, result=without_covariances(done.result))
    findings = findings_after(source, shown, groups, options.max_sigma0, tests=options.reliability, searched=searched)
    of_cameras, camera_notes = camera_tables(block, shown.result, chosen)
    uncontrolled = uncontrolled_of(done.result)
    proposed = proposed_numbers(done) if searched else None
    exchanged = exchanged_proposals(proposed, suspects) if proposed is not None else []
    report([*findings, *exchanged, *camera_notes, *uncontrolled_observations(uncontrolled)], context)
    suspects = after(suspects, done, options.blunders)
    orderings = report_orderings(done, options.ordering, context)  # before the tables are made, which are large, too
    solution = replace(
        bundle_solution(source, shown, suspects, uncontrolled, of_cameras, tests=options.reliability),
        orderings=orderings,
        variance_components=adjusted.components,
        point_covariances=point_covariances(block, done.result, source.frame, options.point_covariances),
        contradictions=sum(isinstance(one, Finding) and one.contradicts for one in findings),
        proposed_numbers=proposed,
    )
    if information is not None and adjusted.share is not None:
        check_sets(information, of_cameras.sets)
        solution = with_share(solution, adjusted.share)
    return with_datum(block, solution, options.datum, options.datum_over)
