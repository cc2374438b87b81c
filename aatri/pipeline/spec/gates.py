"""Quality gates: bounds of the figures of stages, judged when the results are written.

    gates:
      STAGE:
        METRIC: {min: VALUE, max: VALUE}      one bound or both; they are within the gate
        METRIC: off                           takes a gate away, as in a variant

A gate changes no result and enters no key. A figure without a value fails its gate: what was asked for is not known.
A result that its own tests contradict has the figure `contradictions`, and needs no gate to fail; `gates: none`, or
`contradictions: off` of the stage, lets it pass.
"""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from aatri.errors import Faults, GateError, SpecError, raise_all
from aatri.ids import did_you_mean
from aatri.notes import CONTRADICTION
from aatri.pipeline.spec.pipeline_file import Spec

OFF, NONE = "off", "none"
CONTRADICTIONS = "contradictions"
_BOUNDS = ("min", "max")
_REMEDY = "for example sigma0: {max: 1.5}"


@dataclass(frozen=True)
class Gate:
    """Bounds of one figure of a stage; None where there is none. `where` is its place in the file, if known."""

    stage: str
    metric: str
    min: float | None
    max: float | None
    where: str = ""

    @property
    def bounds(self) -> str:
        """The bounds in words."""
        if self.min is not None and self.max is not None:
            return f"from {self.min:g} to {self.max:g}"
        return f"at least {self.min:g}" if self.max is None else f"at most {self.max:g}"


@dataclass(frozen=True)
class Verdict:
    """A gate and the value it met; None where the figure has none. `why` is what the stage said of it."""

    gate: Gate
    value: float | None
    why: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether there is a value, and within the bounds."""
        low, high = self.gate.min, self.gate.max
        return self.value is not None and (low is None or low <= self.value) and (high is None or self.value <= high)

    def plain(self) -> dict[str, Any]:
        """As JSON takes it; without the place, which is another one after any change of the file."""
        bounds = {name: value for name, value in asdict(self.gate).items() if name != "where"}
        return {**bounds, "value": self.value, "passed": self.passed}

    def __str__(self) -> str:
        where = f"{self.gate.where}: " if self.gate.where else ""
        value = "no value" if self.value is None else f"{self.value:.6g}"
        text = f"{where}{self.gate.stage}.{self.gate.metric}: {value}, wanted {self.gate.bounds}"
        return "\n        ".join([text, *self.why])


def read_gates(spec: Spec, errors: Faults) -> tuple[Gate, ...]:
    """The gates of a pipeline with what variant and command line change; what is wrong goes to `errors`."""
    gates = []
    for stage, metrics in spec.gates.items():
        if not isinstance(metrics, dict) or not metrics:
            errors.add(f"gates of {stage}: {metrics!r}, not metrics with bounds", spec.where_gate(stage), _REMEDY)
            continue
        for metric, bounds in metrics.items():
            if bounds != OFF:
                gate = _gate(spec, stage, metric, bounds, errors)
                gates += [] if gate is None else [gate]
    return tuple(gates)


def judge(
    spec: Spec, records: Iterable[Mapping[str, Any]], stages: Collection[str] | None = None
) -> tuple[Verdict, ...]:
    """Hold the figures of stages against their gates.

    Parameters
    ----------
    records : iterable of mapping
        Of the stages that are up to date.
    stages : collection of str, optional
        Those that were asked for; others are not judged. None: all.

    Raises
    ------
    SpecError
        If a stage has no such metric.
    """
    errors = Faults(SpecError)
    made = {
        str(r["stage"]): (figures_of(r), tuple(w for w in r["warnings"] if w.startswith(CONTRADICTION)))
        for r in records
        if stages is None or r["stage"] in stages
    }
    verdicts = _contradicted(spec, made)
    for gate in read_gates(spec, errors):
        if gate.stage not in made:
            continue
        figures = made[gate.stage][0]
        if gate.metric not in figures:
            hint = did_you_mean(gate.metric, figures) or f"; it has {', '.join(figures)}"
            errors.add(
                f"gate: {gate.stage} has no metric {gate.metric!r}{hint}", gate.where, "`aatri metrics` lists them"
            )
            continue
        value = figures[gate.metric]
        verdicts.append(Verdict(gate, value if value is not None and math.isfinite(value) else None))
    raise_all(errors)
    return tuple(verdicts)


def _contradicted(
    spec: Spec, made: Mapping[str, tuple[Mapping[str, float | int | None], tuple[str, ...]]]
) -> list[Verdict]:
    """Results that contradict themselves, where the file says nothing of it."""
    return [
        Verdict(Gate(stage, CONTRADICTIONS, None, 0.0), float(figures[CONTRADICTIONS] or 0), why)
        for stage, (figures, why) in made.items()
        if not spec.gates_off and figures.get(CONTRADICTIONS) and not _says_of_it(spec.gates.get(stage))
    ]


def _says_of_it(metrics: object) -> bool:
    return isinstance(metrics, Mapping) and CONTRADICTIONS in metrics


def figures_of(record: Mapping[str, Any]) -> dict[str, float | int | None]:
    """The figures of a stage by name, its seconds among them."""
    return {**record["metrics"], "seconds": record["seconds"]}


def failure_of(verdicts: Collection[Verdict]) -> GateError | None:
    """The error that names all gates that failed, a line each; None if none did."""
    failed = [str(verdict) for verdict in verdicts if not verdict.passed]
    if not failed:
        return None
    head = "a quality gate failed" if len(failed) == 1 else f"{len(failed)} quality gates failed"
    if any(v.why for v in verdicts):
        head = f"{CONTRADICTION} (`gates: none` lets it pass)"
    return GateError("\n    ".join([f"{head}; the results are written", *failed]))


def verdicts_in(overview: Mapping[str, Any]) -> tuple[Verdict, ...]:
    """The verdicts that a run.json holds."""
    names = ("stage", "metric", "min", "max")
    return tuple(
        Verdict(Gate(*(entry[name] for name in names)), entry["value"]) for entry in overview.get("gates") or ()
    )


def _gate(spec: Spec, stage: str, metric: str, bounds: Any, errors: Faults) -> Gate | None:
    """A gate; None if it is wrong."""
    before, where = len(errors), spec.where_gate(stage, metric)
    tell = _teller(errors, f"gate of {stage}.{metric}")
    if not isinstance(bounds, dict) or not bounds:
        tell(f"{bounds!r}, no bound", where)
        return None
    for name, value in bounds.items():
        if name not in _BOUNDS:
            tell(f"unknown key {name!r}{did_you_mean(name, _BOUNDS)}", spec.where_gate_key(stage, metric, name))
        elif isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            tell(f"{name} is {value!r}, not a finite number", spec.where_gate(stage, metric, name))
    if len(errors) > before:
        return None
    low, high = bounds.get("min"), bounds.get("max")
    if low is not None and high is not None and low > high:
        tell(f"min {low:g} is larger than max {high:g}", where)
        return None
    return Gate(stage, metric, low, high, where)


def _teller(errors: Faults, what: str) -> Callable[[str, str], None]:
    return lambda text, where: errors.add(f"{what}: {text}", where, _REMEDY)
