"""A Block of the parts that one or several sources give.

All are brought into one frame (`one_frame`), joined by names (`joined`), and get what no file states: standard
deviations, and what of the cameras is unknown. Images get their order in the sources as sequence where none has one.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from aatri.arrays import Float, Text
from aatri.artifacts.block import Block, DistortionTable
from aatri.artifacts.builder import block_of
from aatri.camera.models.brown import PARAMETERS as BROWN
from aatri.camera.models.calibration import INTERIOR
from aatri.camera.models.forward_models import PARAMETERS as FORWARD
from aatri.codes import CHECK, CONTROL, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.conventions.pixel_origins import PHOTO_MM, PIXEL_MM, PixelAxes, converted, named
from aatri.formats.limits import ANOTHER_LIST
from aatri.formats.parts.block_parts import KINDS, BlockParts, Rows, place, rows_of
from aatri.formats.parts.joined import JoinedParts, joined
from aatri.formats.parts.not_stated import DEFAULTS, NotStated, stated_frame
from aatri.formats.parts.of_block import columns_of_frame
from aatri.formats.parts.one_frame import block_frame, in_frame
from aatri.frames.conversion import Frame
from aatri.geometry.rotations import angles_from_rotation
from aatri.ids import rows_of as rows_in
from aatri.ids import several, shown
from aatri.progress import SILENT, Reporter
from aatri.tables.digest import same_rows
from aatri.tables.schema import columns_of, tables_of

CAMERAS_BESIDE = (
    "add the file with the cameras, or the photographs, as a further `--from`, in a pipeline under `sources`; a camera "
    "of known numbers is a text file of the lines `Name = cam`, `focal = 4100`, `PPAx = 3000`, `PPAy = 2000`, "
    "`width = 6000`, `height = 4000` (px)"
)


def assembled(
    sources: Sequence[BlockParts],
    not_stated: NotStated = DEFAULTS,
    *,
    frame: Frame | None = None,
    reporter: Reporter = SILENT,
) -> Block:
    """The Block of some sources, in a frame if it is not to be that of `not_stated`.

    Raises
    ------
    InputError
        If they contradict each other, or lack what a Block cannot do without: an image's camera, its interior
        orientation, the size of its pixels.
    """
    for one, note in ((parts, note) for parts in sources for note in parts.notes):
        reporter.log(f"{one.files[0]}: {note}")
    origin = not_stated.origin("control_sigma", sources)
    not_stated = not_stated.beside([parts.not_stated for parts in sources])
    frame = block_frame(list(sources), frame or stated_frame(not_stated.crs, not_stated.vertical))
    if len(sources) == 1 and (parts := sources[0]).ground_points and "geodetic" in parts.others and not parts.images:
        points = {n: v for n, v in rows_of(parts, "ground_points").items() if n in columns_of(KINDS["ground_points"])}
        name = not_stated.name or parts.name or parts.format
        return block_of(
            name=name, files=parts.files, ground_points=points, **columns_of_frame(frame) | dict(parts.others)
        )
    tables = joined([in_frame(parts, frame, reporter) for parts in sources], reporter)
    _give_cameras(tables)
    _count_from_camera(tables)
    rows = tables.tables
    _give_sigmas(tables, not_stated, origin, reporter)
    _check_versions(tables)
    rows["exterior"] = _with_angles(rows["exterior"])
    rows["camera_parameters"] = _held_or_free(rows["cameras"], rows["camera_parameters"], not_stated.calibrate)
    by_kind: dict[str, Any] = {
        kind: {n: v for n, v in rows[kind].items() if n in columns_of(KINDS[kind])} for kind in KINDS
    }
    if by_kind["images"] and np.isnan(by_kind["images"]["sequence"]).all():
        by_kind["images"]["sequence"] = np.arange(1.0, len(by_kind["images"]["id"]) + 1)
    _check_others(sources, by_kind)
    others = dict(sources[0].others) | _distortion_tables(sources, rows["cameras"]["id"])
    return block_of(
        name=not_stated.name or sources[0].name or sources[0].format,
        files=tables.files,
        **(by_kind | ({} if "frames" in others else columns_of_frame(frame)) | others),
    )


def _check_others(sources: Sequence[BlockParts], by_kind: dict[str, Any]) -> None:
    """Tables that are taken as they are belong to the first source, and count in its rows."""
    for parts in sources[1:]:
        others = {k: v for k, v in parts.others.items() if k in tables_of(Block) and k != "distortion_table"}
        tables = sorted(k for k, v in others.items() if not same_rows(v, sources[0].others.get(k)))
        if tables:
            what = f"its {', '.join(tables).replace('_', ' ')} would be lost beside {sources[0].format}"
            raise InputError(what, where=str(parts.files[0]), remedy="give it as the first source")
    own = sources[0].ground_points.get("point", np.zeros(0, "U1"))
    if "ground_point_covariances" in sources[0].others and not np.array_equal(by_kind["ground_points"]["point"], own):
        what = "another source gives ground points, which the covariances between those of the first do not count in"
        raise InputError(what, where=str(sources[0].files[0]), remedy="write all control into ground_points.csv")


def _distortion_tables(sources: Sequence[BlockParts], cameras: Text) -> dict[str, Any]:
    """Radial distortions as tables, of sources that give them by the ids of their cameras."""
    tables = [parts.others.get("distortion_table") for parts in sources]
    named = [table for table in tables if isinstance(table, dict)]
    if not named:
        return {}
    every = {name: np.concatenate([np.asarray(t[name]) for t in named]) for name in columns_of(DistortionTable)}
    kept = np.isin(every["camera"], cameras)
    row = np.argsort(np.argsort(cameras))[rows_in(every["camera"][kept], cameras)]
    order = np.lexsort((every["radius_mm"][kept], row))
    columns = {name: values[kept][order] for name, values in every.items()} | {"camera": row[order]}
    return {"distortion_table": DistortionTable.of(**columns)}


def _check_versions(tables: JoinedParts) -> None:
    """Refuse two files with other coordinates of the same image points: no repeated measurement, but another list."""
    points = tables.tables["image_points"]
    if not points or len(np.unique(points["file"])) < 2:
        return
    order = np.lexsort((points["file"], points["point"], points["image"]))
    a, b = order[:-1], order[1:]
    again = (points["image"][a] == points["image"][b]) & (points["point"][a] == points["point"][b])
    again &= points["file"][a] != points["file"][b]
    size = _pixel_mm(tables, points["image"])
    for first, second in sorted({(points["file"][i], points["file"][j]) for i, j in zip(a[again], b[again])}):
        pair = again & (points["file"][a] == first) & (points["file"][b] == second)
        apart = np.abs(points["xy"][a[pair]] - points["xy"][b[pair]])
        by_sigma = apart * size[a[pair]] / points["sigma_mm"][a[pair]]
        if float(np.median(by_sigma.max(axis=1))) > ANOTHER_LIST:
            others = f"{int(pair.sum())} of its image points have other coordinates in {tables.files[first]}"
            unit, where = "mm" if (size[a[pair]] == 1).all() else "px", place(points, int(b[pair][0]), tables.files)
            names = " or ".join(f"--without {tables.files[k].name}" for k in (first, second))
            remedy = f"two versions of one list? Give one of them; of a folder leave one out: {names}"
            raise InputError(f"{others}, up to {apart.max():.4g} {unit} apart", where=where, remedy=remedy)


def _pixel_mm(tables: JoinedParts, images: Text) -> Float:
    """Size of a pixel of each row's camera (n, 2), mm; 1 where coordinates are mm."""
    rows, cameras = tables.tables["images"], tables.tables["cameras"]
    of_camera = {
        str(name): np.ones(2) if coordinates == "photo" else size
        for name, coordinates, size in zip(cameras["id"], cameras["image_coordinates"], cameras["pixel_size_mm"])
    }
    of_image = {str(name): of_camera[str(camera)] for name, camera in zip(rows["id"], rows["camera"])}
    return np.array([of_image[str(name)] for name in images]).reshape(-1, 2)


