"""Runs: a pipeline brought up to date, the stages of a run, their artifacts and figures.

A pipeline given as a mapping is written as the file that the command line takes.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from aatri.api.frames import html_table, number, to_dataframe
from aatri.api.plots import Plots
from aatri.artifacts.block import Block
from aatri.errors import ArtifactError, SpecError
from aatri.ids import did_you_mean
from aatri.tables.schema import Artifact, tables_of


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


@dataclass(frozen=True)
class Stage:
    """A stage of a run."""

    name: str
    use: str
    """The method, ROLE/VARIANT."""
    folder: Path
    """Of the run."""
    record: Mapping[str, Any] | None
    """What is known of its result; None if it has none."""

    @property
    def metrics(self) -> Mapping[str, float | int | None]:
        """Its figures."""
        return dict(self._made()["metrics"])

    @property
    def warnings(self) -> tuple[str, ...]:
        """What it warned of."""
        return tuple(self._made()["warnings"])

    @property
    def artifact(self) -> Artifact:
        """Its result, read and checked.

        Raises
        ------
        ArtifactError
            If there is none, or it was altered.
        """
        from aatri.artifacts.kinds import KINDS
        from aatri.pipeline.store import run_folder as store

        return store.load(self.folder, self.name, KINDS[self._made()["output"]["kind"]])

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables of its result that have rows."""
        artifact = self.artifact
        names = tables_of(type(artifact))
        return tuple(name for name in names if (rows := getattr(artifact, name)) is not None and len(rows))

    def to_dataframe(self, table: str) -> Any:
        """A table of the result as a DataFrame, see `aatri.to_dataframe`."""
        return to_dataframe(self.artifact, table)

    def _made(self) -> Mapping[str, Any]:
        if self.record is None:
            raise ArtifactError(f"stage {self.name} has no result", where=str(self.folder), remedy="aatri run")
        return self.record

    def __repr__(self) -> str:
        state = f"{self.record['output']['kind']}, {self.record['seconds']:.2f} s" if self.record else "not run"
        return f"<{self.name}: {self.use}, {state}>"

    def _repr_html_(self) -> str:
        rows = [(name, number(value)) for name, value in self.metrics.items()] if self.record else []
        rows += [("warning", text) for text in self.warnings] if self.record else []
        return html_table(("figure", ""), rows, caption=repr(self).strip("<>"))


class NoStage(SpecError, KeyError):
    """A run has no stage of this name; also a KeyError, as of any mapping."""


class Run(Mapping[str, Stage]):
    """A run: its stages by name, in order."""

    def __init__(self, folder: Path, stages: Sequence[Stage]) -> None:
        self.folder = folder
        self._stages = {stage.name: stage for stage in stages}

    def __getitem__(self, name: str) -> Stage:
        if name not in self._stages:
            raise NoStage(f"no stage {name!r}{did_you_mean(str(name), self._stages)}", where=str(self.folder))
        return self._stages[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._stages)

    def __len__(self) -> int:
        return len(self._stages)

    def __contains__(self, name: object) -> bool:
        return name in self._stages

    def __repr__(self) -> str:
        return "\n".join([f"Run {self.folder}", *(f"  {stage!r}" for stage in self._stages.values())])

    @property
    def report(self) -> Path:
        """The page of its report."""
        return self.folder / "report.html"

    @property
    def judgement(self) -> str:
        """What the report says first; empty where there is none."""
        from aatri.cli.run_ending import judgement

        return judgement(self.report.with_suffix(".json"))

    def metrics(self) -> Any:
        """Figures of all stages as a DataFrame: stage, figure, value."""
        from aatri.api.frames import frame_of

        rows = [(s.name, n, v) for s in self._stages.values() if s.record for n, v in s.metrics.items()]
        stages, names, values = zip(*rows) if rows else ((), (), ())
        return frame_of({"stage": list(stages), "figure": list(names), "value": list(values)}, {})

    def plot(self, *names: str) -> Plots:
        """Pictures of the report, which notebooks show and `save` writes.

        Parameters
        ----------
        *names : str
            Of pictures (`plan`, `ties`), or of questions that several answer (`residuals`, `accuracy`); none: all.

        Raises
        ------
        NoPicture
            If the run has none of a name.
        """
        from aatri.report.page import seen_in
        from aatri.report.questions import gallery

        return Plots(gallery(*seen_in(self.folder)).chosen(names or ("all",), str(self.folder)))

    def _repr_html_(self) -> str:
        rows = []
        for stage in self._stages.values():
            figures: Mapping[str, Any] = stage.metrics if stage.record else {}
            shown = [number(figures[name]) if name in figures else "" for name in ("images", "points", "sigma0")]
            seconds = f"{stage.record['seconds']:.2f}" if stage.record else "not run"
            rows.append((stage.name, stage.use, *shown, seconds))
        head = ("stage", "method", "images", "points", "sigma0", "seconds")
        return f"{html_table(head, rows, caption=f'Run {self.folder}')}<p>{escape(self.judgement)}</p>"


