"""Rigs of Metashape: slave sensors mounted on a master, and the images of one exposure.

`rotation` R and `translation` t of a slave map its axes to those of its master, q_master = R q_slave + t, in units of
the chunk. Metashape has adjusted them with the same observations, so that they are start values here: free.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aatri.artifacts.block_images import RigMembers
from aatri.formats.conventions.poses import Y_UP
from aatri.formats.metashape.cameras import ImageElement
from aatri.formats.metashape.sensors import Sensor
from aatri.geometry.rotations import angles_from_rotation


def rigs_of(
    cameras: Sequence[ImageElement], sensors: Mapping[str, Sensor], scale: float
) -> tuple[dict[str, list[Any]], RigMembers] | None:
    """Columns rig, member and sequence of the images, and the members; None of a chunk without rigs.

    Parameters
    ----------
    cameras : sequence of ImageElement
    sensors : mapping of str to Sensor
        By their ids.
    scale : float
        Metres of a unit of the chunk.
    """
    slaves = {key: s for key, s in sensors.items() if s.master in sensors}
    if not any(c.sensor in slaves for c in cameras):
        return None
    masters = {s.master for s in slaves.values()}
    frames = [(sensors[key], sensors[key]) for key in sensors if key in masters]
    members = sorted(
        [*frames, *((sensors[s.master], s) for s in slaves.values())],
        key=lambda pair: (pair[0].name, pair[1] is not pair[0], pair[1].name),
    )
    n = len(members)
    mounted = np.array([member is not frame for frame, member in members])
    R = np.array([member.rotation for _, member in members]) * Y_UP[:, None] * Y_UP
    table = RigMembers.of(
        rig=[frame.name for frame, _ in members],
        member=[member.name for _, member in members],
        is_frame=~mounted,
        position_m=np.array([member.translation for _, member in members]) * Y_UP * scale * mounted[:, None],
        angles_rad=np.where(mounted[:, None], angles_from_rotation(R), 0.0),
        position_sigma_m=np.where(mounted[:, None], np.nan, np.zeros((n, 3))),
        position_free=np.broadcast_to(mounted[:, None], (n, 3)),
        angle_sigma_rad=np.where(mounted[:, None], np.nan, np.zeros((n, 3))),
        angle_free=np.broadcast_to(mounted[:, None], (n, 3)),
    )
    number = {key: k for k, key in enumerate(dict.fromkeys(c.master or c.id for c in cameras), 1)}
    rig = [
        sensors[slaves[c.sensor].master if c.sensor in slaves else c.sensor].name
        if c.sensor in slaves or c.sensor in masters
        else ""
        for c in cameras
    ]
    columns: dict[str, list[Any]] = {
        "rig": rig,
        "member": [sensors[c.sensor].name if name else "" for c, name in zip(cameras, rig)],
        "sequence": [float(number[c.master or c.id]) for c in cameras],
    }
    return columns, table
