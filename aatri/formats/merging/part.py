"""A part of a block: some of its images, with all that belongs to them."""

from dataclasses import replace
from typing import Any

import numpy as np

from aatri.arrays import Bool
from aatri.artifacts.block import Block
from aatri.formats.merging.conditions import conditions_in_order, conditions_of
from aatri.formats.merging.taken import taken


def part_of(block: Block, images: Bool) -> Block:
    """Some images with their image points, the points these show, and what is observed of both alone.

    Sights and conditions are left out that touch a point or an image outside; points that sights or conditions join to
    points of the part alone, and to no image, belong to it.

    Parameters
    ----------
    images : (n_images,) bool
    """
    rays, models = block.image_points, block.model_coordinates
    points = np.zeros(len(block.points), dtype=bool)
    points[rays.point[images[rays.image]]] = True
    seen = np.zeros(len(points), dtype=bool)
    seen[rays.point] = True
    names = {"image": set(block.images.id[images].tolist()), "point": set(block.points.id[points | ~seen].tolist())}
    sights, conditions = block.geodetic, conditions_of(block)
    inside = np.array(
        [
            a in names[of_a] and b in names[of_b] and (not via or via in names["point"])
            for a, of_a, b, of_b, via in zip(
                *(getattr(sights, n).tolist() for n in ("start", "start_kind", "end", "end_kind", "via"))
            )
        ],
        dtype=bool,
    )
    kept = [
        k
        for k, (_, _, members) in enumerate(conditions)
        if all(name in names["image" if part == "images" else "point"] for part, name in members)
    ]
    touched = {name for k in kept for part, name in conditions[k][2] if part != "images"}
    for end in ("start", "end"):
        touched |= set(getattr(sights, end)[inside & (getattr(sights, f"{end}_kind") == "point")].tolist())
    points |= np.isin(block.points.id, list(touched | set(sights.via[inside].tolist())))
    ground, between, correlated = block.ground_points, block.ground_point_covariances, block.geodetic_covariances
    of_ground = points[ground.point]
    cameras = np.isin(np.arange(len(block.cameras)), block.images.camera[images])
    marks = cameras[block.fiducials.camera]
    rows: dict[str, Any] = {
        "cameras": cameras,
        "camera_parameters": cameras[block.camera_parameters.camera],
        "distortion_table": cameras[block.distortion_table.camera],
        "fiducials": marks,
        "rig_members": np.isin(block.rig_members.rig, block.images.rig[images]),
        "strips": np.isin(np.arange(len(block.strips)), block.images.strip[images]),
        "images": images,
        "fiducial_points": images[block.fiducial_points.image],
        "points": points,
        "image_points": images[rays.image],
        "ground_points": of_ground,
        "ground_point_covariances": of_ground[between.row_a] & of_ground[between.row_b],
        "exterior": images[block.exterior.image],
        "geodetic": inside,
        "geodetic_covariances": inside[correlated.row_a] & inside[correlated.row_b],
    }
    if models is not None:
        rows["model_coordinates"] = points[models.point]
    if block.true_images is not None:
        rows["true_images"] = images[block.true_images.image]
    if block.true_points is not None:
        rows["true_points"] = points[block.true_points.point]
    control, members = conditions_in_order(
        block.relative_control.take(np.array(kept, dtype=np.intp)), [conditions[k] for k in kept]
    )
    part = replace(block, relative_control=control, relative_control_members=members)
    return taken(part, {name: np.flatnonzero(chosen) for name, chosen in rows.items()})
