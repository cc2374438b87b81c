"""Start values that a Block itself gives: orientations, and coordinates by its geodetic observations."""

import numpy as np

from aatri.adapters.frame.adjustment_frame import geodesy_of
from aatri.arrays import Bool, Float
from aatri.artifacts.block import ANTENNA, CHECK, Block
from aatri.artifacts.solution import Solution
from aatri.errors import ArtifactError
from aatri.geometry.rotations import exp_rotation
from aatri.ids import rows_of, several
from aatri.notes import Note
from aatri.observations.attitudes import ObservedAngles, ground_of_angles
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import Poses
from aatri.orientation.network.start import NetworkObservations, approximate_coordinates


def given_orientations(block: Block) -> tuple[Float, Float]:
    """Projection centres and rotations the block itself gives, observed or approximate; NaN where it gives none.

    Returns
    -------
    position_m : (n_images, 3) float64, m
    ground_from_image : (n_images, 3, 3) float64
    """
    n = len(block.images)
    position, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    exterior = block.exterior
    with_angles = np.flatnonzero(np.isfinite(exterior.angles_rad).all(axis=1))
    if len(with_angles):
        image = exterior.image[with_angles]
        source = ObservationSource(block, None, np.zeros(3), {}, geodesy=geodesy_of(block))
        cameras = block.images.camera[image]
        ground = ground_of_angles(source, exterior.position_m[with_angles])
        mount_deg, angles_rad = block.cameras.mount_deg[cameras], exterior.angles_rad[with_angles]
        angles = ObservedAngles(angles_rad, block.rotation, ground, mount_deg)
        observed, _ = angles.rotations()
        rotation[image] = observed @ exp_rotation(block.cameras.boresight_rad[cameras])
    position[exterior.image] = exterior.position_m
    antenna = exterior.refers_to == ANTENNA
    image = exterior.image[antenna]
    arm = block.cameras.lever_arm_m[block.images.camera[image]]
    turned = np.einsum("nij,nj->ni", rotation[image], arm)
    position[image] -= np.where(np.isfinite(turned), turned, 0.0)
    return position, rotation


def network_start(block: Block, xyz_m: Float) -> tuple[Float, tuple[Note, ...]]:
    """Start values of points that only geodetic observations tell, and what there is to say of them.

    Parameters
    ----------
    xyz_m : (n_points, 3) float64, m
        NaN where unknown.
    """
    g = block.geodetic
    between = g.active & (g.start_kind == "point") & (g.end_kind == "point")
    if not between.any():
        return xyz_m, ()
    start, end, via = (rows_of(ids, block.points.id) for ids in (g.start, g.end, g.via))
    rise = np.nan_to_num(g.end_height_m) - np.nan_to_num(g.start_height_m)
    network = {}
    for type_ in np.unique(g.type[between]).tolist():
        rows = np.flatnonzero(between & (g.type == type_))
        network[type_] = NetworkObservations(start[rows], end[rows], g.value[rows], via[rows], g.set[rows], rise[rows])
    touched = np.zeros(len(xyz_m), dtype=bool)
    for m in network.values():
        touched[m.start] = touched[m.end] = True
    if np.isfinite(xyz_m[touched]).all():
        return xyz_m, ()
    computed, doubtful = approximate_coordinates(network, xyz_m)
    new: Bool = np.asarray((np.isfinite(computed) & ~np.isfinite(xyz_m)).any(axis=1))
    notes = _without_place(block, network, computed)
    if not new.any():
        return xyz_m, tuple(notes)
    text = f"approximate coordinates of {several(int(new.sum()), 'point')} found from the geodetic observations"
    notes.append(Note("note", text, tuple(block.points.id[new].tolist())))
    unsure = [k for k in sorted(doubtful) if new[k]]
    if unsure:
        text = (
            "approximate coordinates may be a mirror image, two places fitted about as well: see that sigma0 is small"
        )
        notes.append(Note("warning", text, tuple(block.points.id[unsure].tolist())))
    return np.where(np.isfinite(xyz_m), xyz_m, computed), tuple(notes)


def _without_place(block: Block, network: dict[str, NetworkObservations], xyz_m: Float) -> list[Note]:
    """Points that angles see and that have no place in plan."""
    seen = np.zeros(len(xyz_m), dtype=bool)
    for type_ in ("angle", "direction", "azimuth"):
        if type_ in network:
            seen[network[type_].start] = seen[network[type_].end] = True
    lost = seen & ~np.isfinite(xyz_m[:, :2]).all(axis=1)
    if not lost.any():
        return []
    text = "no place follows from the observations of points: their rays are parallel, or nearly, or too few"
    return [Note("warning", text, tuple(block.points.id[lost].tolist()))]


def start_origin(poses: Poses, xyz_m: Float) -> Float:
    """A round place near the block, (3,) m: coordinates are reduced to it before any arithmetic."""
    origin = np.zeros(3)
    for axis in range(3):
        for values in (xyz_m[:, axis], poses.position_m[:, axis]):
            finite = values[np.isfinite(values)]
            if len(finite):
                origin[axis] = np.round(finite.mean())
                break
    return origin


def given_points(block: Block, initial: Solution | None) -> Float:
    """Coordinates of `initial`; where it has none, those the block gives as control or approximate values."""
    xyz = np.full((len(block.points), 3), np.nan)
    xyz[block.ground_points.point] = np.where(block.ground_points.role == CHECK, np.nan, block.ground_points.xyz_m)
    if initial is None:
        return xyz
    if not np.array_equal(initial.points.id, block.points.id):
        raise ArtifactError(
            f"`initial` belongs to another block than {block.name}: its points differ",
            remedy="check `from` in pipeline.yaml",
        )
    return np.where(np.isfinite(initial.points.xyz_m), initial.points.xyz_m, xyz)
