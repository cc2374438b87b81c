"""Many runs in groups: those that change the same stages stand together, and what changes most comes first."""

from collections.abc import Sequence
from dataclasses import dataclass

from aatri.pipeline.plan.compare import Compared
from aatri.pipeline.plan.reasons import flat


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
        one, other = _settings(first, stage), _settings(run, stage)
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
    """Whether both have made a stage, with other settings."""
    one, other = _settings(first, stage), _settings(run, stage)
    return one is not None and other is not None and one != other


def _settings(run: Compared, stage: str) -> dict[str, object] | None:
    """Method, options and ports of a stage, flat; None where the run did not make it."""
    record = run.records.get(stage)
    if record is None:
        return None
    ports = {f"from {port}": source["stage"] for port, source in record["inputs"].items()}
    return {"use": record["plugin"], **flat(record["options"]), **ports}
