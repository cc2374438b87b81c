"""Which run a verb means: a run folder, a pipeline file, or the `run:` of ./pipeline.yaml."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError, SpecError

DEFAULT = Path("pipeline.yaml")


@dataclass(frozen=True)
class LocatedRun:
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


def find_run(named: Path | None) -> LocatedRun:
    """The run of a folder or pipeline file; by default of ./pipeline.yaml.

    Raises
    ------
    SpecError
        If there is no such folder or file.
    ArtifactError
        If the folder is not one of a run.
    """
    from aatri.pipeline.spec.pipeline_file import load_spec
    from aatri.pipeline.store.run_folder import read_overview

    path = run_or_pipeline(named)
    if path.is_dir():
        overview = overview_of(path)
        return LocatedRun(path, tuple(overview["stages"]), overview)
    spec = load_spec(path)
    stages = tuple({"stage": s.name, "use": s.use, "from": dict(s.inputs)} for s in spec.stages.values())
    return LocatedRun(spec.run, stages, read_overview(spec.run) or {})


def run_or_pipeline(named: Path | None) -> Path:
    """The folder of a run or the pipeline file that is meant.

    Raises
    ------
    SpecError
        If none is given and there is no ./pipeline.yaml.
    """
    if named is None and not DEFAULT.is_file():
        raise SpecError("no run given and no pipeline.yaml here", remedy="give a run folder or a pipeline file")
    return in_folder(named or DEFAULT)


def overview_of(folder: Path) -> dict[str, Any]:
    """The run.json of a run.

    Raises
    ------
    ArtifactError
        If it is not the folder of a run.
    """
    from aatri.pipeline.store.run_folder import read_overview

    overview = read_overview(folder)
    if overview is None:
        raise ArtifactError("not the folder of a run: no run.json in it", where=str(folder), remedy=_instead_of(folder))
    return overview


def project_file(path: Path) -> Path:
    """The pipeline file of a project's folder, or a path that is none.

    Raises
    ------
    SpecError
        If the folder has no pipeline.
    """
    project = in_folder(path)
    if project.is_dir():
        raise SpecError(f"no {DEFAULT} in it", where=str(path), remedy=_instead_of(path))
    return project


def _instead_of(folder: Path) -> str:
    """What to give in the place of a folder that is not of a run or a project."""
    if (folder / "block.yaml").is_file():
        return f"it is a block folder: `aatri new FOLDER --from {folder}` writes a pipeline that reads it"
    return "give a pipeline file, or the folder that `run:` of one names"


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
