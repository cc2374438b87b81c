"""The start values of a Block as a Solution: what the tests of writers write."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aatri.adapters.solution import ground_points, oriented_images, solved_cameras
from aatri.artifacts import solution as s
from aatri.artifacts.block import Block
from aatri.artifacts.suspects import Suspects
from aatri.formats.colmap.binary import OBSERVATION, binary_paths
from aatri.formats.colmap.model import MODELS
from aatri.formats.colmap.writer import colmap_model
from aatri.formats.parts.format import AS_USUAL
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.geometry.rotations import rotation_from_angles
from aatri.progress import SILENT


def start_solution(block: Block, rejected: Sequence[int] = ()) -> s.Solution:
    """Orientations and points as the Block gives them; the named rows of its image points are rejected."""
    n, rows = len(block.images), block.image_points
    position, R, xyz = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((len(block.points), 3), np.nan)
    position[block.exterior.image] = block.exterior.position_m
    R[block.exterior.image] = rotation_from_angles(block.exterior.angles_rad)
    xyz[block.ground_points.point] = block.ground_points.xyz_m
    m = len(rejected)
    suspects = Suspects(
        kind=np.full(m, "image_point"),
        row=np.array(rejected, np.int32),
        image=np.full(m, ""),
        point=np.full(m, ""),
        stage=np.full(m, "bundle_adjustment"),
        size=np.full(m, 1.0),
        unit=np.full(m, "mm"),
        sigma=np.full(m, 1.0),
        test=np.full(m, 9.0),
        verdict=np.full(m, "rejected"),
    )
    return s.Solution(
        method="test/start",
        observations=2 * len(rows),
        unknowns=0,
        redundancy=2 * len(rows),
        sigma0=float("nan"),
        sigma0_um=float("nan"),
        iterations=0,
        images=oriented_images(block, position, R, np.bincount(rows.image, minlength=n)),
        points=ground_points(block, xyz, np.bincount(rows.point, minlength=len(xyz))),
        cameras=solved_cameras(block),
        transformations=s.StripTransformations.empty(),
        parameters=s.Parameters.empty(),
        residuals=s.Residuals.empty(),
        history=s.Iterations.empty(),
        suspects=suspects if m else Suspects.empty(),
    )


# Models of COLMAP in its binary form, which aatri reads and does not write.


def write_binary(oriented: OrientedBlock, folder: Path) -> None:
    """Write the sparse model of an oriented block as binary files."""
    folder.mkdir(parents=True, exist_ok=True)
    model = colmap_model(oriented, AS_USUAL, SILENT)
    numbers = {name: k for k, name in enumerate(MODELS)}
    cameras = [struct.pack("<Q", len(model.cameras))]
    for c in model.cameras:
        form = f"<IiQQ{len(c.parameters)}d"
        cameras.append(struct.pack(form, c.id, numbers[c.model], c.width, c.height, *c.parameters))
    images = [struct.pack("<Q", len(model.images))]
    for image in model.images:
        images.append(struct.pack("<I7dI", image.id, *image.quaternion, *image.translation, image.camera))
        rows = np.zeros(len(image.point), OBSERVATION)
        rows["x"], rows["y"], rows["point"] = image.xy_px[:, 0], image.xy_px[:, 1], image.point
        images.append(image.name.encode() + b"\0" + struct.pack("<Q", len(rows)) + rows.tobytes())
    points = [struct.pack("<Q", len(model.points))]
    for name, xyz, error, track in zip(model.points.tolist(), model.xyz, model.error_px, model.tracks()):
        points.append(struct.pack("<Q3d3BdQ", name, *xyz, 0, 0, 0, error, len(track)))
        points.append(np.array(track, dtype="<u4").tobytes())
    for path, parts in zip(binary_paths(folder), (cameras, images, points)):
        path.write_bytes(b"".join(parts))
