"""A block read as a run would read it, into a folder that is removed again: what would be refused and warned of."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri.errors import AatriError

if TYPE_CHECKING:
    from aatri.pipeline.plan.graph import StageNode
    from aatri.pipeline.spec.pipeline_file import Spec


@dataclass
class BlockReading:
    """What the stages that read a block say; listens to their run."""

    warnings: list[str] = field(default_factory=list)
    """With the name of the stage."""
    records: dict[str, Any] = field(default_factory=dict)
    """By stage, of those that were made."""
    error: AatriError | None = None
    """What was refused."""

    def warned(self, stage: str, message: str) -> None:
        """Take a warning."""
        self.warnings.append(f"{stage}: {message}")

    def finished(self, record: Any) -> None:
        """Take a record."""
        self.records[record["stage"]] = record

    def planned(self, *_: object) -> None:
        """Drop it, as all that follows."""

    started = logged = advanced = failed = planned


def block_reading(spec: Spec, nodes: tuple[StageNode, ...], local: Path | None = None) -> BlockReading:
    """Run the stages that read files, alone; those of `local` too, a folder of plugins."""
    from aatri.pipeline.plan.decisions import Selection
    from aatri.pipeline.run.runner import RunSettings, run_pipeline
    from aatri.pipeline.run.task import StageSource

    reading = BlockReading()
    with tempfile.TemporaryDirectory() as folder:
        elsewhere = replace(spec, run=Path(folder) / "run")
        source = StageSource(local=local, runs_code=local is not None)
        settings = RunSettings(Selection(frozenset(spec.sources)), source=source)
        try:
            run_pipeline(elsewhere, nodes, reading, settings)
        except AatriError as error:
            reading.error = error
    return reading
