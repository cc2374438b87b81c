"""Runs side by side: their options and figures, the first stage where they part, and why.

Runs are compared by records. Two results of one stage are equal if their content digests are; if not, what their keys
are made of says why: a file, an option, the method, its version or code, the seed, or an input, whose own stage is then
the one to look at. Where the keys are equal too, the versions of packages and the processor are left, and the figures
tell whether only the last bits differ.

Many runs are put in groups: those that change the same stages stand together, and what changes most comes first.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aatri.errors import ArtifactError
from aatri.pipeline.plan.reasons import Reason, Why, differences, flat, flat_alike
from aatri.pipeline.store import run_folder as store
from aatri.pipeline.store.objects import artifact_file

LAST_BITS = 1e-12
"""Relative differences up to this are those of rounding."""


@dataclass(frozen=True)
class Compared:
    """A run: its name, folder, stages in order, the current record of each stage that has one, and what failed."""

    name: str
    folder: Path
    stages: tuple[str, ...]
    records: Mapping[str, Mapping[str, Any]]
    failures: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def settings(self, stage: str) -> Mapping[str, Any] | None:
        """Record or failure of a stage, with method and options; None where it did not run, or does not say them."""
        failure = self.failures.get(stage, {})
        stated = failure.get("plugin") is not None and failure.get("options") is not None
        return self.records.get(stage, failure if stated else None)


@dataclass(frozen=True)
class Parting:
    """Where two runs part."""

    stage: str
    """The first stage whose results differ."""
    reasons: tuple[Reason, ...]
    """How its keys differ; none where they are equal."""
    environment: dict[str, tuple[str, str]]
    """Versions and system that differ: (one, other)."""
    largest: float
    """Largest relative difference of its numbers; infinite where they cannot be compared one by one."""

    @property
    def only_last_bits(self) -> bool:
        """Whether rounding explains it."""
        return self.largest <= LAST_BITS


def read_run(folder: Path, name: str) -> Compared:
    """A run as its folder shows it.

    Raises
    ------
    ArtifactError
        If it is not the folder of a run.
    """
    overview = store.read_overview(folder)
    if overview is None:
        raise ArtifactError("has not been run", where=str(folder), remedy="aatri run")
    stages = tuple(str(entry["stage"]) for entry in overview["stages"])
    records = {stage: store.current_record(folder, stage) for stage in stages}
    failures = {stage: store.failure(folder, stage) for stage in stages if records[stage] is None}
    made, failed = ({stage: r for stage, r in of.items() if r is not None} for of in (records, failures))
    return Compared(name, folder, stages, made, failed)


def option_rows(runs: Sequence[Compared]) -> list[tuple[str, list[Any]]]:
    """Methods and options that differ among the runs that ran the stage: the name, the value in each or None."""
    rows = []
    for stage in _stages(runs):
        records = {k: record for k, run in enumerate(runs) if (record := run.settings(stage)) is not None}
        options = flat_alike([record["options"] for record in records.values()])
        by_run = {k: {"use": r["plugin"], **stated} for (k, r), stated in zip(records.items(), options)}
        made, values = list(by_run.values()), [by_run.get(k) for k in range(len(runs))]
        for name in dict.fromkeys(key for each in made for key in each):
            own = [each[name] for each in made if name in each]
            if len({each["use"] for each in made}) > 1 and len(own) < len(made) and all(v == own[0] for v in own):
                continue  # another method has options of its own
            row = [None if each is None else each.get(name) for each in values]
            if any(each.get(name) != made[0].get(name) for each in made):
                rows.append((f"{stage}.{name}", row))
    return rows


def metric_rows(runs: Sequence[Compared]) -> list[tuple[str, list[Any]]]:
    """Figures of all stages: the name, and the value in each run."""
    rows = []
    for stage in _stages(runs):
        values = [run.records[stage]["metrics"] if stage in run.records else {} for run in runs]
        rows += [
            (f"{stage}.{name}", [v.get(name) for v in values]) for name in dict.fromkeys(k for v in values for k in v)
        ]
    return rows


def relative_spread(values: Sequence[Any]) -> float:
    """Largest minus smallest of a figure over its largest magnitude; infinite where a run does not have it."""
    numbers = [float(v) for v in values if isinstance(v, int | float)]
    if len(numbers) < len(values):
        return float("inf")
    largest = max(map(abs, numbers), default=0.0)
    return (max(numbers) - min(numbers)) / largest if largest > 0 else 0.0


def parting(one: Compared, other: Compared) -> Parting | None:
    """Where two runs part first; None if all results that both have are equal."""
    for stage in one.stages:
        a, b = one.records.get(stage), other.records.get(stage)
        if a is None or b is None or a["output"]["content_digest"] == b["output"]["content_digest"]:
            continue
        environment = {
            name: (str(a["environment"].get(name)), str(b["environment"].get(name)))
            for name in sorted({*a["environment"], *b["environment"]} - {"host"})
            if a["environment"].get(name) != b["environment"].get(name)
        }
        largest = largest_difference(artifact_file(one.folder, a), artifact_file(other.folder, b))
        return Parting(stage, differences(a["parts"], b["parts"]), environment, largest)
    return None


def changes(one: Compared, other: Compared) -> list[tuple[str, Reason]]:
    """What was changed between two runs, by stage: method, option, file, code; not what only follows from it."""
    follows = (Why.input, Why.upstream_maybe)
    both = [stage for stage in one.stages if stage in one.records and stage in other.records]
    return [
        (stage, reason)
        for stage in both
        for reason in differences(one.records[stage]["parts"], other.records[stage]["parts"])
        if reason.why not in follows
    ]


def largest_difference(one: Path, other: Path) -> float:
    """Largest relative difference of the numbers of two artifacts; infinite where they are not alike in form or text.

    Each column is measured by its own largest magnitude.
    """
    import numpy as np

    from aatri.tables.hdf5 import read_plain

    a, b = read_plain(one), read_plain(other)
    if a.keys() != b.keys():
        return float("inf")
    worst = 0.0
    for name, values in a.items():
        if values.shape != b[name].shape or values.dtype != b[name].dtype:
            return float("inf")
        if values.dtype.kind != "f":
            if not np.array_equal(values, b[name]):
                return float("inf")
            continue
        finite = np.isfinite(values)  # a column may have no number at all
        if not np.array_equal(finite, np.isfinite(b[name])):
            return float("inf")
        if not np.array_equal(values[~finite], b[name][~finite], equal_nan=True):
            return float("inf")
        scale = np.abs(values[finite]).max(initial=0.0)
        gap = np.abs(values[finite] - b[name][finite]).max(initial=0.0)
        worst = max(worst, float(gap / scale) if scale > 0 else float("inf") if gap > 0 else 0.0)
    return worst


def _stages(runs: Sequence[Compared]) -> list[str]:
    return list(dict.fromkeys(stage for run in runs for stage in run.stages))


@dataclass(frozen=True)
class Axis:
    """Runs that differ from the first one by the methods, options or ports of the same stages."""

    stages: tuple[str, ...]
    """Whose method, options or ports differ; none for runs that differ by the files read, code or versions alone."""
    runs: tuple[Compared, ...]


def axes(runs: Sequence[Compared]) -> list[Axis]:
    """The runs after the first, grouped by the stages that they change, in the order of the first run's stages."""
    first = runs[0]
    runs_of: dict[tuple[str, ...], list[Compared]] = {}
    for run in runs[1:]:
        runs_of.setdefault(tuple(s for s in first.stages if _differs(first, run, s)), []).append(run)
    place = {stage: k for k, stage in enumerate(first.stages)}
    order = sorted(runs_of, key=lambda stages: [place[s] for s in stages])
    return [Axis(stages, tuple(runs_of[stages])) for stages in order]


