"""Positions of images that cannot be right are set aside by name; more of them than the share are an error.

One may always go, however few there are: a single record of zero must not stop a block, nor switch off the others. All
go where they are all the same: a receiver without a fix repeats its last, and says nothing of any image.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adapters.sanity_as_given import all_the_same, impossible, place_of_position
from aatri.artifacts.block import Block, Rejects
from aatri.errors import InputError
from aatri.ids import printable

MOST_LISTED = 20


def without_impossible_positions(block: Block, max_share: float) -> tuple[Block, list[InputError]]:
    """The block without these positions, listed in its rejects; or the error of too many.

    Parameters
    ----------
    block : Block
    max_share : float
        Largest share of the positions that may be set aside; one may always.
    """
    found = impossible(block)
    if not found:
        return block, []
    rows = np.array(list(found))
    exterior = block.exterior
    total = int(np.isfinite(exterior.position_m).all(axis=1).sum())
    places = [place_of_position(block, int(row)) for row in rows]
    if len(rows) > max(1.0, max_share * total) and not all_the_same(found):
        reasons = list(dict.fromkeys(found.values()))
        told = [f"{printable(image)}{f' ({where})' if where else ''}{f': {why}' if len(reasons) > 1 else ''}"
                for (image, where), why in zip(places, found.values())]  # fmt: skip
        more = f"; and {len(told) - MOST_LISTED} more" if len(told) > MOST_LISTED else ""
        what = f"{len(rows)} of {total} positions cannot be right"
        what += f", {reasons[0]}" if len(reasons) == 1 else ""
        what += f"; at most {max_share:.0%} may be set aside: "
        remedy = "mend these rows, or leave their coordinates empty; or allow more with max_reject_share"
        return block, [InputError(what + "; ".join(told[:MOST_LISTED]) + more, where=places[0][1], remedy=remedy)]
    position, covariance = exterior.position_m.copy(), exterior.position_covariance_m2.copy()
    use, group = exterior.position_use.copy(), exterior.drift_group.copy()
    position[rows], covariance[rows], use[rows], group[rows] = np.nan, np.nan, 0, ""
    old = block.rejects
    rejects = Rejects(
        kind=np.array([*old.kind, *["exterior"] * len(rows)]),
        id=np.array([*old.id, *(image for image, _ in places)]),
        reason=np.array([*old.reason, *found.values()]),
        file=np.append(old.file, exterior.file[rows]).astype(np.int32),
        line=np.append(old.line, exterior.line[rows]).astype(np.int32),
    )
    kept = replace(exterior, position_m=position, position_covariance_m2=covariance, position_use=use,
                   drift_group=group)  # fmt: skip
    return replace(block, exterior=kept, rejects=rejects), []
