"""Two small blocks that use every column of every table and every key of block.yaml, and what comes out of them.

Both are the hand-made block of two strips of three images. `film` is measured on a comparator, with attitudes as
omega, phi, kappa, drifting antennas, geodetic observations and relative control of every type; `digital` is measured in
pixels, with roll, pitch and heading and a rig. Observations are made of the true coordinates; conditions that the
ground does not fulfil have large standard deviations.
"""

from __future__ import annotations

import hashlib
from dataclasses import astuple, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.adapters.cameras.unknowns import camera_scale
from aatri.adapters.pairs.image_pairs import neighbouring_images
from aatri.artifacts.block import CHECK
from aatri.orientation.bundle.block import start_of
from aatri.pipeline.methods.registry import find_stages
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment._self_calibration import parameters_of
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.acceptance.folder_files import Folder, Table
from tests.stages.hand_block import C_MM, Hand, Heard, angles_deg, hand, start

# fmt: off
ORIGIN = (440_000.0, 4_500_000.0, 100.0)
ARM, MARKS = np.array([0.2, -0.1, 0.9]), np.array([[106.0, -106.0], [-106.0, -106.0], [-106.0, 106.0], [106.0, 106.0]])
LOOSE = 60.0

def made(which: str) -> Folder:
    """`film`, `digital` or `cylinder`."""
    return {"film": film, "digital": digital, "cylinder": cylinder}[which]()


