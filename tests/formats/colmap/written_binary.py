"""Models of COLMAP in its binary form, which aatri reads and does not write."""

import struct
from pathlib import Path

import numpy as np

from aatri.formats.colmap.binary import OBSERVATION, binary_paths
from aatri.formats.colmap.model import MODELS
from aatri.formats.colmap.writer import colmap_model
from aatri.formats.parts.format import AS_USUAL
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.progress import SILENT


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
