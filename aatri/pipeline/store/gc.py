"""Removes results that nothing refers to, to free the disk.

What is current, or was last, in the run or any of its variants stays; of the others of each stage the latest few, and
those not old enough. A result's record goes first, so that a crash leaves no record without its artifact.

Of single items (`run.items`), whose files bear the time of their last use, those go that have not been used since the
oldest result of their stage that stays was begun. A stage without any result may be under way: its items stay, but for
those older than is asked for.
"""

import contextlib
import datetime
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError
from aatri.pipeline.store import inside
from aatri.pipeline.store.inside import VARIANTS, on_disk
from aatri.pipeline.store.objects import ITEMS, OBJECTS, RECORD, base_of
from aatri.pipeline.store.records import ARTIFACT, read_record

_KEY = re.compile("[0-9a-f]{12}")
_ITEM = re.compile("[0-9a-f]{32}[.]h5")
OURS = (ARTIFACT, RECORD, "stage.log")
"""Files of a result: a folder with others is somebody's, and stays."""


@dataclass(frozen=True)
class Garbage:
    """A result or item that may go: its folder or file, when it was made or last used, and how large it is in bytes."""

    stage: str
    key: str
    folder: Path
    ended: str
    size: int


def garbage(run: Path, keep: int, older_days: float | None, now: datetime.datetime) -> list[Garbage]:
    """What may go.

    Parameters
    ----------
    keep : int
        So many of the latest results of each stage stay, beside those referred to.
    older_days : float, optional
        Only what is older than this.
    """
    base = base_of(run)
    kept = set(_referred(base))
    removable: list[Garbage] = []
    for stage in inside.names_in(base, OBJECTS):
        if inside.kind(base, OBJECTS, stage) != "folder":
            continue  # nothing of aatri's: let be
        keys = [key for key in inside.names_in(base, OBJECTS, stage) if (stage, key) not in kept]
        others = [_garbage(base, stage, k) for k in keys if _is_ours(base, stage, k)]
        for one in sorted(others, key=lambda g: (g.ended, g.key), reverse=True)[keep:]:
            if older_days is None or _age_days(one, now) > older_days:
                removable.append(one)
    removed = {one.folder for one in removable}
    for stage in inside.names_in(base, ITEMS):
        if inside.kind(base, ITEMS, stage) == "folder":
            items = _unused_items(base, stage, removed, now if older_days is not None else None)
            removable += [one for one in items if older_days is None or _age_days(one, now) > older_days]
    return removable


def _unused_items(
    base: Path, stage: str, removed: Collection[Path], else_before: datetime.datetime | None
) -> list[Garbage]:
    """Items not used since the oldest result of their stage that does not go was begun; without any, since a time."""
    begun = []
    for key in inside.names_in(base, OBJECTS, stage):
        if inside.path_of(base, OBJECTS, stage, key) not in removed:
            with contextlib.suppress(ArtifactError):
                record = read_record(base, OBJECTS, stage, key, RECORD)
                begun += [datetime.datetime.fromisoformat(record["started"])] if record is not None else []
    before, items = min(begun, default=else_before), []
    for name in inside.names_in(base, ITEMS, stage) if before is not None else ():
        if _ITEM.fullmatch(name) and inside.kind(base, ITEMS, stage, name) == "file":
            path = inside.path_of(base, ITEMS, stage, name)
            used = datetime.datetime.fromtimestamp(path.stat().st_mtime, datetime.UTC)
            if before is not None and used < before:
                items.append(Garbage(stage, path.stem, path, used.isoformat(timespec="seconds"), path.stat().st_size))
    return items


def remove(run: Path, results: list[Garbage]) -> None:
    """Remove results; the record first."""
    base = base_of(run)
    for one in results:
        if one.folder.suffix:
            with on_disk(one.folder.parent):
                inside.remove(base, ITEMS, one.stage, one.folder.name)
            continue
        at = (OBJECTS, one.stage, one.key)
        with on_disk(one.folder):
            inside.remove(base, *at, RECORD)
            inside.sync(one.folder)
            inside.remove_folder(base, *at)


def _referred(base: Path) -> Iterator[tuple[str, str]]:
    variants = [name for name in inside.names_in(base, VARIANTS) if inside.kind(base, VARIANTS, name) != "file"]
    for run in [base, *(base / VARIANTS / name for name in variants)]:
        for folder in ("current", "previous"):
            for name in inside.names_in(run, folder):
                if name.startswith(".") or not name.endswith(".json"):
                    continue  # what a killed process left half-written, or a link to an artifact
                with contextlib.suppress(ArtifactError):
                    record = read_record(run, folder, name)
                    if record is not None:
                        yield record["stage"], record["key"]
                        continue
                raise ArtifactError(
                    "cannot be read, so it is not known what it refers to",
                    where=str(run / folder / name),
                    remedy="aatri run writes it again",
                )


def _is_ours(base: Path, stage: str, key: str) -> bool:
    """Whether a folder is that of a result: named by its record, or half-made; and holds nothing else."""
    at = (OBJECTS, stage, key)
    if inside.kind(base, *at) != "folder" or not _KEY.fullmatch(key):
        return False
    names = inside.names_in(base, *at)
    if any(name not in OURS and not name.startswith(".tmp-") for name in names):
        return False
    with contextlib.suppress(ArtifactError):
        record = read_record(base, *at, RECORD)
        return record is None or (record["stage"], record["key"]) == (stage, key)
    return True


def _garbage(base: Path, stage: str, key: str) -> Garbage:
    at = (OBJECTS, stage, key)
    record: dict[str, Any] = {}
    with contextlib.suppress(ArtifactError):
        record = read_record(base, *at, RECORD) or {}
    files = [name for name in inside.names_in(base, *at) if inside.kind(base, *at, name) == "file"]
    folder = inside.path_of(base, *at)
    size = sum((folder / name).stat().st_size for name in files)
    return Garbage(stage, key, folder, str(record.get("ended", "")), size)


def _age_days(one: Garbage, now: datetime.datetime) -> float:
    """Age in days; what has no readable record is of no use to anyone and as good as old."""
    if not one.ended:
        return float("inf")
    return (now - datetime.datetime.fromisoformat(one.ended)).total_seconds() / 86400
