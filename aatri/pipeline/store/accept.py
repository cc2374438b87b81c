"""`aatri accept`: the user's word that a change of code does not matter to a result.

    RUN/accepted/STAGE/NEWKEY.json      {old, new, why, by, time}

It leads from the key that the stage has now to the result that was made with other code. Nothing is changed or removed:
without that file the stage is stale again.
"""

import contextlib
import getpass
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError, SpecError
from aatri.pipeline.store import inside
from aatri.pipeline.store.inside import on_disk, write_json
from aatri.pipeline.store.objects import base_of
from aatri.pipeline.store.provenance import now
from aatri.pipeline.store.records import read_json

_ACCEPTABLE = ("code", "version")


def accepted_key(run: Path, stage: str, key: str) -> str | None:
    """The key of the result that serves for a key by the user's word; None if there is none."""
    with contextlib.suppress(ArtifactError):
        entry = read_json(base_of(run), *_at(stage, key))
        return str(entry.get("old")) if entry is not None and entry.get("new") == key else None
    return None


def accept(run: Path, stage: str, old: Mapping[str, Any] | None, new: Mapping[str, Any], key: str, why: str) -> Path:
    """Write that the result of a record serves for a key.

    Parameters
    ----------
    old : mapping or None
        Record of the result that is to serve.
    new : mapping
        What the key that it is to serve for is made of.
    key : str
        That key.
    why : str
        The user's reason.

    Raises
    ------
    SpecError
        If there is no result, or more than code has changed.
    """
    if old is None:
        raise SpecError(f"{stage} has no result to accept", where=str(run), remedy="aatri run")
    changed = [name for name in new if old["parts"].get(name) != new[name] and name not in _ACCEPTABLE]
    if changed:
        raise SpecError(
            f"of {stage} not only the code has changed but also {', '.join(changed)}",
            where=str(run),
            remedy="a new result is needed: aatri run",
        )
    base = base_of(run)
    entry = {"stage": stage, "old": old["key"], "new": key, "why": why, "by": getpass.getuser(), "time": now()}
    with on_disk(base / "accepted"):
        inside.make_folder(base, "accepted", stage)
        write_json(entry, base, *_at(stage, key))
    return inside.path_of(base, *_at(stage, key))


def _at(stage: str, key: str) -> tuple[str, ...]:
    return "accepted", stage, f"{key}.json"
