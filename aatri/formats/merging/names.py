"""Other ids for a block: a prefix before those of a kind, single ids replaced, some that stay whatever the prefix."""

from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any, Literal

import numpy as np
from pydantic import Field

from aatri.arrays import Bool, Text
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.formats.merging.part import in_canonical_order
from aatri.ids import printable
from aatri.options import Options

Kind = Literal["images", "points", "cameras", "strips", "groups"]
"""Of ids; groups are flights, sessions, rigs, drift groups, sets of directions, models, groups of observations."""

_WITH_ID: tuple[Kind, ...] = ("cameras", "strips", "images", "points")

GROUPS = {
    "images": ("flight", "session", "rig"),
    "rig_members": ("rig",),
    "image_points": ("group",),
    "exterior": ("drift_group",),
    "geodetic": ("set", "group"),
    "model_coordinates": ("model",),
}
"""Columns with ids of groups."""


class RenamingOptions(Options):
    """How the ids of a block change."""

    prefix: dict[Kind, str] = Field({}, description="set before its ids, by kind: `{images: e-, points: e-}`")
    rename: dict[Kind, dict[str, str]] = Field(
        {}, description="single ids by kind, before any prefix: `{points: {K1: 1001}}`"
    )
    common: list[str] = Field([], description="ids, with * and ?, that get no prefix: those that the others have too")

    def of(self, kind: Kind, ids: Text) -> Text:
        """Ids of a kind after it; an empty id stays empty."""
        prefix, own = self.prefix.get(kind, ""), self.rename.get(kind, {})
        if not (prefix or own) or not len(ids):
            return ids
        names, inverse = np.unique(ids, return_inverse=True)
        changed = [self._one(name, prefix, own) for name in names.tolist()]
        return np.asarray(np.array(changed, dtype=np.str_)[inverse])

    def _one(self, name: str, prefix: str, own: Mapping[str, str]) -> str:
        if name in own:
            return own[name]
        stays = not name or any(fnmatchcase(name, pattern) for pattern in self.common)
        return name if stays else f"{prefix}{name}"


def renamed(block: Block, names: RenamingOptions) -> Block:
    """The block with other ids, in canonical order again.

    Raises
    ------
    InputError
        If an id that is to be replaced does not exist, or two become one.
    """
    if not any((*names.prefix.values(), *names.rename.values())):
        return block
    tables: dict[str, Any] = {}
    for kind in _WITH_ID:
        table: Any = getattr(block, kind)
        tables[kind] = replace(table, id=names.of(kind, table.id))
        _check(block, kind, table.id, tables[kind].id, names)
    for name, columns in GROUPS.items():
        table = tables.get(name, getattr(block, name))
        if table is not None:
            tables[name] = replace(
                table, **{column_name: names.of("groups", getattr(table, column_name)) for column_name in columns}
            )
    sights, members = tables["geodetic"], block.relative_control_members
    tables["geodetic"] = replace(
        sights,
        start=_at_either(names, sights.start_kind == "image", sights.start),
        end=_at_either(names, sights.end_kind == "image", sights.end),
        via=names.of("points", sights.via),
    )
    ids = _at_either(names, members.part == "images", members.id)
    tables["relative_control_members"] = replace(members, id=ids)
    return in_canonical_order(replace(block, **tables))


def _at_either(names: RenamingOptions, image: Bool, ids: Text) -> Text:
    """Ids of images, and of points elsewhere."""
    return np.where(image, names.of("images", ids), names.of("points", ids))


def _check(block: Block, kind: Kind, before: Text, after: Text, names: RenamingOptions) -> None:
    where = f"block {block.name}: rename"
    unknown = sorted(set(names.rename.get(kind, {})) - set(before.tolist()))
    if unknown:
        raise InputError(f"{kind} has no {printable(unknown[0])}", where=where, remedy="give an id of this block")
    ids, count = np.unique(after, return_counts=True)
    if (count > 1).any():
        both = ", ".join(printable(str(name)) for name in before[after == ids[count > 1][0]])
        what = f"{kind} {both} would both be called {printable(str(ids[count > 1][0]))}"
        raise InputError(what, where=where, remedy="give them names of their own")
