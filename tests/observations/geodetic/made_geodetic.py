"""A block of one geodetic observation, for tests."""

from __future__ import annotations

from pathlib import Path

from aatri.artifacts.block import Block, Geodetic
from aatri.artifacts.builder import block_of


def geodetic_block(type_: str, ends: tuple[str, str], above: tuple[float, float], group: str = "") -> Block:
    """From A or image a to B or image b; an angle is at C. The value is 0.5 rad or 100 m."""
    angular = type_ in ("direction", "azimuth", "angle", "zenith")
    names = [{"point": p, "image": i}[kind] for kind, p, i in zip(ends, "AB", "ab")]

    row = Geodetic.of(
        type=[type_],
        start=[names[0]],
        end=[names[1]],
        via=["C" if type_ == "angle" else ""],
        start_kind=[ends[0]],
        end_kind=[ends[1]],
        value=[0.5 if angular else 100.0],
        sigma=[0.01],
        set=["s" if type_ == "direction" else ""],
        group=[group],
        start_height_m=[above[0]],
        end_height_m=[above[1]],
    )
    return block_of(
        name="one",
        files=[Path("one")],
        points=["A", "B", "C"],
        image_points={},
        geodetic=row,
        cameras={"id": ["c"], "principal_distance_mm": [1.0]},
        images={"id": ["a", "b"], "camera": ["c", "c"], "sequence": [0.0, 1.0]},
    )
