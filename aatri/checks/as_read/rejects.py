"""What is set aside of a block: the list of rejects, and how it is told.

Seen: rows that cannot be used, each with its reason, from the other checks of this room.
Test: none; many of one kind for one reason are told in one line.
"""

from collections.abc import Sequence
from dataclasses import replace

from aatri.artifacts.block import BY_EDIT, Block, Imported, Rejects
from aatri.checks.finding import Finding
from aatri.checks.limits import MOST_LISTED, MOST_REJECTS_TOLD
from aatri.ids import printable


def rejected(
    block: Block, kind: str, table: Imported, rows: Sequence[int], names: Sequence[str], reasons: Sequence[str]
) -> Block:
    """The block with rows of a table listed in its rejects."""
    if not len(rows):
        return block
    rejects = Rejects.of(kind=kind, id=names, reason=reasons, file=table.file[rows], line=table.line[rows])
    return replace(block, rejects=block.rejects.followed_by(rejects))


def in_order(rejects: Rejects) -> Rejects:
    """By kind, id and reason, each once."""
    columns = (rejects.kind, rejects.id, rejects.reason, rejects.file, rejects.line)
    rows = sorted(set(zip(*(column.tolist() for column in columns))), key=lambda r: (r[0], r[1].encode(), *r[2:]))
    if not rows:
        return Rejects.empty()
    return Rejects.of(**dict(zip(("kind", "id", "reason", "file", "line"), zip(*rows))))


def told_rejects(rejects: Rejects) -> list[Finding]:
    """A warning each; many of one kind for one reason in one line. Of what the user has switched off there is none."""
    same: dict[tuple[str, str], list[str]] = {}
    for kind, name, reason in zip(rejects.kind.tolist(), rejects.id.tolist(), rejects.reason.tolist()):
        if not reason.startswith(BY_EDIT):
            same.setdefault((kind, reason), []).append(printable(str(name)))
    findings = []
    for (kind, reason), names in same.items():
        if len(names) > MOST_REJECTS_TOLD:
            text = f"rejected: {len(names)} of kind {kind}: {reason}"
            findings.append(Finding("rejects", "warning", text, ids=tuple(names)))
        else:
            findings += [Finding("rejects", "warning", f"rejected: {kind} {name}: {reason}") for name in names]
    return findings


def listed(names: Sequence[str], places: Sequence[str]) -> str:
    """The first of some names with their places."""
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    pairs = list(zip(names, places))[:MOST_LISTED]
    return ", ".join(f"{printable(name)} ({place})" if place else printable(name) for name, place in pairs) + more


def name_of_image_point(block: Block, row: int) -> str:
    """`image/point` of an image point."""
    rows = block.image_points
    return f"{block.images.id[rows.image[row]]}/{block.points.id[rows.point[row]]}"