def film() -> Folder:
    of = hand(ORIGIN)
    angle = np.radians(0.3)
    shear = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) * 1.0002
    settings = {
        "aatri_block": 1, "name": "film", "frames": {"map": {"axes": ["east", "north", "up"], "crs": "EPSG:32650"}},
        "earth_curvature": "frame", "undulation": 12.0, "rotation": "omega-phi-kappa", "terrain_height": 100.0,
        "units": {"ground": "m", "angle": "deg", "sigma_image": "um", "sigma_ground": "m", "sigma_angle": "deg",
                  "time": "s"},
        "sigma": {"image": 5, "fiducial": 4, "control": [0.05, 0.05, 0.06], "position": [0.1, 0.1, 0.1],
                  "attitude": [0.01, 0.01, 0.01]},
        "cameras": {"c": {
            "kind": "film", "image_coordinates": "comparator", "format": [230, 230], "principal_distance": C_MM,
            "principal_point": [0.02, -0.01], "fiducials": {str(k): m.tolist() for k, m in enumerate(MARKS)},
            "distortion": {"model": "brown", "k1": 1e-8, "k2": 1e-13, "k3": 1e-18, "p1": 1e-8, "p2": 1e-8, "b1": 1e-6,
                           "b2": 1e-6},
            "sigmas": {"principal_distance": 0.05, "principal_point": [0.02, 0.03], "k1": float("inf"), "k2": 1e-13,
                       "p1": 1e-8, "lever_arm": [0.1, 0.2, 0.3], "boresight": [0.02, 0.03, float("inf")]},
            "lever_arm": ARM.tolist(), "boresight": [0.01, 0.02, -0.01]}},
    }
    antenna, angles = of.position_m + of.rotation @ ARM, angles_deg(of, "omega-phi-kappa")
    images = [{"image": f"i{k}", "camera": "c", "strip": f"s{k // 3}", "sequence": k % 3,
               "time": 100 * (k // 3) + 8 * k, "flight": f"f{k // 3}", "session": "day"} for k in range(6)]
    rng = np.random.default_rng(1)
    comparator = (of.xy_mm + np.array([0.02, -0.01]) + rng.normal(0, 0.004, of.xy_mm.shape)) @ shear.T + [120.0, 118.0]
    rows = [{"image": f"i{i}", "point": f"p{p:02}", "x": x, "y": y, "sx": "" if n % 2 else 6, "sy": "" if n % 3 else 7,
             "group": "" if n % 4 else "weak", "active": "no" if n == 11 else ""}
            for n, (i, p, (x, y)) in enumerate(zip(of.image, of.point, comparator.tolist()))]
    at = MARKS @ shear.T + [120.0, 118.0]
    marks = [{"image": f"i{k}", "fiducial": str(m), "x": at[m, 0] + 0.002 * ((k + m) % 3), "y": at[m, 1],
              "sx": 3 if m else "", "sy": 5 if m == 1 else ""} for k in range(6) for m in range(4)]
    exterior: Table = []
    for k in range(6):
        row: dict[str, Any] = {"image": f"i{k}"} | dict(zip("XYZ", antenna[k].tolist()))
        row |= {"sX": 0.05, "sY": 0.06, "sZ": 0.07, "sXY": 0.0005, "sXZ": 0.0004, "sYZ": 0.0003} if k != 2 else {}
        row |= dict(zip(("a1", "a2", "a3"), (angles[k] + 0.005).tolist())) | (
            {"s1": 0.02, "s2": 0.03, "s3": 0.04} if k else {}
        )
        row |= {"use": "observed" if k in (0, 2) else "", "refers_to": "antenna", "drift_group": f"g{k // 3}"}
        exterior.append(row)
    exterior[3] = {
        "image": "i3",
        "Z": of.position_m[3, 2],
        "sZ": 0.05,
        "a3": angles[3, 2],
        "s3": 0.02,
        "drift_group": "g1",
    }
    exterior[4] |= {"refers_to": "projection_centre"} | dict(zip("XYZ", of.position_m[4].tolist()))
    x = of.xyz_m
    sigmas = {"sX": 0.02, "sY": 0.03, "sZ": 0.04, "sXY": 0.0002, "sXZ": 0.0001, "sYZ": 0.0001}
    ground: Table = [{"point": f"p{p:02}", **dict(zip("XYZ", (x[p] + 0.02).tolist())), **sigmas, "datum": "yes"}
                     for p in (0, 5, 24)]
    ground += [{"point": "p29", **dict(zip("XYZ", x[29].tolist()))}, {"point": "p14", "Z": x[14, 2], "sZ": 0},
               {"point": "p12", **dict(zip("XYZ", x[12].tolist())), "role": "XY:control Z:check"},
               {"point": "p18", **dict(zip("XYZ", x[18].tolist())), "role": "approximate"}]
    covariances = [{"table": "ground_points", "row_a": "p00", "row_b": "p05", "coord_a": "X", "coord_b": "Y",
                    "value": 1e-4}, {"table": "geodetic", "row_a": 6, "row_b": 7, "value": 1e-5}]
    tables = {"images": images, "image_points": rows, "fiducials": marks, "ground_points": ground, "exterior": exterior,
              "geodetic": _geodetic(x, of.position_m), "covariances": covariances}
    return Folder(of, settings, tables, _conditions(x, of.position_m))


def _geodetic(x: Any, X0: Any) -> Table:
    """Distances in a group, reduced and to an image; direction set, angle, azimuth, zenith; heights and differences."""

    def bearing(a: int, b: int) -> float:
        return float(np.degrees(np.arctan2(x[b, 0] - x[a, 0], x[b, 1] - x[a, 1])) % 360)

    def length(a: Any, b: Any) -> float:
        return float(np.linalg.norm(b - a))

    heights = {"h_from": 1.5, "h_to": 1.2}
    rows: Table = [
        {"type": "distance", "from": "p00", "to": "p05", "value": length(x[0], x[5]), "sigma": 0.05, **heights},
        {"type": "distance", "from": "p01", "to": "p08", "value": length(x[1], x[8]), "sigma": 0.02, "group": "edm",
         "active": "yes"},
        {"type": "distance", "from": "p02", "to": "p09", "value": length(x[2], x[9]), "sigma": 0.02, "group": "edm"},
        {"type": "distance", "from": "p03", "to": "p10", "value": length(x[3], x[10]), "sigma": 0.02, "group": "edm"},
        {"type": "horizontal_distance", "from": "p06", "to": "p13", "value": length(x[6, :2], x[13, :2]), "sigma": 0.05,
         "reduced": "map"},
        {"type": "dX", "from": "p07", "to": "p20", "value": x[20, 0] - x[7, 0], "sigma": 0.02},
        {"type": "dY", "from": "p07", "to": "p20", "value": x[20, 1] - x[7, 1], "sigma": 0.02},
        {"type": "dZ", "from": "p07", "to": "p20", "value": x[20, 2] - x[7, 2], "sigma": 0.02},
        {"type": "height_difference", "from": "p08", "to": "i1", "to_kind": "image", "value": X0[1, 2] - x[8, 2],
         "sigma": 0.05},
        {"type": "distance", "from": "i4", "from_kind": "image", "to": "p22", "value": length(X0[4], x[22]),
         "sigma": 0.05},
        *({"type": "direction", "from": "p12", "to": f"p{b:02}", "value": (bearing(12, b) + 40) % 360, "sigma": 0.005,
           "set": "s1"} for b in (0, 5, 24)),
        {"type": "angle", "from": "p00", "via": "p12", "to": "p29", "value": (bearing(12, 29) - bearing(12, 0)) % 360,
         "sigma": 0.005},
        {"type": "azimuth", "from": "p07", "to": "p29", "value": bearing(7, 29), "sigma": 0.005, "reduced": "map"},
        {"type": "zenith", "from": "p07", "to": "p29", "sigma": 0.005,
         "value": float(np.degrees(np.arctan2(length(x[7, :2], x[29, :2]), x[29, 2] - x[7, 2])))},
    ]
    return rows


def _conditions(x: Any, X0: Any) -> Table:
    def named(type_: str, points: Any, **more: Any) -> dict[str, Any]:
        return {"type": type_, "points": [f"p{k:02}" for k in points], "sigma": LOOSE} | more

    u, w = x[8] - x[2], x[9] - x[2]
    angle = float(np.degrees(np.arccos(u @ w / np.linalg.norm(u) / np.linalg.norm(w))))
    pairs = [["p01", "p02"], ["p07", "p08"]]
    return [
        named("distance", (9, 16), value=float(np.linalg.norm(x[16] - x[9])), sigma=0.02),
        {"type": "distance", "images": ["i0", "i1"], "value": float(np.linalg.norm(X0[1] - X0[0])), "sigma": 0.02},
        {"type": "equal_distance", "pairs": pairs, "sigma": LOOSE},
        *(named(t, (1, 8, 15, 22, 26)) for t in ("horizontal_plane", "vertical_plane", "plane", "plumb_line", "line",
                                                 "horizontal_line", "equal_height")),
        {"type": "angle", "at": "p02", "between": ["p08", "p09"], "value": angle, "sigma": 0.01},
        named("coordinate_difference", (3, 10), axis="Z", value=float(x[10, 2] - x[3, 2]), sigma=0.02),
        {"type": "parallel", "pairs": pairs, "sigma": 5.0},
        {"type": "perpendicular", "pairs": [["p01", "p02"], ["p01", "p07"]], "sigma": 5.0},
        named("sphere", (1, 8, 15, 22, 26, 9), radius=700.0),
    ]


def cylinder() -> Folder:
    """The digital block with a cylinder, whose start takes half a second; of it only the condition is looked at."""
    found = digital()
    points = [f"p{k:02}" for k in (1, 8, 15, 22, 26, 9, 13)]
    condition = {"type": "cylinder", "points": points, "sigma": LOOSE, "radius": 200.0}
    return replace(found, tables=found.tables, conditions=[condition])


def digital() -> Folder:
    """Cameras a and b of a rig; b is 0.3 m beside a and turned by 2 degrees."""
    of = hand(ORIGIN)
    turn = Rotation.from_euler("XYZ", [0, 2, 0], degrees=True).as_matrix()
    mount = np.array([0.3, 0.0, 0.05])
    position, rotation = of.position_m.copy(), of.rotation.copy()
    for k in (1, 3, 5):  # i0 and i1, i2 and i3, i4 and i5 are exposed together
        rotation[k] = rotation[k - 1] @ turn
        position[k] = position[k - 1] + rotation[k - 1] @ mount
    image, point = (a.ravel() for a in np.indices((6, len(of.xyz_m))))
    u = np.einsum("nji,nj->ni", rotation[image], of.xyz_m[point] - position[image])
    xy = -C_MM * u[:, :2] / u[:, 2:]
    seen = (np.abs(xy) < 115).all(axis=1)
    of = Hand(position, rotation, of.xyz_m, image[seen], point[seen], xy[seen])
    pixels = np.column_stack([of.xy_mm[:, 0] / 0.02 + 5750, 5750 - of.xy_mm[:, 1] / 0.02])
    ned = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    body = Rotation.from_euler("z", 90, degrees=True).as_matrix() @ np.diag([1.0, -1.0, -1.0])
    heading, pitch, roll = Rotation.from_matrix(ned.T @ rotation @ body.T).as_euler("ZYX", degrees=True).T
    one = {"kind": "digital", "image_coordinates": "pixel", "format": [11500, 11500], "principal_distance": C_MM,
           "pixel": {"size": 0.02, "origin": "top-left-corner", "y": "down"}, "principal_point": [0.0, 0.0],
           "mount": 90}
    other = {**one, "distortion": {"model": "table", "radius": [0, 60, 160], "correction": [0, 2.0, -3.0]},
             "symmetry_point": [0.3, -0.2]}
    settings = {
        "aatri_block": 1, "name": "digital",
        "frames": {"map": {"axes": ["east", "north", "up"], "crs": "EPSG:32650"},
                   "gnss": {"axes": ["latitude", "longitude", "height"], "crs": "EPSG:4979", "vertical": ""}},
        "earth_curvature": "correct", "rotation": "roll-pitch-heading", "heading": "true", "terrain_height": 100.0,
        "units": {"ground": "m", "angle": "deg", "sigma_image": "px", "sigma_ground": "m", "sigma_angle": "deg",
                  "time": "ms"},
        "sigma": {"image": 0.3, "control": [0.05, 0.05, 0.06], "attitude": 0.02},
        "cameras": {"a": one, "b": other},
        "rigs": {"R": {"left": {}, "right": {"position": mount.tolist(), "angles": [0, 2, 0],
                                             "sigmas": {"position": [0.05, 0, 0.03], "angles": [0.02, 0.03, 0]}}}},
    }
    images = [{"image": f"i{k}", "camera": "ab"[k % 2], "strip": "s", "sequence": k // 2, "time": 1000 * (k // 2),
               "rig": "R", "member": ("left", "right")[k % 2]} for k in range(6)]
    rows = [{"image": f"i{i}", "point": f"p{p:02}", "x": x, "y": y}
            for i, p, (x, y) in zip(of.image, of.point, pixels.tolist())]
    # Convergence of the meridians at the block: the sine of the latitude times the longitude from the central meridian.
    exterior = [{"image": f"i{k}", "a1": roll[k], "a2": pitch[k], "a3": heading[k] - 0.46, "s1": 0.02, "s2": 0.02,
                 "s3": 0.6, "frame": "map"} for k in range(6)]
    exterior[2] = {"image": "i2", "a1": roll[2], "a2": pitch[2], "use": "observed"}
    ground = [{"point": f"p{p:02}", **dict(zip("XYZ", of.xyz_m[p].tolist())), "frame": "map"} for p in (0, 5, 24, 29)]
    ground.append(
        {"point": "p14", "X": 40.648, "Y": 116.2945, "Z": 115.0, "sX": 50, "sY": 50, "sZ": 50, "frame": "gnss"}
    )
    return Folder(
        of, settings, {"images": images, "image_points": rows, "ground_points": ground, "exterior": exterior}, []
    )


def equations(folder: Path, content: Folder) -> tuple[bytes, tuple[str, ...]]:
    """Digest of the observation equations of a bundle of a block folder, and all that is warned of on the way.

    What has no part in them has none in the result. Errors of the chain are the caller's.
    """
    content.write(folder)
    heard = Heard()
    block = tables(options=TablesOptions(path=folder), context=heard)  # type: ignore[arg-type]
    of_film = bool((block.cameras.kind == "film").any())
    points = affine(block, context=heard) if of_film else calibrated(block, context=heard)  # type: ignore[arg-type]
    refined = systematic(block, points, options=SystematicOptions(distortion=not of_film), context=heard)  # type: ignore[arg-type]
    options = BundleOptions()
    parameters = parameters_of(block, refined, options.interior_unknowns, None, None)
    begun = start(content.of, block, xyz_m=np.full(content.of.xyz_m.shape, np.nan))
    begun = replace(begun, points=replace(begun.points, xyz_m=np.full((len(block.points), 3), np.nan)))
    given = bundle_input(observation_source(block, refined, begun, parameters), options)
    checks = np.where(block.ground_points.role == CHECK, block.ground_points.xyz_m, np.nan)
    scales = [np.array(astuple(camera_scale(block, k))[1]) for k in range(len(block.cameras))]
    state = start_of(given)
    numbers = [refined.measurements.xy_mm, block.points.id.astype("S9"), given.marked, given.xyz_m, checks, *scales,
               np.array(neighbouring_images(block))]
    for o in given.observed:
        v, jacobians = o.records.evaluate(state, np.flatnonzero(o.records.active))
        numbers += [v, *jacobians, o.records.whitener, o.records.active, *(u.free for u in o.unknowns)]
        numbers += [] if o.holds is None else [o.holds.scalar, o.holds.value]
        if o.kind in ("position", "attitude"):  # of a flight they are tested together
            numbers.append(given.images.flight[o.records.touches[0][1]].astype("S9"))
    told = [str(note) for o in given.observed for note in o.notes if note.level == "warning"]
    digest = hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in numbers)).digest()
    return digest, (*heard.warned, *told, *(offer.what for offer in block.offers() if offer.name not in used_offers()))


@cache
def used_offers() -> set[str]:
    """Names of what the stages of this chain use of a block."""
    registry, interior = find_stages(), "interior_orientation/affine"
    chain = (interior, "image_refinement/systematic", "bundle_adjustment/bundle", "accuracy/evaluation")
    cards = [registry.card(name) for name in chain]
    return {name for card in cards for name in card.used_with(card.options() if card.options else None) or ()}
