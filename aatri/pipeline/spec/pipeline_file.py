"""pipeline.yaml: which stages there are, how they hang together, with which options.

    run: runs/rc30                 where results go; relative to this file
    seed: 1
    ignore: [NAME, ...]            what the block offers and no stage uses, knowingly; enters no key
    stages:
      NAME: {use: ROLE/VARIANT, from: {PORT: STAGE}, with: {OPTION: VALUE}}
    gates:                         bounds of figures, see `gates`; enter no key; `none`: nothing is judged
      STAGE: {METRIC: {min: VALUE, max: VALUE}}
    variants:                      named patches of stages and gates
      NAME: {STAGE: {use: ..., from: ..., with: ...}, gates: {STAGE: {METRIC: ...}}}

`from: {block}` is short for `{block: block}`. Every error of the file is found and reported at once, with its place.
Whether stages, ports and options exist is checked by `graph`; here only the shape.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aatri.errors import Faults, SpecError, raise_all
from aatri.ids import clipped, did_you_mean
from aatri.pipeline.store.records import MAX_NAME, is_stage_name
from aatri.regular_file import wrong_path
from aatri.strict_yaml import Document, load

USE = re.compile(r"[a-z][a-z0-9_]{0,99}/[a-z][a-z0-9_]{0,99}")

GATES = "gates"
"""Key of the bounds of figures, beside the stages also in variants and in `--set`: no stage has this name."""

_TOP_KEYS = ("run", "seed", "ignore", "stages", GATES, "variants")
_STAGE_KEYS = ("use", "from", "with")


@dataclass(frozen=True)
class StageSpec:
    """One stage as written: the plugin, port -> stage, option -> value."""

    name: str
    use: str
    inputs: Mapping[str, str]
    options: Mapping[str, Any]


@dataclass(frozen=True)
class Spec:
    """A pipeline as written. `written_at` holds where the command line, and not the file, gave a value."""

    path: Path
    run: Path
    seed: int
    stages: Mapping[str, StageSpec]
    variants: Mapping[str, Any]
    document: Document = field(repr=False)
    written_at: Mapping[tuple[str, ...], str] = field(default_factory=dict, repr=False)
    variant: str = ""
    ignore: tuple[str, ...] = ()
    gates: Mapping[str, Any] = field(default_factory=dict)
    gates_off: bool = False

    @property
    def base(self) -> Path:
        """Folder that relative paths refer to."""
        return self.path.parent

    @property
    def sources(self) -> dict[str, StageSpec]:
        """Stages without inputs, which read files."""
        return {name: stage for name, stage in self.stages.items() if not stage.inputs}

    def where(self, stage: str, *keys: str | int) -> str:
        """Place of a value of a stage, in the file or on the command line."""
        return self._written_where(stage, *keys) or self.document.where("stages", stage, *keys)

    def where_key(self, stage: str, *keys: str | int) -> str:
        """Place of a key of a stage, in the file or on the command line."""
        return self._written_where(stage, *keys) or self.document.where_key("stages", stage, *keys)

    def where_gate(self, *keys: str) -> str:
        """Place of a value under `gates`, in the file or on the command line."""
        return self._written_where(GATES, *keys) or self.document.where(GATES, *keys)

    def where_gate_key(self, *keys: str) -> str:
        """Place of a key under `gates`, in the file or on the command line."""
        return self._written_where(GATES, *keys) or self.document.where_key(GATES, *keys)

    def _written_where(self, stage: str, *keys: str | int) -> str | None:
        path = (stage, *map(str, keys))
        places = (self.written_at.get(path[:length]) for length in range(len(path), 0, -1))
        return next((where for where in places if where), None)


def load_spec(path: Path, into: Path | None = None) -> Spec:
    """Read pipeline.yaml.

    Parameters
    ----------
    into : Path, optional
        Folder of the results instead of `run:`.

    Raises
    ------
    SpecError
        With every error of the file at once.
    """
    document = load(path, SpecError)
    errors = Faults(SpecError)
    top = _mapping(document, (), _TOP_KEYS, errors)
    run = into or _run_folder(document, top, path.parent, errors)
    if into is not None and (what := wrong_path(into)):
        raise SpecError(what, where="--into", remedy="another folder")
    seed = top.get("seed", 1)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        errors.add(f"seed is {seed!r}, not a whole number from 0", document.where("seed"))
    ignore = _ignored(document, top, errors)
    written = _mapping(document, ("stages",), None, errors)
    if not written and not errors:
        errors.add("no stages", document.where(), "`aatri new` writes an example")
    stages = {name: _stage(document, name, errors) for name in written}
    gates_off = isinstance(document.value, dict) and document.value.get(GATES) == "none"
    gates = {} if gates_off else _gates(document, (GATES,), tuple(stages), errors)
    variants = _variants(document, tuple(stages), errors)
    raise_all(errors)
    return Spec(path, run, seed, stages, variants, document, ignore=ignore, gates=gates, gates_off=gates_off)


def _run_folder(document: Document, top: Mapping[str, Any], base: Path, errors: Faults) -> Path:
    run = top.get("run")
    if not isinstance(run, str) or not run:
        what = "run is missing" if run is None else f"run is {run!r}, not a folder"
        errors.add(what, document.where("run"), "`run: runs/NAME` says where results go")
        return base
    if what := wrong_path(base / run):
        errors.add(f"run is {clipped(run)!r}: {what}", document.where("run"), "a shorter name")
    return base / run


def _ignored(document: Document, top: Mapping[str, Any], errors: Faults) -> tuple[str, ...]:
    """Names under `ignore`."""
    names = top.get("ignore") or []
    if isinstance(names, list) and all(isinstance(name, str) for name in names):
        return tuple(names)
    errors.add(f"ignore is {names!r}, not a list of names", document.where("ignore"), "ignore: [exterior.angles_rad]")
    return ()


def _stage(document: Document, name: str, errors: Faults) -> StageSpec:
    at = ("stages", name)
    _check_name(document, at, "stage", errors)
    if name == GATES:
        errors.add(
            f"a stage cannot be named {name!r}: the key of the quality gates", document.where_key(*at), "another name"
        )
    entry = _mapping(document, at, _STAGE_KEYS, errors)
    use = entry.get("use")
    if not isinstance(use, str) or not USE.fullmatch(use):
        what = f"stage {name} has no `use`" if use is None else f"use is {use!r}"
        errors.add(what, document.where(*at, "use"), "`use: ROLE/VARIANT`; see `aatri stages`")
        use = ""
    return StageSpec(name, use, _inputs(document, (*at, "from"), errors), _options(document, (*at, "with"), errors))


def _check_name(document: Document, at: tuple[str, str], what: str, errors: Faults) -> None:
    """Names of stages and variants are names of files too."""
    if not is_stage_name(at[1]):
        errors.add(
            f"{clipped(at[1])!r} is no name of a {what}",
            document.where_key(*at),
            f"at most {MAX_NAME} small letters, digits and _, beginning with a letter",
        )


def _inputs(document: Document, at: tuple[str, ...], errors: Faults) -> dict[str, str]:
    inputs = {}
    for port, source in _mapping(document, at, None, errors).items():
        if source is not None and not isinstance(source, str):
            errors.add(f"port {port} is {source!r}, not a stage", document.where(*at, port))
            continue
        inputs[port] = port if source is None else source
    return inputs


def _options(document: Document, at: tuple[str, ...], errors: Faults) -> dict[str, Any]:
    return dict(_mapping(document, at, None, errors))


def _variants(document: Document, stages: tuple[str, ...], errors: Faults) -> dict[str, Any]:
    variants = _mapping(document, ("variants",), None, errors)
    for variant in variants:
        _check_name(document, ("variants", variant), "variant", errors)
        for stage in _mapping(document, ("variants", variant), None, errors):
            at = ("variants", variant, stage)
            if stage == GATES:
                _gates(document, at, stages, errors)
                continue
            _check_stage(document, at, stages, errors)
            patch = _mapping(document, at, _STAGE_KEYS, errors)
            use = patch.get("use", "role/variant")
            if not isinstance(use, str) or not USE.fullmatch(use):
                errors.add(f"use is {use!r}, not ROLE/VARIANT", document.where(*at, "use"))
            _inputs(document, (*at, "from"), errors)
            _options(document, (*at, "with"), errors)
    return dict(variants)


def _gates(document: Document, at: tuple[str, ...], stages: tuple[str, ...], errors: Faults) -> dict[str, Any]:
    """Bounds by stage and metric; `gates.read_gates` checks them, with what variant and command line change."""
    gates = _mapping(document, at, None, errors)
    for stage in gates:
        _check_stage(document, (*at, stage), stages, errors)
    return dict(gates)


def _check_stage(document: Document, at: tuple[str, ...], stages: tuple[str, ...], errors: Faults) -> None:
    if at[-1] not in stages:
        hint = did_you_mean(at[-1], stages)
        errors.add(f"no stage {at[-1]!r}{hint}", document.where_key(*at))


def _mapping(
    document: Document, at: tuple[str, ...], known_keys: tuple[str, ...] | None, errors: Faults
) -> Mapping[str, Any]:
    """The mapping at a path; nothing where it is absent. Unknown keys and other types go to `errors`."""
    value = document.value
    for key in at:
        value = value.get(key) if isinstance(value, dict) else None
    if value is None:
        return {}
    if not isinstance(value, dict):
        shown = f"`{at[-1]}`" if at else "the file"
        remedy = "write {block} or {PORT: STAGE}" if at[-1:] == ("from",) else "write `key: value`"
        errors.add(f"{shown} is {value!r}, not keys with values", document.where(*at), remedy)
        return {}
    for key in value:
        if known_keys is not None and key not in known_keys:
            hint = did_you_mean(key, known_keys) or f"; known are {', '.join(known_keys)}"
            errors.add(f"unknown key {key!r}{hint}", document.where_key(*at, key))
    return value
