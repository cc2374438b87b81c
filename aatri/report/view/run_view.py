"""A run as the report sees it: stages in order, each done, failed or not run, whatever the state of the folder."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.kinds import KINDS
from aatri.artifacts.solution import Solution
from aatri.errors import AatriError, ArtifactError
from aatri.pipeline.store import inside
from aatri.pipeline.store import run_folder as store
from aatri.tables.schema import Artifact

A = TypeVar("A", bound=Artifact)

RESULTS = {"control_points", "check_points", "truth_points"}
"""An evaluation of a result has some of these figures."""

LOG_LINES = 30
"""So many last lines of a failed stage's log are shown."""


@dataclass(frozen=True)
class StageView:
    """One stage: what was to run, and its record or failure."""

    name: str
    use: str
    kind: str
    inputs: Mapping[str, str]
    record: Mapping[str, Any] | None
    failure: Mapping[str, Any] | None
    log: tuple[str, ...]

    @property
    def status(self) -> str:
        """`done`, `failed` or `not run`."""
        if self.failure is not None:
            return "failed"
        return "done" if self.record is not None else "not run"

    @property
    def metrics(self) -> Mapping[str, float | int | None]:
        """Metrics of the record, none if it did not finish."""
        return self.record.get("metrics", {}) if self.record else {}


@dataclass(frozen=True)
class RunView:
    """A run folder."""

    folder: Path
    overview: Mapping[str, Any]
    stages: tuple[StageView, ...]
    kept: dict[str, Artifact] = field(default_factory=dict, repr=False)
    """Artifacts that `last` has read: large ones are not read twice."""
    unreadable: dict[str, AatriError] = field(default_factory=dict, repr=False)
    """By stage, what `last` could not read: a file that is gone or damaged, or of another version."""
    in_memory: Mapping[str, Artifact] = field(default_factory=dict, repr=False)
    """Artifacts by content digest, made by this process: of them only the files are checked."""

    def of_kind(self, kind: type[Artifact]) -> list[StageView]:
        """The finished stages with artifacts of a kind, in order."""
        return [s for s in self.stages if s.kind == kind.kind and s.status == "done"]

    def _before_the_result(self, stages: list[StageView]) -> list[StageView]:
        """Those that the last Solution was made from, and itself, the nearest last: of several blocks its own."""
        inputs = {s.name: s.inputs.values() for s in self.stages}
        there = [s.name for s in self.of_kind(Solution)][-1:]
        for name in there:  # grows
            there += [before for before in inputs.get(name, ()) if before not in there]
        return sorted((s for s in stages if s.name in there), key=lambda s: -there.index(s.name)) or stages

    @property
    def status(self) -> str:
        """How the run ended; `not complete` where it was stopped before its last stage."""
        ended = str(self.overview.get("status", ""))
        return "not complete" if ended == "done" and any(s.status != "done" for s in self.stages) else ended

    def to_follow(self) -> str:
        """The stage that was to adjust the last Solution further and was not run or failed; empty without one."""
        last = [s.name for s in self.of_kind(Solution)][-1:]
        further = (s for s in self.stages if s.kind == Solution.kind and s.status != "done")
        return next((s.name for s in further if set(last) & set(s.inputs.values())), "")

    def evaluated(self) -> list[StageView]:
        """Stages that evaluated a result, in order, those of the last Solution last; without one every Evaluation: of
        free strips, epochs, set-ups.

        Where the last Solution is still to be evaluated, what is known of those before it is not said of it.
        """
        stages, last = self.of_kind(Evaluation), {s.name for s in self.of_kind(Solution)[-1:]}
        of_results = [s for s in stages if RESULTS & s.metrics.keys()]
        of_last = [s for s in self.stages if s.kind == Evaluation.kind and last & set(s.inputs.values())]
        if any(s.status != "done" for s in of_last):
            return [s for s in of_results if s in of_last]
        return sorted(of_results, key=of_last.__contains__) or stages

    def artifact(self, stage: StageView) -> Artifact:
        """The artifact of a stage.

        Raises
        ------
        AatriError
            If it is gone, altered or unreadable.
        """
        if stage.name in self.kept:
            return self.kept[stage.name]
        if stage.kind not in KINDS:
            raise ArtifactError(f"no kind of artifact: {stage.kind!r}", where=stage.name)
        return store.load(self.folder, stage.name, KINDS[stage.kind], self.in_memory)

    def last(self, kind: type[A]) -> A | None:
        """The last readable artifact of a kind; of Evaluations that of a result."""
        return next(iter(self.readable(kind).values()), None)

    def readable(self, kind: type[A]) -> dict[str, A]:
        """Artifacts of a kind by stage, the last first: the last that can be read, of Evaluations without a result all.

        What epochs, designs, free strips and set-ups evaluate are questions of their own, and none replaces another.
        """
        of_results = kind is not Evaluation or any(RESULTS & s.metrics.keys() for s in self.of_kind(Evaluation))
        artifacts: dict[str, A] = {}
        for stage in reversed(self.evaluated() if kind is Evaluation else self._before_the_result(self.of_kind(kind))):
            try:
                artifact = self.artifact(stage)
            except AatriError as error:
                self.unreadable[stage.name] = error
                continue
            self.kept[stage.name] = artifact
            if isinstance(artifact, kind):
                artifacts[stage.name] = artifact
            if of_results:
                break
        return artifacts


def view(folder: Path, in_memory: Mapping[str, Artifact] = {}) -> RunView:
    """Read a run folder.

    Raises
    ------
    ArtifactError
        If it is none.
    """
    overview = store.read_overview(folder)
    if overview is None:
        raise ArtifactError("not the folder of a run", where=str(folder), remedy="aatri run makes one")
    stages = tuple(_stage(folder, entry) for entry in overview.get("stages", []))
    return RunView(folder, overview, stages, in_memory=in_memory)


def _stage(folder: Path, entry: Mapping[str, Any]) -> StageView:
    name = str(entry["stage"])
    return StageView(
        name=name,
        use=str(entry.get("use", "")),
        kind=str(entry.get("kind", "")),
        inputs=entry.get("from", {}),
        record=_readable(store.current_record, folder, name),
        failure=_readable(store.failure, folder, name),
        log=_log(folder, name),
    )


def _readable(read: Any, folder: Path, name: str) -> Mapping[str, Any] | None:
    """The record; a damaged one is shown as a failure of its own."""
    try:
        value: Mapping[str, Any] | None = read(folder, name)
    except AatriError as error:
        return None if read is store.current_record else {"what": error.what, "where": error.where, "remedy": ""}
    return value


def _log(folder: Path, stage: str) -> tuple[str, ...]:
    try:
        lines = inside.read(folder, "failed", stage, "stage.log").decode("utf-8", errors="replace").splitlines()
    except OSError:
        return ()
    return tuple(lines[-LOG_LINES:])
