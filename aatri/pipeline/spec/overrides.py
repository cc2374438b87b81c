"""Overrides of the command line: `--variant NAME`, `--use STAGE=ROLE/VARIANT` and `--set STAGE.OPTION=VALUE`."""

import copy
import dataclasses
from collections.abc import Collection, Sequence
from typing import Any, Protocol

from aatri.errors import SpecError
from aatri.ids import did_you_mean
from aatri.pipeline.spec.pipeline_file import GATES, USE, Spec, StageSpec
from aatri.pipeline.store.inside import VARIANTS
from aatri.strict_yaml import loads


def with_set(spec: Spec, texts: Sequence[str]) -> Spec:
    """The spec with options set; VALUE is YAML, OPTION may be dotted to reach into nested options.

    `gates.STAGE.METRIC.BOUND=VALUE` sets a bound of a gate.

    Raises
    ------
    SpecError
        If the text is no STAGE.OPTION=VALUE, the stage is unknown or the value is no YAML.
    """
    stages, written_at = dict(spec.stages), dict(spec.written_at)
    gates = copy.deepcopy(dict(spec.gates))
    for text in texts:
        where = f"--set {text}"
        target, equals, value = text.partition("=")
        name, *path = target.split(".")
        if not equals or not path or not all(path):
            raise SpecError("not STAGE.OPTION=VALUE", where=where, remedy="for example --set bundle.max_iterations=9")
        if name == GATES:
            _stage(stages, path[0], where)
            _put(gates, path, loads(value, where).value, where)
            written_at[(GATES, *path)] = where
            continue
        stage = _stage(stages, name, where)
        options = copy.deepcopy(dict(stage.options))
        _put(options, path, loads(value, where).value, where)
        stages[name] = dataclasses.replace(stage, options=options)
        written_at[(name, "with", *path)] = where
    return dataclasses.replace(spec, stages=stages, written_at=written_at, gates=gates)


class KnownOptions(Protocol):
    """Knows the options of variants."""

    def option_names(self, use: str) -> Collection[str]:
        """Names of the options of a variant at the top level."""


def with_use(spec: Spec, texts: Sequence[str], known_options: KnownOptions) -> tuple[Spec, list[str]]:
    """The spec with other variants, and notes that name the options which the new variants do not have.

    Raises
    ------
    SpecError
        If the text is no STAGE=ROLE/VARIANT or the stage is unknown.
    PluginError
        If there is no such variant.
    """
    stages, written_at, notes = dict(spec.stages), dict(spec.written_at), []
    for text in texts:
        where = f"--use {text}"
        name, equals, use = text.partition("=")
        if not equals or not USE.fullmatch(use):
            raise SpecError("not STAGE=ROLE/VARIANT", where=where, remedy="see `aatri stages`")
        stage = _stage(stages, name, where)
        names = known_options.option_names(use)
        dropped = [option for option in stage.options if option not in names]
        if dropped:
            notes.append(f"{name}: {use} has no option {', '.join(dropped)}; not used")
        kept = {option: value for option, value in stage.options.items() if option in names}
        stages[name] = dataclasses.replace(stage, use=use, options=kept)
        written_at[(name, "use")] = where
    return dataclasses.replace(spec, stages=stages, written_at=written_at), notes


def with_variant(spec: Spec, name: str) -> Spec:
    """The spec with the patches of one of its variants; its run lies within that of the spec.

    A patch of `use` or `from` replaces what it names; options are set one by one, also those within others, unless the
    method changes: then the patch has all of them. Bounds of gates are set one by one too.

    Raises
    ------
    SpecError
        If there is no such variant.
    """
    if name not in spec.variants:
        hint = did_you_mean(name, spec.variants) or f"; there are {', '.join(spec.variants) or 'none'}"
        raise SpecError(f"no variant {name!r}{hint}", where=spec.document.where("variants"))
    stages, written_at = dict(spec.stages), dict(spec.written_at)
    gates = dict(spec.gates)
    for stage_name, patch in (spec.variants[name] or {}).items():
        at = ("variants", name, stage_name)
        if stage_name == GATES:
            gates = _patched(gates, patch or {})
            for gated, metrics in (patch or {}).items():
                for path in [(gated, metric) for metric in metrics] if isinstance(metrics, dict) else [(gated,)]:
                    written_at[(GATES, *path)] = spec.document.where(*at, *path)
            continue
        stage = stages[stage_name]
        use = (patch or {}).get("use", stage.use)
        options = {} if use != stage.use else copy.deepcopy(dict(stage.options))
        inputs = dict(stage.inputs)
        for port, source in ((patch or {}).get("from") or {}).items():
            inputs[port] = source or port
            written_at[(stage_name, "from", port)] = spec.document.where(*at, "from", port)
        for option, value in ((patch or {}).get("with") or {}).items():
            options[option] = _patched(options.get(option), value)
            written_at[(stage_name, "with", option)] = spec.document.where(*at, "with", option)
        written_at[(stage_name, "use")] = spec.document.where(*at, "use")
        stages[stage_name] = dataclasses.replace(stage, use=use, inputs=inputs, options=options)
    return dataclasses.replace(
        spec, stages=stages, written_at=written_at, gates=gates, variant=name, run=spec.run / VARIANTS / name
    )


def _patched(old: Any, new: Any) -> Any:
    """Options within an option set one by one; anything else replaced."""
    if not (isinstance(old, dict) and isinstance(new, dict)):
        return new
    return {**old, **{name: _patched(old.get(name), value) for name, value in new.items()}}


def _stage(stages: dict[str, StageSpec], name: str, where: str) -> StageSpec:
    if name not in stages:
        hint = did_you_mean(name, stages) or f"; there are {', '.join(stages)}"
        raise SpecError(f"no stage {name!r}{hint}", where=where)
    return stages[name]


def _put(options: dict[str, Any], path: Sequence[str], value: Any, where: str) -> None:
    *parents, last = path
    for key in parents:
        inner = options.setdefault(key, {})
        if inner is None:
            inner = options[key] = {}
        if not isinstance(inner, dict):
            raise SpecError(f"{key} is {inner!r} and has no options of its own", where=where)
        options = inner
    options[last] = value
