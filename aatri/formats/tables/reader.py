"""Reading of a block folder, the native input: block.yaml and CSV tables -> Block.

The folder is described in docs/formats.md. Everything is read and checked before anything is said, so that all faults
come at once, each with file, line and character. What is read is turned into metres, millimetres, radians and
right-handed axes, and sorted into canonical order. What of it cannot be used is set aside later (`checks.as_read`).
"""

from pathlib import Path
from typing import Any

import numpy as np

from aatri.artifacts.block import Block, Frames
from aatri.artifacts.builder import block_of
from aatri.errors import AatriError, InputError, raise_all
from aatri.formats.tables.cameras import camera_tables, rig_member_table
from aatri.formats.tables.covariances import read_covariances
from aatri.formats.tables.exterior import exterior_columns
from aatri.formats.tables.geodetic import geodetic_columns
from aatri.formats.tables.geographic import map_or_not, with_metric_frame
from aatri.formats.tables.ground import Bodies, ground_point_columns, joined, without_bodies
from aatri.formats.tables.images import fiducial_point_columns, image_columns, image_point_columns
from aatri.formats.tables.relative_control import relative_control_tables
from aatri.formats.tables.settings.block import Settings
from aatri.formats.tables.settings.reading import read_settings
from aatri.formats.tables.source import EDITS, FILES, Source
from aatri.formats.text.text_file import missing
from aatri.frames.checks import fault_of_frame
from aatri.frames.conversion import Frame
from aatri.frames.heights import is_tangent_frame
from aatri.frames.tangent import check_convertible
from aatri.ids import did_you_mean, shown
from aatri.progress import SILENT, Reporter

NETWORK = {"geodetic.csv", "relative_control.yaml"}
"""Files of which one makes a block without images worth while."""

OF_IMAGES = {"image_points.csv", "fiducials.csv", "exterior.csv"}
"""Files that name images."""

IDLE_PIXELS = {
    (True, True): "size, origin and y bear",
    (True, False): "size bears",
    (False, True): "origin and y bear",
}
"""What of `pixel` bears on nothing: by whether its size does, and whether an origin is given."""


def read_block(folder: Path, reporter: Reporter = SILENT) -> Block:
    """Read a block folder.

    Parameters
    ----------
    reporter : Reporter
        Gets warnings.

    Raises
    ------
    InputError
        If the folder or a file is missing or breaks the contract. Several faults come as one `Errors`.
    """
    if not folder.exists():
        raise missing(folder)
    if not folder.is_dir():
        raise InputError("is a file, not a block folder", where=str(folder), remedy=f"name the folder {folder.parent}")
    settings, document = read_settings(folder / "block.yaml")
    source = Source(folder, settings, document, reporter)
    _check_files(source)
    _check_frames(source)
    return _block(with_metric_frame(source))


def _block(source: Source) -> Block:
    camera = camera_tables(source)
    cameras = {str(name): k for k, name in enumerate(camera.cameras.id)}
    rigs = rig_member_table(source)
    images = image_columns(source, camera.cameras)
    if not images.get("id"):
        raise_all(source.problems)  # else every row that names an image would be one more fault
    if not (source.folder / "image_points.csv").exists() and images.get("id") and not any(images.get("path", ())):
        source.problems.append(missing(source.folder / "image_points.csv", FILES))  # nothing to find points in either
    _tell_idle_pixels(source, {c for c, path in zip(images.get("camera", ()), images.get("path", ())) if path})
    camera_of = {image: cameras.get(name, 0) for image, name in zip(images.get("id", ()), images.get("camera", ()))}
    measured, surveyed = source.table("image_points.csv"), source.table("ground_points.csv")
    points = [name for table in (measured, surveyed) if table is not None for name in set(table.text["point"])]
    image_points = {} if measured is None else image_point_columns(source, measured, camera_of, camera.cameras)
    fiducial_points = fiducial_point_columns(source, camera_of, camera.cameras, camera.fiducials)
    covariances = read_covariances(source)
    surveyed, bodies = without_bodies(source, surveyed)
    ground, between_points = ground_point_columns(source, surveyed, covariances)
    exterior = exterior_columns(source, camera_of)
    geodetic = joined(Bodies(*geodetic_columns(source, camera_of, points, covariances), ()), bodies)
    try:
        relative, members = relative_control_tables(source, camera_of, points, bodies.planes)
    except AatriError as error:
        raise_all([*source.problems, error])
        raise
    raise_all(source.problems)
    if question := map_or_not(source, ground):
        source.reporter.warn(question)
    return block_of(
        **_earth_and_names(source),
        files=[source.folder / name for name in FILES],
        rig_members=rigs,
        **camera._asdict(),
        images=images,
        points=points,
        image_points=image_points,
        fiducial_points=fiducial_points,
        ground_points=ground,
        ground_point_covariances=between_points,
        exterior=exterior,
        geodetic=geodetic.distances,
        geodetic_covariances=geodetic.covariances,
        relative_control=relative,
        relative_control_members=members,
    )


