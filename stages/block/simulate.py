"""A simulated block: flown, photographed, measured and surveyed by the computer, with its truth.

Stations are planned from overlaps and scale and flown with irregularities; points lie at the standard positions and
at random on a wavy terrain; every ray goes through the physical forward model

    ground -> (sphere) -> camera frame -> central projection -> refraction -> lens -> principal point
           -> film deformation -> comparator or pixels -> noise and gross errors

(see aatri.simulation.forward, .film, .earth). Each effect has a switch, and each its own random stream: flight,
terrain and points stay the same when an effect is switched, but for points that leave the format. The a-priori
standard deviations stay in the block when the noise is switched off. A tangent frame has no false origin.

Sources: docs/formulas.md 2.3 (refraction), 2.5 (lens), 2.2 (film), 4.6 (the RC-30 block).
"""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from pydantic import model_validator

from aatri.artifacts.block import Block
from aatri.plugin import SILENT, Context, Field, Options, stage
from aatri.simulation import earth, flight, settings
from aatri.simulation.assembly import Scene, assembled
from aatri.simulation.earth import random_surface
from aatri.simulation.epochs import streams_of_site, with_moved_points
from aatri.simulation.geodetic import GeodeticEarth
from aatri.simulation.measured import STREAMS, Disturbance
from aatri.simulation.points import GroundSurface, ground_targets
from aatri.simulation.presets import PRESETS
from aatri.simulation.rays import Photography
from aatri.simulation.rig import rigged
from aatri.simulation.structures import planned_structures
from aatri.simulation.survey_settings import SurveyOptions


class SimulateOptions(Options):
    """What is simulated. A preset's values lie under those given here."""

    preset: Literal["rc30", "uav", "orbit", "oblique", "hover", "test_field", "sample"] | None = Field(
        None,
        description="rc30: 255 film images, 9 + 2 strips, 1:2500; uav: 200 images of 20 megapixels; orbit: 36 images "
        "around a place; oblique: five cameras, 75 images; hover: 36 images over 9 places; sample: 3 strips of 5 "
        "images, 35 points at the standard positions",
    )
    name: str = Field("simulated", description="name of the block")
    camera: settings.CameraOptions = Field(settings.CameraOptions(), description="camera and lens")
    flight: settings.FlightOptions = Field(
        settings.FlightOptions(), description="strips, overlaps, scale, irregularities"
    )
    terrain: settings.TerrainOptions = Field(settings.TerrainOptions(), description="the ground")
    ties: settings.TieOptions = Field(settings.TieOptions(), description="new points")
    known: settings.ControlOptions = Field(settings.ControlOptions(), description="control and check points")
    gnss: settings.GnssOptions = Field(settings.GnssOptions(), description="positions of the stations")
    imu: settings.ImuOptions = Field(settings.ImuOptions(), description="attitudes of the stations")
    survey: SurveyOptions = Field(SurveyOptions(), description="geodetic observations and relative control")
    rig: dict[str, settings.RigMemberOptions] = Field(
        {}, description="cameras beside the frame at every station, by name"
    )
    earth: Literal["flat", "tangent", "map", "geodetic"] = Field(
        "flat",
        description="flat: Cartesian; sphere in a Cartesian tangent frame; sphere in a map (east, north, height); "
        "geodetic: ellipsoid in the map `crs`",
    )
    crs: str = Field("EPSG:32650", description="map of the geodetic earth: a projected CRS as pyproj reads it")
    undulation_m: float = Field(0.0, description="geodetic earth: ellipsoidal heights less heights of the block, m")
    false_origin_m: tuple[float, float] = Field((0.0, 0.0), description="added to east and north (flat and map), m")
    refraction: Literal["none", "radial", "vertical_plane"] = Field(
        "radial", description="off; along the image radius, as corrections assume; in the vertical plane of each ray"
    )
    film: settings.FilmOptions = Field(settings.FilmOptions(), description="film deformation, place on the comparator")
    noise: settings.NoiseOptions = Field(
        settings.NoiseOptions(), description="standard deviations; `noise: false` is factor 0"
    )
    gross_errors: settings.GrossErrorOptions = Field(settings.GrossErrorOptions(), description="gross errors")
    epoch: settings.EpochOptions = Field(settings.EpochOptions(), description="one of several epochs of one object")

    @model_validator(mode="before")
    @classmethod
    def _lay_over_preset(cls, values: Any) -> Any:
        if not isinstance(values, Mapping):
            return values
        switch = values.get("noise")
        values = {**values, "noise": {"factor": float(switch)}} if isinstance(switch, bool) else values
        preset = values.get("preset")
        return settings.over_preset(PRESETS.get(preset, {}) if isinstance(preset, str) else {}, values)


@stage(version=1, uses=())
def simulate(
    *, options: SimulateOptions = SimulateOptions(), rng: np.random.Generator, context: Context = SILENT
) -> Block:
    """Simulate a block.

    Raises
    ------
    GeometryError
        If the overlaps do not allow the points asked for.
    InputError
        If the distortion is too strong or more gross errors are asked for than there are observations.
    """
    streams = dict(zip(STREAMS, rng.spawn(len(STREAMS)))) | streams_of_site(options.epoch.site)
    height_m = options.terrain.mean_height_m
    false_origin = (0.0, 0.0) if options.earth == "tangent" else options.false_origin_m
    surface = random_surface(height_m, options.terrain.relief_m, options.terrain.wavelength_m, streams["terrain"])
    plan = flight.planned(options.flight, options.camera, height_m)
    station, rotation = flight.flown(plan, options.flight, options.camera, streams["flight"])
    photography = Photography(
        camera=options.camera,
        spherical=options.earth != "flat",
        refraction=options.refraction,
        terrain_height_m=height_m,
        station_m=earth.settled(station, false_origin),
        rotation=rotation,
        geodetic=GeodeticEarth(options.crs, false_origin, options.undulation_m)
        if options.earth == "geodetic"
        else None,
    )
    context.log(f"{len(plan.id)} stations flown, {plan.base_m:.1f} m apart, strips {plan.spacing_m:.1f} m apart")
    plan_with_rig = rigged(plan, photography, options.rig)
    disturbance = Disturbance(options.noise, options.gross_errors, streams)
    points = ground_targets(
        plan_with_rig.photography,
        plan,
        GroundSurface(surface, false_origin),
        options.flight,
        options.ties,
        options.known,
        planned_structures(options.survey, disturbance),
        streams,
    )
    points = with_moved_points(points, plan_with_rig.photography, options.epoch, streams["movement"])
    context.log(f"{len(points.id)} points, {len(points.rays.image)} image points")
    scene = Scene(
        options.name,
        options.earth,
        false_origin,
        plan_with_rig.plan,
        plan_with_rig.photography,
        points,
        plan_with_rig.member,
        options.rig,
    )
    return assembled(scene, options.film, options.gnss, options.imu, options.survey, disturbance)
