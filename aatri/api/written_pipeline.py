"""A pipeline given as a mapping, written as the file that the command line takes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aatri.artifacts.block import Block
from aatri.errors import SpecError


def written(pipeline: Mapping[str, Any]) -> Path:
    """Write a pipeline beside the folder of its run, and every Block among its stages as a block folder.

    Returns
    -------
    Path
        RUN.yaml

    Raises
    ------
    SpecError
        If it says no `run`, or no `stages`.
    """
    import yaml

    from aatri.formats.tables.writer import write_block

    run, stages = pipeline.get("run"), pipeline.get("stages")
    if not isinstance(run, str | Path) or not isinstance(stages, Mapping):
        raise SpecError(
            "a pipeline needs `run`, the folder of its results, and `stages`", remedy="see docs/pipeline.md"
        )
    folder = Path(run)
    made: dict[str, Any] = {}
    for name, stage in stages.items():
        if isinstance(stage, Block):
            block = folder.with_name(f"{folder.name}_{name}")
            write_block(stage, block)
            made[name] = {"use": "block/tables", "with": {"path": block.name}}
        else:
            made[name] = dict(stage)
    path = folder.with_name(f"{folder.name}.yaml")
    path.parent.mkdir(parents=True, exist_ok=True)
    text = yaml.safe_dump({**pipeline, "run": folder.name, "stages": made}, sort_keys=False, allow_unicode=True)
    path.write_text(text, encoding="utf-8")
    return path
