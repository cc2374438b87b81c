"""Which run a verb means: a run folder, a pipeline file, or the `run:` of ./pipeline.yaml."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri.errors import ArtifactError, SpecError

if TYPE_CHECKING:
    from aatri.pipeline.spec.spec import Spec

DEFAULT = Path("pipeline.yaml")


@dataclass(frozen=True)
class Run:
    """A run folder and the stages in order, each with `stage`, `use`, `from`; what else is in `overview`."""

    folder: Path
    stages: tuple[dict[str, Any], ...]
    overview: dict[str, Any]

    def stage(self, name: str) -> dict[str, Any]:
        """The entry of a stage.

        Raises
        ------
        SpecError
            If the run has no such stage.
        """
        from aatri.ids import did_you_mean

        names = [entry["stage"] for entry in self.stages]
        if name not in names:
            hint = did_you_mean(name, names) or f"; there are {', '.join(names)}"
            raise SpecError(f"no stage {name!r}{hint}", where=str(self.folder))
        return self.stages[names.index(name)]


def find_run(given: Path | None) -> Run:
    """The run of a folder or pipeline file; by default of ./pipeline.yaml.

    Raises
    ------
    SpecError
        If there is no such folder or file.
    ArtifactError
        If the folder is not one of a run.
    """
    from aatri.pipeline.store import run_folder as store

    if given is None and not DEFAULT.is_file():
        raise SpecError("no run given and no pipeline.yaml here", remedy="give a run folder or a pipeline file")
    path = in_folder(given or DEFAULT)
    if path.is_dir():
        overview = store.read_overview(path)
        if overview is None:
            raise ArtifactError(
                "not the folder of a run: no run.json in it", where=str(path), remedy="see `run:` in pipeline.yaml"
            )
        return Run(path, tuple(overview["stages"]), overview)
    from aatri.pipeline.spec.spec import load_spec

    spec = load_spec(path)
    return Run(spec.run, _stages(spec), store.read_overview(spec.run) or {})


def in_folder(path: Path) -> Path:
    """The pipeline file of a project's folder; any other path as it is, so also the folder of a run."""
    if path.is_dir() and not os.path.lexists(path / "run.json") and (path / DEFAULT).is_file():
        return path / DEFAULT
    return path


def split_stage(text: str | None) -> tuple[Path | None, str | None]:
    """`RUN:STAGE`, `RUN` or, of the default run, `:STAGE`: the path and the stage."""
    if text is None:
        return None, None
    path, colon, stage = text.rpartition(":")
    if not colon or Path(text).exists():
        return Path(text), None
    return (Path(path) if path else None), stage or None


def _stages(spec: Spec) -> tuple[dict[str, Any], ...]:
    return tuple({"stage": s.name, "use": s.use, "from": dict(s.inputs)} for s in spec.stages.values())
