"""aatri from Python: run a pipeline, open a run, look at its artifacts.

import aatri
run = aatri.run("pipeline.yaml", set=["bundle.max_iterations=9"])
run["bundle"].metrics["sigma0"]
run["bundle"].artifact.points.xyz_m
run["bundle"].to_dataframe("residuals")
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError, InputError, SpecError
from aatri.ids import did_you_mean
from aatri.tables.schema import Artifact


@dataclass(frozen=True)
class Stage:
    """A stage of a run.

    Attributes
    ----------
    name, use : str
        Its name, and the method ROLE/VARIANT.
    folder : Path
        Of the run.
    record : mapping, optional
        What is known of its result; None if it has none.
    """

    name: str
    use: str
    folder: Path
    record: Mapping[str, Any] | None

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

    def to_dataframe(self, table: str) -> Any:
        """A table of the result as a DataFrame of pandas, or of polars where there is no pandas.

        Rows are told by ids; `suspects`, `residuals` and `tests` come largest first (see `aatri show`). The units of
        the columns stand in `attrs["units"]` of a pandas frame.

        Raises
        ------
        SpecError
            If the result has no such table.
        InputError
            If neither pandas nor polars is installed.
        """
        from aatri.formats.results.readable import readable

        shown = readable(self.artifact, table)
        columns = dict(zip(shown.head, shown.columns))
        try:
            import pandas
        except ImportError:
            pass
        else:
            frame = pandas.DataFrame(columns)
            frame.attrs["units"] = {name: unit for name, unit in zip(shown.head, shown.units) if unit}
            return frame
        try:
            import polars
        except ImportError:
            raise InputError("neither pandas nor polars is installed", remedy="pip install pandas") from None
        return polars.DataFrame(columns)

    def _made(self) -> Mapping[str, Any]:
        if self.record is None:
            raise ArtifactError(f"stage {self.name} has no result", where=str(self.folder), remedy="aatri run")
        return self.record

    def __repr__(self) -> str:
        state = f"{self.record['output']['kind']}, {self.record['seconds']:.2f} s" if self.record else "not run"
        return f"<{self.name}: {self.use}, {state}>"


class Run(Mapping[str, Stage]):
    """A run: its stages by name, in order."""

    def __init__(self, folder: Path, stages: Sequence[Stage]) -> None:
        self.folder = folder
        self._stages = {stage.name: stage for stage in stages}

    def __getitem__(self, name: str) -> Stage:
        if name not in self._stages:
            raise SpecError(f"no stage {name!r}{did_you_mean(name, self._stages)}", where=str(self.folder))
        return self._stages[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._stages)

    def __len__(self) -> int:
        return len(self._stages)

    def __contains__(self, name: object) -> bool:
        return name in self._stages

    def __repr__(self) -> str:
        return "\n".join([f"Run {self.folder}", *(f"  {stage!r}" for stage in self._stages.values())])


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
    pipeline: str | Path = "pipeline.yaml",
    *,
    into: str | Path | None = None,
    set: Sequence[str] = (),
    use: Sequence[str] = (),
    variant: str = "",
    local_plugins: bool = False,
    cluster: Any = "",
    quiet: bool = True,
) -> Run:
    """Bring a pipeline up to date, like `aatri run`, and open it.

    Parameters
    ----------
    pipeline : str or Path
    into : str or Path, optional
        Folder of the results instead of `run:`.
    set, use : sequence of str
        `STAGE.OPTION=VALUE`, `STAGE=ROLE/VARIANT`.
    variant : str
    local_plugins : bool
        Run the project's own stages too.
    cluster : str or distributed.Client
        Stages on a Dask cluster: `tcp://HOST:PORT`, `local:WORKERS`, or a client.
    quiet : bool
        Without narration on stderr, but for warnings.

    Raises
    ------
    GateError
        If a quality gate failed; the results are written and `aatri.open` opens them.
    AatriError
        What is wrong with the pipeline, or the errors of stages that failed.
    """
    from aatri.cli.arguments.planning import Request, open_request
    from aatri.cli.terminal.narrator import Narrator
    from aatri.pipeline.run import runner
    from aatri.pipeline.spec.gates import failure_of, judge
    from aatri.report.page import write_report

    request = Request(str(pipeline), str(into or ""), tuple(set), tuple(use), variant, local_plugins)
    opened = open_request(request, quiet=quiet)
    settings = runner.RunSettings(
        command="aatri.run", source=opened.source, request=opened.request.plain(), cluster=cluster
    )
    with Narrator(quiet) as narrator:
        records = runner.run_pipeline(opened.spec, opened.nodes, narrator, settings)
    write_report(opened.spec.run)
    failed = failure_of(judge(opened.spec, records))
    if failed is not None:
        raise failed
    return open_run(opened.spec.run)