def _give_cameras(tables: JoinedParts) -> None:
    """Every image has a camera with what a Block needs of it."""
    images, cameras = tables.tables["images"], tables.tables["cameras"]
    ids = cameras.get("id", np.zeros(0, "U1")).tolist()
    without = np.flatnonzero(images["camera"] == "")
    if len(without) and len(ids) == 1:
        images["camera"] = np.where(images["camera"] == "", ids[0], images["camera"])
    elif len(without):
        what = (
            f"no source says which camera took {several(len(without), 'image')}: "
            f"{shown(images['id'][without].tolist(), 3)}"
        )
        there = f"; cameras: {shown(ids, 5)}" if ids else ", and none gives a camera"
        remedy = CAMERAS_BESIDE if not ids else "add the file that names the camera of each image, or give one camera"
        raise InputError(what + there, where=str(tables.files[0]), remedy=remedy)
    missing = sorted({*images["camera"].tolist()} - {*ids})
    if missing:
        at = int(np.flatnonzero(images["camera"] == missing[0])[0])
        what = f"no source gives the camera {missing[0]!r}" + (f"; there are {shown(ids, 5)}" if ids else "")
        raise InputError(what, where=place(images, at, tables.files), remedy=CAMERAS_BESIDE)
    bare = np.isnan(cameras["principal_distance_mm"])
    if bare.any():
        what = f"the principal distance of camera {ids[int(np.flatnonzero(bare)[0])]} is not known"
        raise InputError(what, where=str(tables.files[0]), remedy=CAMERAS_BESIDE)


