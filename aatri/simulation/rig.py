"""A rig of cameras at every station: the frame, and members displaced and turned from it.

    X = X_f + R_f t,    R = R_f Rx(omega) Ry(phi) Rz(kappa)      in Cartesian axes, by SciPy's rotations

All members are cameras of one kind. Positions and attitudes are observed at the frame alone.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from aatri.arrays import Text
from aatri.artifacts import block as b
from aatri.simulation.flight import FlightPlan
from aatri.simulation.rays import Photography
from aatri.simulation.settings import RigMemberOptions

NAME, FRAME = "R", "frame"


@dataclass(frozen=True)
class Rigged:
    """Stations of all images, and which member of the rig each is."""

    plan: FlightPlan
    photography: Photography
    member: Text


def rigged(plan: FlightPlan, photography: Photography, members: dict[str, RigMemberOptions]) -> Rigged:
    """Every station once for the frame and once for every member; ids get the name of the member."""
    n = len(plan.id)
    if not members:
        return Rigged(plan, photography, np.full(n, ""))
    stations, rotations = [photography.station_m], [photography.rotation]
    ids, names = list(plan.id), [FRAME] * n
    cartesian = photography.cartesian_rotations()
    for name, member in members.items():
        place = photography.moved(member.position_m)
        turned = cartesian @ Rotation.from_euler("XYZ", member.angles_deg, degrees=True).as_matrix()
        level = replace(photography, station_m=place, rotation=np.broadcast_to(np.eye(3), (n, 3, 3)))
        stations.append(place)
        rotations.append(level.cartesian_rotations().swapaxes(1, 2) @ turned)
        ids += [f"{station}{name}" for station in plan.id]
        names += [name] * n
    k = 1 + len(members)
    more: dict[str, Any] = {
        "id": ids,
        "strip": list(plan.strip) * k,
        "sequence": np.tile(plan.sequence, k),
        "time_s": np.tile(plan.time_s, k),
        "heading_rad": np.tile(plan.heading_rad, k),
        "position_m": np.tile(plan.position_m, (k, 1)),
    }
    seen = replace(photography, station_m=np.concatenate(stations), rotation=np.concatenate(rotations))
    return Rigged(replace(plan, **more), seen, np.array(names))


def rig_table(members: dict[str, RigMemberOptions]) -> b.RigMembers:
    """The rig as the block declares it: places and angles with their errors, sigmas, status."""
    if not members:
        return b.RigMembers.empty()
    names = [FRAME, *sorted(members)]
    rows = [members[name] for name in names[1:]]
    none = np.zeros((1, 3))
    nominal_m = np.array([np.add(m.position_m, m.error_m) for m in rows])
    angles = np.radians([np.add(m.angles_deg, m.error_deg) for m in rows])
    sigma = np.array([[m.sigma_m] * 3 for m in rows])
    turn = np.radians([[m.sigma_deg] * 3 for m in rows])
    free = np.concatenate([none > 0, np.array([[m.free] * 3 for m in rows])])
    return b.RigMembers.of(
        rig=NAME,
        member=names,
        is_frame=np.arange(len(names)) == 0,
        position_m=np.concatenate([none, nominal_m]),
        angles_rad=np.concatenate([none, angles]),
        position_sigma_m=np.where(free, np.nan, np.concatenate([none, sigma])),
        position_free=free,
        angle_sigma_rad=np.where(free, np.nan, np.concatenate([none, turn])),
        angle_free=free,
    )
