"""Removes results that nothing refers to, to free the disk.

What is current, or was last, in the run or any of its variants stays; of the others of each stage the latest few, and
those not old enough. A result's record goes first, so that a crash leaves no record without its artifact.
"""

from __future__ import annotations

import contextlib
import datetime
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError
from aatri.pipeline.store.durable import on_disk, sync
from aatri.pipeline.store.objects import VARIANTS, base_of, read_record


@dataclass(frozen=True)
class Garbage:
    """A result that may go: its folder, when it was made, and how large it is in bytes."""

    stage: str
    key: str
    folder: Path
    ended: str
    size: int


def garbage(run: Path, keep: int, older_days: float | None, now: datetime.datetime) -> list[Garbage]:
    """What may go.

    Parameters
    ----------
    run : Path
    keep : int
        So many of the latest results of each stage stay, beside those referred to.
    older_days : float, optional
        Only what is older than this.
    now : datetime
    """
    base = base_of(run)
    kept = set(_referred(base))
    found: list[Garbage] = []
    for stage in sorted(p for p in (base / "objects").glob("*") if p.is_dir()):
        others = [_garbage(stage.name, p) for p in stage.iterdir() if p.is_dir() and (stage.name, p.name) not in kept]
        for one in sorted(others, key=lambda g: (g.ended, g.key), reverse=True)[keep:]:
            if older_days is None or _age_days(one, now) > older_days:
                found.append(one)
    return found


def remove(results: list[Garbage]) -> None:
    """Remove results; the record first."""
    for one in results:
        with on_disk(one.folder):
            (one.folder / "record.json").unlink(missing_ok=True)
            sync(one.folder)
            shutil.rmtree(one.folder)


def _referred(base: Path) -> Iterator[tuple[str, str]]:
    for run in [base, *(base / VARIANTS).glob("*")]:
        for folder in ("current", "previous"):
            for path in (run / folder).glob("[!.]*.json"):  # not what a killed process left half-written
                with contextlib.suppress(ArtifactError):
                    record = read_record(path)
                    if record is not None:
                        yield record["stage"], record["key"]
                        continue
                raise ArtifactError("cannot be read, so it is not known what it refers to", where=str(path),
                                    remedy="aatri run writes it again")  # fmt: skip


def _garbage(stage: str, folder: Path) -> Garbage:
    record: dict[str, Any] = {}
    with contextlib.suppress(ArtifactError):
        record = read_record(folder / "record.json") or {}
    size = sum(p.stat().st_size for p in folder.iterdir() if p.is_file())
    return Garbage(stage, folder.name, folder, str(record.get("ended", "")), size)


def _age_days(one: Garbage, now: datetime.datetime) -> float:
    """Age in days; what has no readable record is of no use to anyone and as good as old."""
    if not one.ended:
        return float("inf")
    return (now - datetime.datetime.fromisoformat(one.ended)).total_seconds() / 86400