def _count_from_camera(tables: JoinedParts) -> None:
    """Image points of sources that count from elsewhere than the camera of the image says, counted as it does."""
    points, cameras, images = (tables.tables[t] for t in ("image_points", "cameras", "images"))
    if not points:
        return
    of_camera = {name: k for k, name in enumerate(cameras["id"].tolist())}
    camera_of = {image: of_camera[c] for image, c in zip(images["id"].tolist(), images["camera"].tolist())}
    camera = np.array([camera_of[str(image)] for image in points["image"].tolist()])
    for k, name in enumerate(cameras["id"].tolist()):
        own = PixelAxes(str(cameras["pixel_origin"][k]), str(cameras["pixel_y"][k]))
        for axes in np.unique(points["pixel_axes"][camera == k]).tolist():
            if axes in ("", PHOTO_MM.name if cameras["image_coordinates"][k] == "photo" else own.name):
                continue
            if cameras["image_coordinates"][k] != "pixel":
                what = f"camera {name} has {cameras['image_coordinates'][k]} coordinates, and a source gives {axes}"
                raise InputError(what, where=str(tables.files[0]), remedy="give the image points of one program")
            of_axes = (camera == k) & (points["pixel_axes"] == axes)
            if axes == PHOTO_MM.name:
                _check_pixel_size(points["xy"][of_axes], cameras, k, str(tables.files[0]))
            points["xy"][of_axes] = converted(
                points["xy"][of_axes], named(axes), own, cameras["format"][k], cameras["pixel_size_mm"][k]
            )


def _check_pixel_size(xy_mm: Float, cameras: Rows, camera: int, where: str) -> None:
    """Refuse millimetres of a camera whose pixels have the nominal size alone, if they lie outside of its format."""
    half_mm = cameras["pixel_size_mm"][camera] * cameras["format"][camera] / 2
    if (cameras["pixel_size_mm"][camera] == PIXEL_MM).all() and (np.abs(xy_mm) > half_mm).any():
        what = f"image points in mm, up to {np.abs(xy_mm).max():.3g} mm from the centre, and camera"
        what = f"{what} {cameras['id'][camera]} counts in pixels of which no file states the size"
        raise InputError(what, where=where, remedy="add the camera in mm, or its calibration with the size of a pixel")


def _give_sigmas(tables: JoinedParts, not_stated: NotStated, origin: str, reporter: Reporter) -> None:
    points, ground, exterior = (tables.tables[t] for t in ("image_points", "ground_points", "exterior"))
    if points:
        points["sigma_mm"] = _image_sigma_mm(tables, not_stated)
    if ground:
        is_ground = np.isin(ground["role"], (CONTROL, CHECK))
        if (_fill(ground["covariance_m2"], np.asarray(not_stated.control_sigma)) & is_ground.any(axis=1)).any():
            text = "control without a standard deviation: {} m is taken ({}; 0 is exact)"
            reporter.log(text.format(list(not_stated.control_sigma), origin))
    if not exterior:
        return
    observed = exterior["position_use"] == OBSERVED_VALUE
    if not_stated.position_sigma is None:
        bare = observed & np.isnan(np.einsum("nii->ni", exterior["position_covariance_m2"])).any(axis=1)
        if bare.any():
            exterior["position_use"] = np.where(bare, 0, exterior["position_use"])
            reporter.log(
                f"start values: {several(int(bare.sum()), 'position')} without a standard deviation; "
                "`position_sigma` makes them observations"
            )
    else:
        _fill(exterior["position_covariance_m2"], np.asarray(not_stated.position_sigma))
    free = exterior["position_use"] != OBSERVED_VALUE
    exterior["position_covariance_m2"][free] = np.nan
    sigma = exterior["angle_sigma_rad"]
    if not_stated.attitude_sigma_deg is not None:
        stated_rad = math.radians(not_stated.attitude_sigma_deg)
        exterior["angle_sigma_rad"] = np.where(np.isnan(sigma), stated_rad, sigma)
    exterior["angle_use"] = np.where(np.isnan(exterior["angle_sigma_rad"]).any(axis=1), 0, exterior["angle_use"])


