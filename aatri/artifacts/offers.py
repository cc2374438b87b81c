"""What a Block may offer: every given value that is to have an effect, by the name under which stages state its use.

One row per name: which cells of the block folder it stands for, which rows count as given, and what kind of artifact it
bears upon. A value counts as given where the cell is filled and says something: a lever arm of zero, an observation
that is switched off or a camera parameter with sigma 0 says nothing. Where rows of one table differ in what they need,
each type has a name of its own: `geodetic:distance`, `relative_control:plane`, `camera_parameters:brown.k1`.

What is here neither: values every stage that takes a Block reads (ids, cameras, approximate values), and the truth.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.needed_datum import (
    SIMILARITY,
    WITHOUT_SHIFT,
    is_placed,
    no_similarity_open,
    observed_attitudes,
    observed_images,
    observed_positions,
)
from aatri.codes import ANTENNA, CHECK, CONTROL, OBSERVED_VALUE
from aatri.ids import several
from aatri.tables.offers import Nature, Offer

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


@dataclass(frozen=True)
class _Declared:
    """A name with the rows of one table that it stands for; a noun in braces takes their count: `{image}`, `3 images`.

    Where it bears on nothing it stands beside another name of the same rows, for stages that need it.
    """

    name: str
    nature: Nature
    words: str
    table: str
    rows: Callable[[Block], Bool]
    bears_on: str = "Solution"


def _approximate_in_part(use: Int, values: Float) -> Bool:
    finite = np.isfinite(values)
    return np.asarray((use != OBSERVED_VALUE) & finite.any(axis=1) & ~finite.all(axis=1))


def _weighted(covariance: Float) -> Bool:
    return np.asarray((np.nan_to_num(np.einsum("nii->ni", covariance)) > 0).any(axis=1))


def _antennas(block: Block) -> Bool:
    """Cameras of images with a position of the antenna."""
    e = block.exterior
    image = e.image[(e.refers_to == ANTENNA) & np.isfinite(e.position_m).any(axis=1)]
    return np.isin(np.arange(len(block.cameras)), block.images.camera[image])


def _of_photo_coordinates(block: Block) -> Bool:
    """Marks of images whose coordinates are in the photo system already."""
    camera = block.images.camera[block.fiducial_points.image]
    return np.asarray(block.cameras.image_coordinates[camera] == "photo")


def _arms(block: Block) -> Bool:
    return np.asarray((block.cameras.lever_arm_m != 0).any(axis=1))


def _distances(block: Block) -> Bool:
    return np.isin(block.geodetic.type, ("distance", "horizontal_distance"))


def _reduced(block: Block) -> Bool:
    g = block.geodetic
    return np.asarray(g.active & (g.reduced != "no") & (g.reduced != ""))


def _boresights(block: Block) -> Bool:
    return np.asarray((block.cameras.boresight_rad != 0).any(axis=1))


def _mounts(block: Block) -> Bool:
    return np.asarray(block.cameras.mount_deg != 0)


def _with_angles(block: Block) -> Bool:
    """Cameras of images with angles, observed or approximate."""
    image = block.exterior.image[np.isfinite(block.exterior.angles_rad).all(axis=1)]
    return np.isin(np.arange(len(block.cameras)), block.images.camera[image])


def _of_carrier(block: Block) -> Bool:
    """Cameras of images with roll, pitch and heading."""
    return _with_angles(block) & (block.rotation == "roll-pitch-heading")


_DECLARED = (
    _Declared("image_points.xy", "observation", "{image point} (image_points.csv: x, y)", "image_points",
              lambda b: b.image_points.active, "ImagePoints"),
    _Declared("image_points.group", "grouping", "groups of {image point} (image_points.csv: group)", "image_points",
              lambda b: b.image_points.active & (b.image_points.group != "")),
    _Declared("image_points.row_time_s", "observation", "row times of {image point} (image_points.csv: row_time)",
              "image_points", lambda b: b.image_points.active & np.isfinite(b.image_points.row_time_s)),
    _Declared("fiducial_points.xy", "observation", "{measured fiducial mark} (fiducials.csv: x, y)",
              "fiducial_points", lambda b: ~_of_photo_coordinates(b), "ImagePoints"),
    _Declared("fiducial_points:photo", "observation",
              "{measured fiducial mark} (fiducials.csv) of cameras with image_coordinates: photo", "fiducial_points",
              lambda b: _of_photo_coordinates(b), "ImagePoints"),
    _Declared("images.strip", "grouping", "strips of {image} (images.csv: strip)", "images",
              lambda b: b.images.strip >= 0),
    _Declared("images.flight", "grouping", "flights of {image} (images.csv: flight) without position or attitude",
              "images", lambda b: (b.images.flight != "") & ~observed_images(b)),
    _Declared("images.flight:observed", "grouping", "flights of {image} (images.csv: flight)", "images",
              lambda b: (b.images.flight != "") & observed_images(b)),
    _Declared("images.session", "grouping", "sessions of {image} (images.csv: session)", "images",
              lambda b: b.images.session != ""),
    _Declared("images.rig", "constraint", "rigs of {image} (images.csv: rig)", "images",
              lambda b: b.images.rig != ""),
    _Declared("cameras.distortion", "correction", "lens distortion of {camera} (block.yaml: cameras)", "cameras",
              lambda b: b.cameras.distortion != "none"),
    _Declared("cameras.lever_arm_m", "constraint", "lever arms of {camera} (block.yaml: lever_arm)", "cameras",
              lambda b: _arms(b) & _antennas(b)),
    _Declared("cameras.lever_arm_m:without_antenna", "constraint",
              "lever arms of {camera} (block.yaml: lever_arm) to which no position refers "
              "(exterior.csv: refers_to antenna)", "cameras", lambda b: _arms(b) & ~_antennas(b)),
    _Declared("cameras.boresight_rad", "constraint", "boresights of {camera} (block.yaml: boresight)", "cameras",
              lambda b: _boresights(b) & _with_angles(b)),
    _Declared("cameras.boresight_rad:without_angles", "constraint",
              "boresights of {camera} (block.yaml: boresight) whose images have no angles", "cameras",
              lambda b: _boresights(b) & ~_with_angles(b)),
    _Declared("cameras.mount_deg", "constraint", "mounts of {camera} (block.yaml: mount)", "cameras",
              lambda b: _mounts(b) & _of_carrier(b)),
    _Declared("cameras.mount_deg:without_effect", "constraint",
              "mounts of {camera} (block.yaml: mount) whose images have no roll, pitch, heading", "cameras",
              lambda b: _mounts(b) & ~_of_carrier(b)),
    _Declared("ground_points.xyz_m", "observation", "{control point} (ground_points.csv: X, Y, Z)", "ground_points",
              lambda b: b.ground_points.given_as(CONTROL)),
    _Declared(SIMILARITY, "observation", "{control point} (ground_points.csv: X, Y, Z)", "ground_points",
              no_similarity_open, bears_on=""),
    _Declared("ground_points.covariance_m2", "standard deviation",
              "standard deviations of {control point} (ground_points.csv: sX, sY, sZ)", "ground_points",
              lambda b: b.ground_points.given_as(CONTROL) & _weighted(b.ground_points.covariance_m2)),
    _Declared("ground_points:check", "check", "{check point} (ground_points.csv: role)", "ground_points",
              lambda b: b.ground_points.given_as(CHECK), "Evaluation"),
    _Declared("ground_points.datum", "grouping", "datum marks of {point} (ground_points.csv: datum)",
              "ground_points", lambda b: b.ground_points.datum & ~is_placed(b)),
    _Declared("ground_points.datum:placed", "grouping",
              "datum marks of {point} (ground_points.csv: datum) beside control or positions that place the block",
              "ground_points", lambda b: b.ground_points.datum & is_placed(b)),
    _Declared("ground_point_covariances", "standard deviation",
              "{covariance} between control coordinates (covariances.csv)", "ground_point_covariances",
              lambda b: b.ground_point_covariances.value != 0),
    _Declared("exterior.position_m", "observation", "{observed position} (exterior.csv: X, Y, Z)", "exterior",
              observed_positions),
    _Declared(WITHOUT_SHIFT, "observation",
              "{observed position} in no drift group (exterior.csv: X, Y, Z)", "exterior",
              lambda b: observed_positions(b) & (b.exterior.drift_group == ""), bears_on=""),
    _Declared("exterior.angles_rad", "observation", "{observed attitude} (exterior.csv: a1, a2, a3)", "exterior",
              observed_attitudes),
    _Declared("exterior.position_m:approximate_in_part", "grouping",
              "{approximate position} without all coordinates (exterior.csv: X, Y, Z), too little to start an image",
              "exterior", lambda b: _approximate_in_part(b.exterior.position_use, b.exterior.position_m)),
    _Declared("exterior.angles_rad:approximate_in_part", "grouping",
              "{approximate attitude} without all angles (exterior.csv: a1, a2, a3), too little to start an image",
              "exterior", lambda b: _approximate_in_part(b.exterior.angle_use, b.exterior.angles_rad)),
    _Declared("exterior.drift_group", "constraint", "drift groups of {observed position} (exterior.csv: drift_group)",
              "exterior", lambda b: (b.exterior.drift_group != "") & observed_positions(b)),
    _Declared("exterior.drift_group:without_positions", "grouping",
              "drift groups of {image} without observed position (exterior.csv: drift_group)", "exterior",
              lambda b: (b.exterior.drift_group != "") & ~observed_positions(b)),
    _Declared("geodetic.group", "constraint", "groups of {distance} (geodetic.csv: group)", "geodetic",
              lambda b: b.geodetic.active & (b.geodetic.group != "") & _distances(b)),
    _Declared("geodetic.group:other", "constraint",
              "groups of {geodetic observation} other than distances (geodetic.csv: group)", "geodetic",
              lambda b: b.geodetic.active & (b.geodetic.group != "") & ~_distances(b)),
    _Declared("geodetic.set:other", "constraint",
              "sets of {geodetic observation} other than directions (geodetic.csv: set)", "geodetic",
              lambda b: b.geodetic.active & (b.geodetic.set != "") & (b.geodetic.type != "direction")),
    _Declared("geodetic.via:other", "constraint",
              "vertices of {geodetic observation} other than angles (geodetic.csv: via)", "geodetic",
              lambda b: b.geodetic.active & (b.geodetic.via != "") & (b.geodetic.type != "angle")),
    _Declared("geodetic.reduced:distance", "correction", "{reduced distance} (geodetic.csv: reduced)", "geodetic",
              lambda b: _reduced(b) & _distances(b)),
    _Declared("geodetic.reduced:angular", "correction",
              "{reduced angular observation} (geodetic.csv: reduced)", "geodetic",
              lambda b: _reduced(b) & np.isin(b.geodetic.type, ("direction", "azimuth", "angle"))),
    _Declared("geodetic.reduced:other", "correction",
              "{reduced geodetic observation} of neither length nor direction (geodetic.csv: reduced)",
              "geodetic", lambda b: _reduced(b) & ~_distances(b)
              & ~np.isin(b.geodetic.type, ("direction", "azimuth", "angle"))),
    _Declared("geodetic.heights", "correction",
              "instrument and target heights of {geodetic observation} (geodetic.csv: h_from, h_to)", "geodetic",
              lambda b: b.geodetic.active & ((np.nan_to_num(b.geodetic.start_height_m) != 0)
                                             | (np.nan_to_num(b.geodetic.end_height_m) != 0))),
    _Declared("model_coordinates.xyz", "observation", "{coordinate} of points in models", "model_coordinates",
              lambda b: np.ones(0 if b.model_coordinates is None else len(b.model_coordinates), dtype=bool)),
    _Declared("geodetic_covariances", "standard deviation",
              "{covariance} between geodetic observations (covariances.csv)", "geodetic_covariances",
              lambda b: b.geodetic_covariances.value != 0),
)  # fmt: skip

NAMES = frozenset(d.name for d in _DECLARED) | {
    "camera_parameters:*",
    "geodetic:*",
    "relative_control:*",
    "earth_curvature:correct",
    "earth_curvature:frame",
    "undulation",
    "undulation:without_effect",
    "terrain_height",
}
"""All names under which a Block may offer something."""


def offers_of(block: Block) -> tuple[Offer, ...]:
    """What a block offers, in the order of its tables."""
    return tuple(offer for offer in _offers(block) if offer is not None)


def _offers(block: Block) -> Iterator[Offer | None]:
    for d in _DECLARED:
        yield _offer(block, d.name, d.nature, d.words, d.table, np.asarray(d.rows(block)), d.bears_on)
    yield from _of_camera_parameters(block)
    g, c = block.geodetic, block.relative_control
    station = (g.start_kind == "image") | (g.end_kind == "image")
    types = np.where(station, _joined(g.type, "_to_image"), g.type)
    for type_ in np.unique(types[g.active]):
        words = f"{{observation}} of type {type_} (geodetic.csv: value, sigma)"
        yield _offer(block, f"geodetic:{type_}", "observation", words, "geodetic", g.active & (types == type_))
    for type_ in np.unique(c.type):
        words = f"{{condition}} of type {type_} (relative_control.yaml)"
        yield _offer(block, f"relative_control:{type_}", "constraint", words, "relative_control", c.type == type_)
    if block.earth_curvature in ("correct", "frame"):
        words = f"`earth_curvature: {block.earth_curvature}` (block.yaml)"
        nature: Nature = "correction" if block.earth_curvature == "frame" else "reduction"
        yield Offer(f"earth_curvature:{block.earth_curvature}", nature, words, "", "Solution")
    if np.isfinite(block.undulation_m):
        words = "undulation (block.yaml)"
        if block.earth_curvature == "frame":
            yield Offer("undulation", "correction", words, "", "Solution")
        else:
            words += f" beside earth_curvature: {block.earth_curvature}, which has no use for it"
            yield Offer("undulation:without_effect", "reduction", words, "", "Solution")
    if np.isfinite(block.terrain_height_m) and block.earth_curvature == "correct":
        words = "terrain_height (block.yaml), of which refraction and earth curvature are reckoned"
        yield Offer("terrain_height", "reduction", words, "", "ImagePoints")


def _of_camera_parameters(block: Block) -> Iterator[Offer | None]:
    """Camera parameters that are unknown or weighted, by the distortion model that they belong to."""
    p = block.camera_parameters
    open_ = p.free | (np.nan_to_num(p.sigma) > 0)
    names = _joined(_joined(block.cameras.distortion[p.camera], "."), p.name)
    for name in np.unique(names[open_]):
        words = f"standard deviation of {name.partition('.')[2]} of {{camera}} (block.yaml: sigmas)"
        yield _offer(
            block,
            f"camera_parameters:{name}",
            "standard deviation",
            words,
            "camera_parameters",
            open_ & (names == name),
        )


def _offer(
    block: Block, name: str, nature: Nature, words: str, table: str, rows: Bool, bears_on: str = "Solution"
) -> Offer | None:
    if not rows.any():
        return None
    counted = re.sub(r"\{([^}]+)\}", lambda noun: several(int(rows.sum()), noun[1]), words)
    return Offer(name, nature, counted, _where(block, table, rows), bears_on)


def _where(block: Block, table: str, rows: Bool) -> str:
    """`file:line` of the first row that was imported, or the camera."""
    rows_of_table = getattr(block, table)
    first = int(np.flatnonzero(rows)[0])
    if table in ("cameras", "camera_parameters"):
        return f"camera {block.cameras.id[first if table == 'cameras' else rows_of_table.camera[first]]}"
    if not hasattr(rows_of_table, "file") or rows_of_table.file[first] < 0:
        return ""
    line = int(rows_of_table.line[first])
    return str(block.files.path[rows_of_table.file[first]]) + (f":{line}" if line > 0 else "")


def _joined(a: Text, b: Text | str) -> Text:
    return np.char.add(np.asarray(a, dtype=np.str_), b)
