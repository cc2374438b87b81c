"""A folder of photographs as the start of a block: images, cameras, positions and attitudes, and no image point yet.

    cameras      make, model, lens and size, and focal length where that differs; pixels of the size that makes both
                 focal lengths, in mm and in pixels, one
    c            weighted by 30 %, never held: the focal length of EXIF is that of the whole sensor, or rounded
    distortion   k1, k2, k3, p1, p2 and the principal point free
    positions    RTK standard deviations of the packet, else those asked for; a start value alone where two images have
                 one position
    attitudes    of the gimbal, 2 degrees

Source: docs/formats.md, photographs.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from aatri.arrays import Bool, Float, Text, finite_rows
from aatri.codes import APPROXIMATE_VALUE, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.conventions.pixel_origins import PIXEL_MM
from aatri.formats.navigation.photograph import ENDINGS, WITHOUT_EXIF, Photograph, read_photograph
from aatri.formats.navigation.xmp import SOME, drone_numbers, drone_packet, files_with, of_gimbal
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import FileView, Format
from aatri.formats.text.text_file import missing
from aatri.frames.conversion import WGS84
from aatri.ids import several, shown
from aatri.progress import SILENT, Reporter

FOCAL_SHARE = 0.3
"""Standard deviation of a focal length of EXIF, as a share of it: 29 % was met in a picture cut out of the sensor."""
FREE = ("principal_point.x", "principal_point.y", "k1", "k2", "k3", "p1", "p2")
POSITION_SIGMA_M = (3.0, 3.0, 10.0)
"""Of a receiver without correction signals, and of its heights, which may be barometric."""
ATTITUDE_SIGMA_DEG = 2.0


def read_photographs(
    folder: Path,
    *,
    position_sigma_m: tuple[float, float, float] = POSITION_SIGMA_M,
    attitude_sigma_deg: float = ATTITUDE_SIGMA_DEG,
    flight_gap_s: float = 600.0,
    shift: bool = False,
    reporter: Reporter = SILENT,
) -> BlockParts:
    """Read the heads of the photographs of a folder and of the folders in it.

    Parameters
    ----------
    position_sigma_m : (3,) float, m
        Of positions without their own: east, north, height.
    attitude_sigma_deg : float, degrees
    flight_gap_s : float, s
        So long without an exposure of a camera a new flight begins; so it does with a folder.
    shift : bool
        The positions of a flight share an unknown shift (a drift group).

    Raises
    ------
    InputError
        If there is no photograph, or one cannot be read.
    """
    if not folder.exists():
        raise missing(folder)
    paths = [folder] if folder.is_file() else sorted(p for p in folder.rglob("*") if p.suffix.lower() in ENDINGS)
    paths = [p for p in paths if not p.name.startswith(".")]
    if not paths:
        raise InputError("no photograph in it", where=str(folder), remedy=f"files that end with {', '.join(ENDINGS)}")
    photos = []
    for k, path in enumerate(paths):
        photos.append(read_photograph(path))
        reporter.progress(k + 1, len(paths), "photographs")
    photos, notes = _once(photos)
    names = _names([p.path for p in photos])
    camera, tables = _cameras(photos, names, notes)
    flight = _flights(photos, camera, flight_gap_s, shift)
    parts = BlockParts("photos", [p.path for p in photos], name=folder.resolve().stem, frame=WGS84, notes=notes)
    at = {"file": np.arange(len(photos)), "line": -1}
    parts.cameras, parts.camera_parameters = tables
    parts.images = {
        "id": names,
        "camera": camera,
        "time_s": [p.time_s for p in photos],
        "flight": flight,
        "path": [str(p.path) for p in photos],
        "content": [p.content for p in photos],
        **at,
    }
    sigmas = np.array(position_sigma_m), np.radians(attitude_sigma_deg)
    parts.exterior = _exterior(photos, names, notes, sigmas, flight if shift else [])
    if not np.isfinite(np.asarray(parts.exterior.get("position_m", []), dtype=float)).any():
        parts.frame = None  # nothing says where on earth they are
    turned = [name for name, p in zip(names, photos) if p.orientation != 1]
    if turned:
        notes.append(
            f"{several(len(turned), 'photograph', 'is', 'are')} marked as turned for viewers; pixels "
            f"count as they lie in the file: {shown(turned)}"
        )
    return parts


def _once(photos: Sequence[Photograph]) -> tuple[list[Photograph], list[str]]:
    """Each photograph once, however many names its file has."""
    first: dict[str, Photograph] = {}
    again = [(p, first[p.content]) for p in photos if first.setdefault(p.content, p) is not p]
    notes = [f"{p.path.name} is the same file as {other.path.name}, byte by byte: it is left out" for p, other in again]
    return list(first.values()), notes


def _names(paths: Sequence[Path]) -> list[str]:
    """Names of files without ending; with it, or with the folder, where that is needed to tell them apart."""
    for name in (lambda p: p.stem, lambda p: p.name, lambda p: f"{p.parent.name}/{p.name}", str):
        names = [name(p) for p in paths]
        if len({n.casefold() for n in names}) == len(names):
            break
    return names


def _cameras(
    photos: Sequence[Photograph], names: Sequence[str], notes: list[str]
) -> tuple[Text, tuple[dict[str, object], dict[str, object]]]:
    """The camera of each photograph, and the tables of cameras and of their open parameters."""
    photos, unknown = [*photos], [k for k, p in enumerate(photos) if not p.focal_px > 0]
    for k in unknown:
        photos[k] = replace(photos[k], focal_px=WITHOUT_EXIF * max(photos[k].size_px), focal_mm=np.nan)
    if unknown:
        notes.append(
            f"{several(len(unknown), 'photograph', 'says', 'say')} no focal length, or 0: {WITHOUT_EXIF} "
            f"times the longer side is taken, by {FOCAL_SHARE:.0%}: {shown(names[k] for k in unknown)}"
        )
    focal = {(p.camera, round(p.focal_px, 1)): p for p in photos}
    of_two = {name for name, _ in focal if sum(own_name == name for own_name, _ in focal) > 1}
    ids = {key: f"{key[0]}-{key[1]:.0f}px" if key[0] in of_two else key[0] for key in focal}
    shapes = {(p.model, p.size_px) for p in photos}
    turned = [
        name for name, p in zip(names, photos) if p.size_px[0] != p.size_px[1] and (p.model, p.size_px[::-1]) in shapes
    ]
    if turned:
        notes.append(
            f"photographs of one model lie upright and across, {len(turned)} in all: a program has turned "
            f"their pixels, or the camera was turned; they count as two cameras: {shown(turned)}"
        )
    sizes = {model: sorted({size for own_model, size in shapes if own_model == model}) for model, _ in shapes}
    for model, several_sizes in sorted(sizes.items()):
        if len({tuple(sorted(size)) for size in several_sizes}) > 1:
            count = Counter(p.size_px for p in photos if p.model == model)
            named = ", ".join("{}x{} ({})".format(*size, count[size]) for size in several_sizes)
            notes.append(
                f"photographs of {model or 'no stated model'} have several sizes, each a camera of its own: {named}; "
                "of one flight take them all as the camera wrote them"
            )
    size_mm = [p.focal_mm / p.focal_px if p.focal_mm > 0 else PIXEL_MM for p in focal.values()]
    c_mm = np.array([p.focal_px for p in focal.values()]) * size_mm
    cameras: dict[str, object] = {
        "id": list(ids.values()),
        "kind": "digital",
        "image_coordinates": "pixel",
        "pixel_size_mm": np.column_stack([size_mm, size_mm]),
        "pixel_origin": "top-left-centre",
        "pixel_y": "down",
        "format": [p.size_px for p in focal.values()],
        "principal_distance_mm": c_mm,
        "distortion": "brown",
    }
    rows = [(name, "principal_distance", np.nan, FOCAL_SHARE * c, False) for name, c in zip(ids.values(), c_mm)]
    rows += [
        (name, parameter, np.nan if "point" in parameter else 0.0, np.nan, True)
        for name in ids.values()
        for parameter in FREE
    ]
    parameters: dict[str, object] = dict(zip(("camera", "name", "value", "sigma", "free"), map(list, zip(*rows))))
    return np.array([ids[p.camera, round(p.focal_px, 1)] for p in photos]), (cameras, parameters)


def _flights(photos: Sequence[Photograph], camera: Text, gap_s: float, shift: bool) -> list[str]:
    """The flight of each photograph, by folder, camera and gaps in time; nothing where all are of one."""
    flights = [""] * len(photos)
    kind = [(str(p.path.parent), str(c)) for p, c in zip(photos, camera)]
    number = 0
    for one_kind in sorted(set(kind)):
        rows = sorted((k for k in range(len(photos)) if kind[k] == one_kind), key=lambda k: (photos[k].time_s, k))
        number += 1
        for before, k in zip([rows[0], *rows], rows):
            number += photos[k].time_s - photos[before].time_s > gap_s
            flights[k] = f"flight{number}"
    return flights if len(set(flights)) > 1 or shift else [""] * len(photos)


def _exterior(
    photos: Sequence[Photograph],
    names: Sequence[str],
    notes: list[str],
    sigmas: tuple[Float, float],
    shift_of: Sequence[str],
) -> dict[str, object]:
    """Positions and attitudes, of EXIF and of the packet of a drone."""
    sigma_m, attitude_rad = sigmas
    packets = [drone_packet(p.path) for p in photos]
    numbers = [{} if packet is None else drone_numbers(packet) for packet in packets]
    rtk = np.array([[photo.get(f"RtkStd{axis}", np.nan) for axis in ("Lon", "Lat", "Hgt")] for photo in numbers])
    is_rtk = np.asarray((rtk > 0).all(axis=1))
    place = np.array([p.lonlat_deg for p in photos])
    packed = np.array(
        [[photo.get(key, np.nan) for key in ("GpsLongitude", "GpsLatitude", "AbsoluteAltitude")] for photo in numbers]
    )
    place = np.where(np.isfinite(packed) & (is_rtk | np.isnan(place).any(axis=1))[:, None], packed, place)
    here = finite_rows(place[:, :2])
    # positions that stand twice: a receiver that had not moved on, or values copied from image to image
    rows = np.round(np.nan_to_num(place), 9)
    _, which, count = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    equal = np.asarray(np.isfinite(place[:, 0]) & (count[which.ravel()] > 1))
    _tell(notes, names, ~here, "say no position")
    _tell(notes, names, equal, "have the position of another one: start values alone")
    angles = np.radians(
        [[photo.get(f"Gimbal{axis}Degree", np.nan) for axis in ("Roll", "Pitch", "Yaw")] for photo in numbers]
    )
    turned = finite_rows(angles)
    if turned.sum() > 2 and not np.ptp(angles[turned], axis=0).any():
        notes.append(f"all {int(turned.sum())} attitudes of the gimbal are equal: not used")
        turned[:] = False
    angles[~turned] = np.nan
    keep = np.flatnonzero(here | turned).tolist()
    observed = here & ~equal
    sigma = np.where(is_rtk[:, None], rtk, sigma_m)
    return (
        {
            "image": [names[k] for k in keep],
            "position_m": place[keep],
            "sigma_m": np.where(observed[:, None], sigma, np.nan)[keep],
            "position_use": np.where(observed, OBSERVED_VALUE, APPROXIMATE_VALUE)[keep],
            "ground_from_image": np.where(turned[:, None, None], of_gimbal(np.nan_to_num(angles)), np.nan)[keep],
            "angle_sigma_rad": np.where(turned[:, None], np.full((len(photos), 3), attitude_rad), np.nan)[keep],
            "angle_use": np.where(turned, OBSERVED_VALUE, APPROXIMATE_VALUE)[keep],
            "file": keep,
            "line": -1,
            "drift_group": [shift_of[k] for k in keep] if shift_of else "",
        }
        if keep
        else {}
    )


def _tell(notes: list[str], names: Sequence[str], which: Bool, what: str) -> None:
    if which.any():
        notes.append(
            f"{int(which.sum())} of {len(names)} photographs {what}: "
            f"{shown(names[k] for k in np.flatnonzero(which).tolist())}"
        )


def _exif(view: FileView) -> str:
    """A folder with JPEG files of a camera; TIFF files may be grids."""
    names = [name for name in view.names if view.is_folder and name.lower().endswith((".jpg", ".jpeg"))][:SOME]
    return next((f"{name}, EXIF" for name in names if "Exif\0\0" in view.of(name).head[:64]), "")


PHOTOS = Format(
    "photos",
    "photographs (EXIF, XMP)",
    _exif,
    "a folder of photographs, JPEG with EXIF",
    carries=("cameras", "distortion", "positions", "attitudes", "times", "frame", "standard deviations"),
    page="docs/methods/tie_points.md#photographs",
    read=lambda path, _, reporter: read_photographs(path, reporter=reporter),
    stage="block/photos",
    files_of=partial(files_with, ENDINGS),
)