def open_run(path: str | Path) -> Run:
    """Open a run: its folder, or the pipeline file it was made by.

    Raises
    ------
    SpecError, ArtifactError
        If there is none.
    """
    from aatri.cli.arguments.locate import find_run
    from aatri.pipeline.store import run_folder as store

    located = find_run(Path(path))
    return Run(
        located.folder,
        [
            Stage(str(e["stage"]), str(e["use"]), located.folder, store.current_record(located.folder, str(e["stage"])))
            for e in located.stages
        ],
    )


def run_pipeline(
    pipeline: str | Path | Mapping[str, Any] = "pipeline.yaml",
    *,
    into: str | Path | None = None,
    set: str | Sequence[str] = (),
    use: str | Sequence[str] = (),
    variant: str = "",
    local_plugins: bool = False,
    cluster: Any = "",
    quiet: bool = True,
) -> Run:
    """Bring a pipeline up to date, like `aatri run`, and open it.

    Parameters
    ----------
    pipeline : str, Path or mapping
        A file, or what one holds: `run`, `stages` ... A stage may be a Block. A mapping is written beside the folder of
        its run, as RUN.yaml, and a Block into the folder RUN_STAGE: so the command line knows the run too.
    into : str or Path, optional
        Folder of the results instead of `run:`.
    set, use : str or sequence of str
        `STAGE.OPTION=VALUE`, `STAGE=ROLE/VARIANT`.
    local_plugins : bool
        Run the project's own stages too.
    cluster : str or distributed.Client
        Stages on a Dask cluster: `tcp://HOST:PORT`, `local:WORKERS`, `local:WORKERS:MEMORY`, or a client.
    quiet : bool
        Without narration, but for warnings and what is compiled, once; else a bar and a line per stage, in a notebook
        below the cell.

    Raises
    ------
    GateError
        If a quality gate failed; the results are written and `aatri.open` opens them.
    AatriError
        What is wrong with the pipeline, or the errors of stages that failed.
    """
    from aatri.api.runs import written
    from aatri.cli.arguments.planning import Request, open_request
    from aatri.cli.terminal.narrator import Narrator
    from aatri.pipeline.run import runner
    from aatri.pipeline.spec.gates import failure_of, judge
    from aatri.report.page import write_report

    path = written(pipeline) if isinstance(pipeline, Mapping) else Path(pipeline)
    set_, use = ((texts,) if isinstance(texts, str) else tuple(texts) for texts in (set, use))
    request = Request(str(path), str(into or ""), set_, use, variant, local_plugins)
    opened = open_request(request)
    settings = runner.RunSettings(
        command="aatri.run", source=opened.source, request=opened.request.plain(), cluster=cluster
    )
    with Narrator(quiet) as narrator:
        records = runner.run_pipeline(opened.spec, opened.nodes, narrator, settings)
    write_report(opened.spec.run, in_memory=settings.in_memory)
    failed = failure_of(judge(opened.spec, records))
    if failed is not None:
        raise failed
    return open_run(opened.spec.run)