def _fill(covariance_m2: Float, sigma_m: Float) -> Any:
    """Put standard deviations where a covariance states none, in place; which rows had none."""
    variance = np.einsum("nii->ni", covariance_m2)
    lacking = np.isnan(variance)
    for axis in range(3):
        covariance_m2[lacking[:, axis], axis, axis] = sigma_m[axis] ** 2
    covariance_m2[np.isnan(covariance_m2)] = 0.0  # what is stated or taken by standard deviations has no correlations
    return lacking.any(axis=1)


def _image_sigma_mm(tables: JoinedParts, not_stated: NotStated) -> Float:
    points, cameras, images = (tables.tables[t] for t in ("image_points", "cameras", "images"))
    pixel_mm = dict(zip(cameras["id"].tolist(), np.nan_to_num(cameras["pixel_size_mm"], nan=np.nan).tolist()))
    of_image = dict(zip(images["id"].tolist(), images["camera"].tolist()))
    names, row = np.unique(points["image"], return_inverse=True)
    size = np.array([pixel_mm[of_image[str(name)]] for name in names.tolist()]).reshape(-1, 2)[row.ravel()]
    stated_px = np.where(np.isnan(points["sigma_px"]), not_stated.image_sigma_px, points["sigma_px"])
    sigma = np.where(np.isnan(points["sigma_mm"]), stated_px * size, points["sigma_mm"])
    photo = {str(name) for name, system in zip(cameras["id"], cameras["image_coordinates"]) if system == "photo"}
    in_mm = np.array([of_image[str(name)] in photo for name in names.tolist()])[row.ravel()]
    sigma = np.where(np.isnan(sigma) & in_mm[:, None], not_stated.image_sigma_um * 1e-3, sigma)
    if np.isnan(sigma).any():
        camera = of_image[str(points["image"][int(np.flatnonzero(np.isnan(sigma).any(axis=1))[0])])]
        what = f"camera {camera} has no pixel size, so that standard deviations in pixels have no millimetres"
        raise InputError(what, where=str(tables.files[0]), remedy="give its pixel size")
    return np.asarray(sigma)


def _with_angles(exterior: Rows) -> Rows:
    """Angles omega, phi, kappa where there are rotations."""
    if not exterior:
        return {}
    has_rotation = np.isfinite(exterior["ground_from_image"]).all(axis=(1, 2))
    angles = exterior["angles_rad"].copy()
    if has_rotation.any():
        angles[has_rotation] = angles_from_rotation(exterior["ground_from_image"][has_rotation])
    return exterior | {"angles_rad": angles}


def _held_or_free(cameras: Rows, parameters: Rows, calibrate: bool) -> Rows:
    """Distortion parameters with those not stated as 0, and the interior orientation; all held, or all free."""
    stated = {
        (str(c), str(n)): k for k, (c, n) in enumerate(zip(parameters.get("camera", ()), parameters.get("name", ())))
    }
    made: list[tuple[str, str, float, float, bool]] = []
    for camera, model in zip(cameras["id"].tolist(), cameras["distortion"].tolist()):
        names = FORWARD.get(model, BROWN if model == "brown" else ())
        own = [name for owner, name in stated if owner == camera]
        for name in dict.fromkeys([*names, *own, *INTERIOR]):
            k = stated.get((camera, name))
            value = np.nan if name in INTERIOR else 0.0 if k is None else float(parameters["value"][k])
            sigma, free = 0.0, False
            if k is not None and (parameters["free"][k] or parameters["sigma"][k] > 0):
                sigma, free = float(parameters["sigma"][k]), bool(parameters["free"][k])
            elif calibrate and (name in INTERIOR or k is not None):
                sigma, free = np.nan, True
            made.append((camera, name, value, sigma, free))
    columns = dict(zip(("camera", "name", "value", "sigma", "free"), zip(*made)))
    return rows_of(BlockParts("", [], camera_parameters=columns), "camera_parameters") if made else {}
