"""The store as the planner sees it: read only, every file looked at once.

The SHA-256 of an artifact is remembered with its size, times and inode, from when it is written on; with `verify` every
file is read again.
"""

import contextlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError
from aatri.pipeline.plan.decisions import Integrity
from aatri.pipeline.plan.graph import StageNode
from aatri.pipeline.plan.keys import file_digests
from aatri.pipeline.store import run_folder as store
from aatri.pipeline.store.accept import accepted_key
from aatri.pipeline.store.cache import Cache, cache_name, file_sha256, of_file, put_file
from aatri.pipeline.store.objects import artifact_file, base_of, object_record, records_of
from aatri.pipeline.store.records import read_json


class StoreView:
    """A view of a run folder.

    Parameters
    ----------
    verify : bool
        Read every artifact and input file, whatever is remembered of it.
    """

    def __init__(self, run: Path, *, verify: bool = False) -> None:
        self._run, self._verify = run, verify
        self._cache = Cache(cache_name("files", base_of(run)))
        self._fresh_digests: dict[Path, str] = {}

    def record(self, stage: str, key: str) -> dict[str, Any] | None:
        """The record of a result; None if there is none that can be trusted."""
        try:
            return object_record(self._run, stage, key)
        except ArtifactError:
            return None

    def records(self, stage: str) -> Iterable[dict[str, Any]]:
        """The records of all results of a stage."""
        return records_of(self._run, stage)

    def last(self, stage: str) -> dict[str, Any] | None:
        """The record of the last result that was current."""
        return store.last_record(self._run, stage)

    def accepted(self, stage: str, key: str) -> str | None:
        """The key of a result that the user accepts for this key."""
        return accepted_key(self._run, stage, key)

    def integrity(self, record: Mapping[str, Any]) -> Integrity:
        """Whether the artifact of a record is whole."""
        try:
            digest = self._digest(artifact_file(self._run, record))
        except OSError as error:
            return Integrity.altered if isinstance(error, ArtifactError) else Integrity.missing
        return Integrity.intact if digest == record["output"]["sha256"] else Integrity.altered

    def failed_key(self, stage: str) -> str | None:
        """The key that the last attempt failed with."""
        with contextlib.suppress(ArtifactError):
            failure = store.failure(self._run, stage)
            return failure.get("key") if failure is not None else None
        return None

    def interrupted_key(self, stage: str) -> str | None:
        """The key of an attempt that did not come to its end."""
        with contextlib.suppress(ArtifactError):
            under_way = read_json(self._run, "running", f"{stage}.json")
            return under_way.get("key") if under_way is not None else None
        return None

    def files(self, node: StageNode) -> dict[str, str]:
        """Content digests of the files that options name."""
        digests: dict[str, str] = {}
        for option, path in node.files.items():
            digests |= file_digests(option, Path(path), self._digest)
        return digests

    def committed(self, record: Mapping[str, Any]) -> None:
        """Remember an artifact that this run has just written, with the digest of what was written."""
        with contextlib.suppress(OSError):
            put_file(artifact_file(self._run, record).absolute(), self._cache, record["output"]["sha256"])

    def save(self) -> None:
        """Keep the digests."""
        self._cache.save()

    def _digest(self, path: Path) -> str:
        if not self._verify:
            return str(of_file(path.absolute(), self._cache, file_sha256))
        if path not in self._fresh_digests:
            self._fresh_digests[path] = file_sha256(path)
        return self._fresh_digests[path]
