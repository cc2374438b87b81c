"""What of a Block an adjustment cannot do without: something that says where the block lies."""

from typing import Literal

from aatri.artifacts.offers import SIMILARITY, WITHOUT_SHIFT
from aatri.tables.offers import Need


def datum_needed(*, positions: bool = True, shift: Literal["none", "group", "all"] = "none") -> tuple[Need, ...]:
    """What an adjustment whose datum is given by its observations cannot do without.

    Parameters
    ----------
    positions : bool
        Positions are used.
    shift : str
        Which of them have an unknown shift: none, those of drift groups, all.
    """
    names: tuple[str, ...] = ("ground_points.xyz_m", "exterior.position_m")
    text = "neither control nor observed positions"
    remedy = "give control (ground_points.csv) or observed positions (exterior.csv)"
    if not positions:
        names, text = names[:1], "no control"
    elif shift != "none":
        names = (names[0], WITHOUT_SHIFT) if shift == "group" else names[:1]
        text = "no control and no observed position outside drift groups" if shift == "group" else "no control"
        remedy = "give control (ground_points.csv), or take the positions as they are: `positions: {drift: none}`"
    remedy += "; or `datum: free` in a bundle, after initial_orientation/graph if there are images"
    enough = "the block has neither three control points nor anything else that says how it lies"
    return (
        Need("block", names, f"the block has {text}", remedy),
        Need("block", (SIMILARITY, "exterior.position_m"), enough, f"three control points; or {remedy}"),
    )
