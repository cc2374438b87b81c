"""The geodetic observations of a Block as the network from which approximate coordinates are found."""

import numpy as np

from aatri.arrays import Bool, Float
from aatri.artifacts.block import Block
from aatri.ids import rows_of, several
from aatri.notes import Note
from aatri.orientation.network.start import NetworkObservations, approximate_coordinates


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
