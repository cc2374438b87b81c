"""What a bundle adjustment uses of a Block, by the names of `aatri.artifacts.offers`."""

from collections.abc import Collection

from aatri.adapters.cameras.unknowns import MODELS
from aatri.camera.models.calibration import PARAMETERS
from aatri.observations.kinds import catalogue as kinds

CAMERAS = tuple(
    f"camera_parameters:{distortion}.{name}" for distortion, model in MODELS.items() for name in PARAMETERS[model]
)
"""Standard deviations of the parameters that the camera models of the adjustment have."""


def used(
    *,
    marked: bool,
    sessions: bool,
    levels: Collection[str] = (),
    flights: bool = False,
    observed_flights: bool = False,
    row_times: bool = False,
) -> tuple[str, ...]:
    """Names of what is used.

    Parameters
    ----------
    marked : bool
        The datum rests on marked points.
    sessions : bool
        Additional parameters are those of sessions.
    levels : collection of str
        What has a variance component of its own.
    flights : bool
        Image points of a flight share parameters.
    observed_flights : bool
        Positions or attitudes of a flight share a drift, or are tested together.
    row_times : bool
        Cameras move while rows are read out.
    """
    own = ("images.strip", "cameras.distortion", "earth_curvature:frame", "undulation", *CAMERAS)
    optional = (
        ("ground_points.datum", marked),
        ("ground_points.datum:placed", marked),
        ("images.session", sessions),
        ("images.flight", flights or "flight" in levels),
        ("images.flight:observed", flights or observed_flights or "flight" in levels),
        ("image_points.group", "group" in levels),
        ("image_points.row_time_s", row_times),
    )
    return (*kinds.USES, *own, *(name for name, requested in optional if requested))
