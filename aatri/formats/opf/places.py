"""Places of OPF: of captures and control, as stated in systems of their own and as the project has projected them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.formats.opf.project import OpfProject, SceneFrame, frame_of
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.one_frame import in_frame
from aatri.formats.text.json_text import JsonText, Key
from aatri.frames.conversion import Frame, crs_of
from aatri.frames.own_map import utm_of
from aatri.progress import Reporter

Projected = dict[int | str, tuple[Float, Float]]
"""Places of captures and control in the frame of the scene with their covariances, by their ids."""


class Located(NamedTuple):
    """A place in a frame of its own: X Y Z, standard deviations in m; `key` is what the project calls it."""

    name: str
    key: int | str
    frame: Frame
    xyz: list[float]
    sigma_m: list[float]


def located(document: JsonText, keys: tuple[Key, ...], name: str, key: int | str) -> Located:
    frame, undulation_m = frame_of(document, (*keys, "crs"))
    xyz, sigma = document.numbers(*keys, "coordinates", count=3), document.numbers(*keys, "sigmas", count=3)
    if min(sigma) < 0:
        raise document.fault((*keys, "sigmas"), f"standard deviations {sigma} of {name}", "they are positive, in m")
    return Located(name, key, frame, [*xyz[:2], xyz[2] + undulation_m], sigma)


def placed(
    project: OpfProject, stated: Sequence[Located], projected: Projected, scene: SceneFrame, reporter: Reporter
) -> dict[str, tuple[Float, Float]]:
    """Places in the frame of the scene with their covariances, m: as the project has projected them, else converted."""
    placed = {place.name: projected[place.key] for place in stated if place.key in projected}
    open_ = [place for place in stated if place.key not in projected]
    for frame in dict.fromkeys(place.frame for place in open_):
        own = [place for place in open_ if place.frame == frame]
        rows = {"point": [p.name for p in own], "xyz_m": [p.xyz for p in own], "sigma_m": [p.sigma_m for p in own]}
        parts = in_frame(BlockParts("opf", project.files, frame=frame, ground_points=rows), scene.frame, reporter)
        xyz = np.asarray(parts.ground_points["xyz_m"])
        covariance = parts.ground_points.get("covariance_m2")
        if covariance is None:
            covariance = np.array([np.diag(np.square(p.sigma_m)) for p in own])
        placed |= {p.name: (xyz[k], covariance[k]) for k, p in enumerate(own)}
    return placed


def scene_of_places(*tables: tuple[JsonText | None, str]) -> SceneFrame | None:
    """The map of the first geolocation, of a project without a scene; the UTM zone where that is in degrees."""
    for document, table in tables:
        for k in range(len(document.get(list, table)) if document is not None else 0):
            assert document is not None
            if "geolocation" not in document.get(dict, table, k):
                continue
            place = located(document, (table, k, "geolocation"), "", k)
            if not place.frame.geographic:
                east_first = ("x", "y", "z") if "x" in place.frame.axes else ("east", "north", "up")
                return SceneFrame(replace(place.frame, axes=east_first), np.zeros(3))
            at, parts = dict(zip(place.frame.axes, place.xyz)), crs_of(place.frame).sub_crs_list
            own = utm_of(place.frame, at["latitude"], at["longitude"])
            return SceneFrame(replace(own, vertical=parts[1].to_wkt() if parts else ""), np.zeros(3))
    return None


def projected_places(project: OpfProject, scene: SceneFrame) -> Projected:
    """Captures and control in the processing system, by their ids, in the frame of the scene."""
    projected: Projected = {}
    for resource, table, inner, column, kind in (
        ("projected-input-cameras", "captures", ("geolocation",), "position", int),
        ("projected-control-points", "projected_gcps", (), "coordinates", str),
    ):
        document = project.open(resource)
        for k in range(len(document.get(list, table)) if document is not None else 0):
            assert document is not None
            if all(key in document.get(dict, table, k) for key in inner):
                xyz, sigma = (document.numbers(table, k, *inner, c, count=3) for c in (column, "sigmas"))
                key = document.get(kind, table, k, "id")
                projected[key] = (np.array(xyz) - scene.shift_m, np.diag(np.square(sigma)))
    return projected