def changed_settings(first: Compared, run: Compared, beside: Sequence[Compared] = ()) -> list[str]:
    """Methods, options and ports of a run that are not those of the first: `stage.option: one -> other`.

    Where the method is another one, its options are not those of the first: listed are those that tell it from the
    runs beside it that use the same method.
    """
    changes = []
    for stage in first.stages:
        one, other = _settings_of_both(first, run, stage)
        if one is None or other is None:
            continue
        if one["use"] != other["use"]:
            alike = [s for s in (_settings(r, stage) for r in beside) if s is not None and s["use"] == other["use"]]
            own = [f"{n}: {value}" for n, value in other.items() if any(s.get(n) != value for s in alike)]
            changes.append(f"{stage}: {one['use']} -> {other['use']}" + (f" ({', '.join(own)})" if own else ""))
            continue
        names = dict.fromkeys((*one, *other))
        changes += [f"{stage}.{n}: {one.get(n)} -> {other.get(n)}" for n in names if one.get(n) != other.get(n)]
    return changes


def seconds_until(run: Compared, stage: str) -> float:
    """Seconds of a stage and of all that it was made from, each counted once, as they were when made."""
    waiting, seen = [stage], set()
    while waiting:
        name = waiting.pop()
        if name in run.records and name not in seen:
            seen.add(name)
            waiting += [str(source["stage"]) for source in run.records[name]["inputs"].values()]
    return float(sum(run.records[name]["seconds"] for name in seen))


def _differs(first: Compared, run: Compared, stage: str) -> bool:
    """Whether both have run a stage, with other settings."""
    one, other = _settings_of_both(first, run, stage)
    return one is not None and other is not None and one != other


def _settings_of_both(first: Compared, run: Compared, stage: str) -> list[dict[str, object] | None]:
    """Settings of a stage in two runs; without ports where one failed, whose record has none."""
    both = [_settings(first, stage), _settings(run, stage)]
    if stage in first.records and stage in run.records:
        return both
    return [None if s is None else {n: v for n, v in s.items() if not n.startswith("from ")} for s in both]


def _settings(run: Compared, stage: str) -> dict[str, object] | None:
    """Method, options and ports of a stage, flat; None where the run did not come to it."""
    record = run.settings(stage)
    if record is None:
        return None
    ports = {f"from {port}": source["stage"] for port, source in record.get("inputs", {}).items()}
    return {"use": record["plugin"], **flat(record["options"]), **ports}