def _earth_and_names(source: Source) -> dict[str, Any]:
    """What block.yaml says of the block at large; keys that bear on nothing are told."""
    settings = source.settings
    height, undulation = settings.terrain_height, settings.undulation
    if height is not None:
        source.reporter.log(
            "terrain_height is for refraction and earth curvature (image_refinement), and for what is "
            "said of positions; an adjustment alone has no use for it"
        )
    curvature = settings.earth_curvature or _earth_curvature(source)
    if source.levelled and undulation is not None:
        frames = shown(sorted(source.levelled))
        source.reporter.log(f"undulation: the ellipsoidal heights of frame {frames} less {undulation:g} m")
        undulation = undulation if curvature == "frame" else None  # all that it was for is done
    return {
        "name": settings.name or source.folder.resolve().name,
        "rotation": settings.rotation or "omega-phi-kappa",
        "earth_curvature": curvature,
        "terrain_height_m": np.nan if height is None else float(height),
        "undulation_m": np.nan if undulation is None else float(undulation),
        "heading": settings.heading or "true",
        "frames": _frames(settings),
    }


def _tell_idle_pixels(source: Source, with_path: set[str]) -> None:
    """Say what `pixel` says of cameras for nothing, whose image coordinates are in mm.

    The size is for formats of digital cameras, for photographs (the cameras `with_path`) and for sigmas in pixels.
    """
    idle: dict[str, list[str]] = {}
    in_px = source.settings.units.sigma_image == "px"
    for name, c in source.settings.cameras.items():
        if c.image_coordinates == "pixel" or c.pixel is None:
            continue
        has_use = in_px or name in with_path or (c.kind == "digital" and c.format)
        words = IDLE_PIXELS.get((not has_use, c.pixel.origin is not None))
        if words:
            idle.setdefault(words, []).append(name)
    for words, names in idle.items():
        source.reporter.log(f"pixel: {words} on nothing, image coordinates are in mm: camera {shown(names)}")


def _check_files(source: Source) -> None:
    """What must be there is there; a table with an unknown name is pointed out."""
    folder = source.folder
    here = {entry.name for entry in folder.iterdir()}
    if "images.csv" not in here and (not here & NETWORK or here & OF_IMAGES or source.settings.cameras):
        source.problems.append(missing(folder / "images.csv", FILES))
    for name in sorted(here - {*FILES, EDITS}):
        if name.endswith((".csv", ".yaml")) and not name.startswith("x_"):
            source.reporter.warn(f"{folder / name}: not a table of a block, not read{did_you_mean(name, FILES)}")


def _check_frames(source: Source) -> None:
    """Declared systems are known, and the axes are theirs."""
    for name, f in source.settings.frames.items():
        fault = fault_of_frame(Frame(name, tuple(f.axes), f.crs, f.vertical))
        if fault is not None:
            key, what, remedy = fault
            where = source.document.where("frames", name, key)
            source.problems.add(f"frame {name}: {what}", where, remedy)
    raise_all(source.problems)


def _frames(settings: Settings) -> Frames:
    frames = settings.frames
    return Frames.of(
        id=list(frames),
        axes=[",".join(f.axes) for f in frames.values()],
        crs=[f.crs for f in frames.values()],
        vertical=[f.vertical for f in frames.values()],
    )


def _earth_curvature(source: Source) -> str:
    """Where the file does not say: a tangent frame where the CRS can be converted, else correction of the images.

    A local frame and a tangent frame are Cartesian as they are.
    """
    settings = source.settings
    name, first = next(iter(settings.frames.items()))
    if first.crs == "local" or is_tangent_frame(first.crs):
        return "ignore"
    try:
        check_convertible(Frame(name, tuple(first.axes), first.crs, first.vertical))
    except InputError as error:
        if settings.undulation is not None:
            return "frame"
        where = source.document.where("frames", name, "vertical" if first.vertical else "crs")
        source.reporter.warn(
            f"{where}: no adjustment in a tangent frame, the earth's curvature is corrected in the images instead: "
            f"{error.what}; install the grid, give undulation, or write earth_curvature: correct"
        )
        return "correct"
    return "frame"
