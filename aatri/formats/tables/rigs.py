"""Rigs of block.yaml as a table, and what images.csv says of them.

Images of one rig with the same time, or else the same strip and sequence, are one exposure: it has each member once.
"""

import numpy as np

from aatri.artifacts.block import RigMembers
from aatri.errors import InputError
from aatri.formats.tables.source import Source, ask_for_angle_unit, look_up, plain_angle_rad
from aatri.formats.text.csv_table import CsvTable
from aatri.ids import canonical, clipped, did_you_mean


def rig_member_table(source: Source) -> RigMembers:
    """Members of the rigs: by rig, its frame first, then by member."""
    rigs = source.settings.rigs
    listed = []
    for rig in canonical(rigs):
        first, *others = rigs[rig]
        listed += [(rig, name, name == first, rigs[rig][name]) for name in (first, *canonical(others))]
        if any(any(m.angles) or any(0 < s < np.inf for s in m.sigmas.angles) for m in rigs[rig].values()):
            ask_for_angle_unit(source, "a rig has angles", "rigs", rig)
    unit, members = plain_angle_rad(source), [m for *_, m in listed]
    position_sigma = np.array([m.sigmas.position for m in members], float)
    angle_sigma = np.array([m.sigmas.angles for m in members], float)
    return RigMembers.of(
        rig=[rig for rig, *_ in listed],
        member=[name for _, name, *_ in listed],
        is_frame=[first for *_, first, _ in listed],
        position_m=[m.position for m in members],
        angles_rad=np.array([m.angles for m in members], float) * unit,
        position_sigma_m=np.where(np.isinf(position_sigma), np.nan, position_sigma),
        position_free=np.isinf(position_sigma),
        angle_sigma_rad=np.where(np.isinf(angle_sigma), np.nan, angle_sigma) * unit,
        angle_free=np.isinf(angle_sigma),
    )


def check_rigs_of_images(source: Source, table: CsvTable) -> None:
    """Faults of the columns rig and member of images.csv."""
    rigs = source.settings.rigs
    rig, member = table.text["rig"], table.text["member"]
    if not any(rig) and not any(member):
        return
    look_up(table, "rig", {name: k for k, name in enumerate(rigs)}, "rig", "add it to `rigs` in block.yaml")
    table.complain(
        [k for k, name in enumerate(rig) if bool(name) != bool(member[k])],
        "rig",
        "rig is {}: an image has both rig and member, or none",
        "fill in the other column",
    )
    for k, name in enumerate(member):
        members = rigs.get(rig[k], {})
        if name and members and name not in members:
            what = f"rig {clipped(rig[k])} has no member {clipped(name)!r}{did_you_mean(name, members)}"
            error = InputError(what, where=table.where(k, "member"), remedy="add it to the rig in block.yaml")
            table.problems.append(error)
    first: dict[tuple[str, str, object], int] = {}
    for k, name in enumerate(rig):
        if not name or not member[k]:
            continue
        exposure = _exposure(table, k)
        if exposure is None:
            table.complain(
                [k],
                "rig",
                "an image of rig {} needs time, or strip and sequence",
                "they say which images are one exposure",
            )
            continue
        earlier = first.setdefault((name, member[k], exposure), k)
        if earlier != k:
            what = f"member {clipped(member[k])} of rig {clipped(name)} twice in one exposure, first in line"
            table.complain([k], "member", f"{what} {table.line[earlier]}", "mend time, strip or sequence")


def _exposure(table: CsvTable, k: int) -> object | None:
    """What images of one exposure have in common; None if the row does not say."""
    time, sequence = float(table.number["time"][k]), float(table.number["sequence"][k])
    if np.isfinite(time):
        return time
    return (table.text["strip"][k], sequence) if table.text["strip"][k] and np.isfinite(sequence) else None
