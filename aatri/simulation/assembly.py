"""Everything simulated put into a Block: ids in canonical order, tables, truth.

Truth is in the frame of the Block: on a flat earth and in a map, coordinates with the false origin and rotations to the
axes (east, north, up) of each station; in a tangent frame, Cartesian coordinates and rotations to its axes.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.arrays import Float, Int, Text
from aatri.artifacts import block as b
from aatri.simulation import film, measured, rig
from aatri.simulation.attitudes import observed_attitudes
from aatri.simulation.flight import FlightPlan
from aatri.simulation.measured import Disturbance
from aatri.simulation.points import GroundTargets
from aatri.simulation.rays import Photography, cartesian, cartesian_rotation
from aatri.simulation.settings import BROWN, CameraOptions, FilmOptions, GnssOptions, ImuOptions, RigMemberOptions
from aatri.simulation.structures import relative_control
from aatri.simulation.survey import sighted
from aatri.simulation.survey_settings import SurveyOptions
from aatri.simulation.survey_tables import surveyed
from aatri.units import EARTH_RADIUS_M, LENGTH_MM


@dataclass(frozen=True)
class Scene:
    """The true state of affairs."""

    name: str
    earth: str  # flat, tangent, map or geodetic
    false_origin_m: tuple[float, float]
    plan: FlightPlan
    photography: Photography
    points: GroundTargets
    member: Text
    rig: dict[str, RigMemberOptions]

    def in_block_frame(self, local_m: Float) -> Float:
        """Coordinates of the Block from local (E, N, h)."""
        if self.earth == "tangent":
            return cartesian(local_m, True)
        return np.asarray(local_m + np.array([*self.false_origin_m, 0.0]))


def assembled(
    scene: Scene,
    settings: FilmOptions,
    gnss: GnssOptions,
    imu: ImuOptions,
    survey: SurveyOptions,
    disturbance: Disturbance,
) -> b.Block:
    """The Block of a scene as the instruments saw it."""
    camera, points, plan = scene.photography.camera, scene.points, scene.plan
    of_image, of_point = _canonical(plan.id), _canonical(points.id)
    image_row, point_row = np.argsort(of_image), np.argsort(of_point)
    image, point = image_row[points.rays.image], point_row[points.rays.point]
    order = np.lexsort((point, image))
    marks = film.fiducial_marks(camera)
    placement = film.placed(len(of_image), settings, disturbance.streams["film"])
    stations, xyz = scene.in_block_frame(scene.photography.station_m), scene.in_block_frame(points.local_m)
    world = scene.photography.geodetic
    surveyed = np.flatnonzero((points.role[of_point] > 0).any(axis=1))
    image_points, gross_image = measured.image_points(
        image[order], point[order], points.rays.photo_mm[order], camera, placement, disturbance
    )
    fiducial_points, gross_fiducial = measured.fiducial_points(
        len(of_image), np.array(list(marks.values())).reshape(-1, 2), placement, disturbance
    )
    ground, gross_control = measured.ground_points(
        surveyed, xyz[of_point[surveyed]], points.role[of_point[surveyed]], disturbance
    )
    photography = scene.photography
    rotation = cartesian_rotation(photography.station_m, photography.rotation, scene.earth == "tangent")
    true_images = b.TrueImages.of(
        image=np.arange(len(of_image)), position_m=stations[of_image], ground_from_image=rotation[of_image]
    )
    exterior, gross_exterior = _exterior(scene, of_image, true_images.ground_from_image, gnss, imu, disturbance)
    observed, gross_survey = _survey(scene, survey, disturbance)
    return b.Block(
        name=scene.name,
        rotation=imu.rotation,
        earth_curvature={"map": "correct", "geodetic": "frame"}.get(scene.earth, "ignore"),
        terrain_height_m=scene.photography.terrain_height_m,
        undulation_m=(world.undulation_m or np.nan) if world else np.nan,
        heading=imu.heading,
        frames=b.Frames.of(
            id=[_FRAME[scene.earth]], axes="east,north,up", crs=world.crs if world else _CRS[scene.earth], vertical=""
        ),
        **_camera_tables(camera, marks, gnss, imu),
        **_images(plan, of_image, scene.member),
        fiducial_points=fiducial_points,
        points=b.Points(id=np.array(points.id)[of_point]),
        image_points=image_points,
        ground_points=ground,
        exterior=exterior,
        rig_members=rig.rig_table(scene.rig),
        **observed,
        files=b.Files.empty(),
        ground_point_covariances=b.GroundPointCovariances.empty(),
        rejects=b.Rejects.empty(),
        true_images=true_images,
        true_points=b.TruePoints.of(point=np.arange(len(xyz)), xyz_m=xyz[of_point]),
        gross_errors=_gross([gross_image, gross_fiducial, gross_control, *gross_exterior, *gross_survey]),
    )


_FRAME = {"flat": "local", "tangent": "tangent", "map": "map", "geodetic": "map"}
_CRS = {
    "flat": "local",
    "tangent": f"+proj=topocentric +R={EARTH_RADIUS_M:.0f} +lat_0=0 +lon_0=0 +h_0=0",
    "map": "local",
}


def _exterior(
    scene: Scene, of_image: Int, ground_from_image: Float, gnss: GnssOptions, imu: ImuOptions, disturbance: Disturbance
) -> tuple[b.Exterior, list[tuple[Any, ...]]]:
    """Positions of antennas and attitudes, of a rig those of its frame, and the gross errors in them."""
    plan, photography = scene.plan, scene.photography
    antennas = scene.in_block_frame(photography.moved(gnss.lever_arm_m))
    exterior, gross_position = measured.exterior(
        antennas[of_image], scene.in_block_frame(plan.position_m)[of_image], plan, of_image, gnss, disturbance
    )
    gross_attitude: tuple[Any, ...] = ("attitude", np.zeros(0, np.int64), np.zeros((0, 3)))
    if imu.observed:
        exterior, gross_attitude = observed_attitudes(
            exterior if len(exterior) else b.Exterior.of(image=np.arange(len(of_image))),
            ground_from_image,
            plan,
            of_image,
            imu,
            -photography.camera.mounting_deg % 360,
            photography.convergence_rad()[of_image],
            disturbance,
        )
    at_frame = np.flatnonzero(np.isin(scene.member[of_image][exterior.image], ("", rig.FRAME)))
    return exterior.take(at_frame), [_of_rows(gross, at_frame) for gross in (gross_position, gross_attitude)]


def _survey(
    scene: Scene, survey: SurveyOptions, disturbance: Disturbance
) -> tuple[dict[str, Any], list[tuple[Any, ...]]]:
    """Tables of geodetic observations and relative control, and the gross errors in them."""
    points, photography = scene.points, scene.photography
    candidates = np.flatnonzero(~points.in_structure)
    seen = sighted(survey, photography, points.local_m, candidates, scene.in_block_frame, disturbance.streams["survey"])
    geodetic, covariances, gross = surveyed(seen, np.array(points.id), np.array(scene.plan.id), disturbance)
    control, members, of_control = relative_control(points.structures, photography, scene.in_block_frame)
    return {
        "geodetic": geodetic,
        "geodetic_covariances": covariances,
        "relative_control": control,
        "relative_control_members": members,
    }, [*gross, *of_control]


def _canonical(ids: list[str]) -> Int:
    """Rows in the order of the ids' bytes (for ASCII the order of NumPy's text)."""
    return np.argsort(np.array(ids), kind="stable")


def _camera_tables(
    camera: CameraOptions, marks: dict[str, tuple[float, float]], gnss: GnssOptions, imu: ImuOptions
) -> dict[str, Any]:
    digital = camera.kind == "digital"
    brown = (
        [n for n in sorted(BROWN) if n in camera.brown]
        if camera.distortion == "brown" and camera.distortion_known
        else []
    )
    table = camera.distortion == "table" and camera.distortion_known
    turns = [f"boresight.{axis}" for axis in "xyz"] if imu.observed and imu.boresight in ("weighted", "free") else []
    radius = camera.table_radius_mm if table else ()
    correction = np.array(camera.table_correction_um if table else (), dtype=float) * LENGTH_MM["um"]
    weight = np.radians(imu.boresight_sigma_deg) if imu.boresight == "weighted" else np.nan
    return {
        "cameras": b.Cameras.of(
            id=[camera.id],
            kind=camera.kind,
            image_coordinates="pixel" if digital else "comparator",
            pixel_size_mm=camera.pixel_size_mm if digital else np.nan,
            pixel_origin="top-left-corner" if digital else "",
            pixel_y="down" if digital else "",
            format=camera.format,
            principal_distance_mm=camera.principal_distance_mm,
            principal_point_mm=camera.principal_point_mm,
            symmetry_point_mm=camera.symmetry_point_mm,
            distortion=camera.distortion if camera.distortion_known else "none",
            lever_arm_m=gnss.lever_arm_m,
            boresight_rad=np.radians(imu.boresight_deg) if imu.boresight == "known" else 0.0,
            mount_deg=-camera.mounting_deg % 360 if imu.rotation == "roll-pitch-heading" else 0,
        ),
        "camera_parameters": b.CameraParameters.of(
            camera=[0] * (len(turns) + len(brown)),
            name=[*turns, *brown],
            value=[np.nan] * len(turns) + [camera.brown[n] for n in brown],
            sigma=[weight] * len(turns) + [np.nan] * len(brown),
            free=[imu.boresight == "free"] * len(turns) + [False] * len(brown),
        ),
        "distortion_table": b.DistortionTable.of(camera=[0] * len(radius), radius_mm=radius, correction_mm=correction),
        "fiducials": b.Fiducials.of(camera=[0] * len(marks), id=list(marks), xy_mm=list(marks.values())),
    }


def _images(plan: FlightPlan, of_image: Int, member: Text) -> dict[str, Any]:
    mounted = member[of_image]
    strips, strip = np.unique(np.array(plan.strip), return_inverse=True)
    return {
        "strips": b.StripIds(id=strips),
        "images": b.Images.of(
            id=np.array(plan.id)[of_image],
            camera=0,
            strip=strip[of_image],
            sequence=plan.sequence[of_image],
            time_s=plan.time_s[of_image],
            rig=np.where(mounted == "", "", rig.NAME),
            member=mounted,
        ),
    }


def _of_rows(gross: tuple[Any, ...], rows: Int) -> tuple[Any, ...]:
    """Gross errors of the rows that stay, by their new numbers."""
    kind, chosen, errors = gross
    stays = np.isin(chosen, rows)
    return kind, np.searchsorted(rows, np.asarray(chosen)[stays]), errors[stays]


def _gross(groups: list[tuple[Any, ...]]) -> b.GrossErrors:
    """One table, in the order of the kinds as they come and of their rows."""
    present = [entry for entry in groups if len(entry[1])]
    if not present:
        return b.GrossErrors.empty()
    return b.GrossErrors.of(
        kind=np.concatenate([np.full(len(chosen), kind) for kind, chosen, _ in present]),
        row=np.concatenate([chosen for _, chosen, _ in present]),
        size=np.concatenate([np.pad(errors, ((0, 0), (0, 3 - errors.shape[1]))) for _, _, errors in present]),
    )
