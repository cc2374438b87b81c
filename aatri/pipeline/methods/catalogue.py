"""Methods with their validated options, from the cache where the code has not changed: then no stage is imported.

An entry is found by all that it follows from: the code reached from the stage and the declaration of its role, the
options as written, the folder that relative paths refer to, Python and pydantic. What is not found is read from the
registry, which imports the stage.
What the planner knows of a variant is plain data, read off its card.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import inspect
import json
import platform
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri.errors import Faults
from aatri.pipeline.methods import discovery
from aatri.pipeline.methods.code_digest import PACKAGE, Code, CodeReader
from aatri.pipeline.spec.pipeline_file import Spec, StageSpec
from aatri.pipeline.store.cache import Cache, cache_name, file_sha256, of_file
from aatri.tables.offers import Need

if TYPE_CHECKING:
    from aatri.pipeline.methods.registry import Registry
    from aatri.plugin import Role, StageCard


@dataclass(frozen=True)
class MethodPort:
    """A port as a variant asks for it: the kind of artifact and its schema version."""

    name: str
    kind: str
    schema: int
    optional: bool


@dataclass(frozen=True)
class Method:
    """A variant: what it takes and gives. `role_ports` are all ports of its role, with their kinds."""

    name: str
    version: int
    ports: tuple[MethodPort, ...]
    kind: str
    schema: int
    wants_rng: bool
    role_ports: Mapping[str, str]

    def plain(self) -> dict[str, Any]:
        """As JSON takes it."""
        return asdict(self)


def method_of(card: StageCard, role: Role) -> Method:
    """The method of a card."""
    needs = tuple(MethodPort(p.name, p.kind.kind, p.kind.schema_version, p.optional) for p in card.ports)
    ports = {name: kind.kind for name, kind in role.ports.items()}
    return Method(card.name, card.version, needs, card.kind.kind, card.kind.schema_version, card.wants_rng, ports)


def from_plain(value: Mapping[str, Any]) -> Method:
    """The method that `Method.plain` gave."""
    return Method(**{**value, "ports": tuple(MethodPort(**need) for need in value["ports"])})


@dataclass(frozen=True)
class Prepared:
    """A stage as its plugin and its options have it."""

    method: Method
    options: Mapping[str, Any]
    """With their defaults."""
    files: Mapping[str, str]
    """Option -> file or folder whose content counts as input."""
    uses: tuple[str, ...] | None
    """What it uses of what its ports offer; None where it does not say."""
    code: Code
    """What it reaches; of each module the digest, to say which has changed."""
    needs: tuple[Need, ...] = ()
    """Without what of what its ports offer it cannot work."""


class Catalogue:
    """Methods by name; one registry is asked for what the cache does not know.

    Parameters
    ----------
    local : Path, optional
        A project's own folder of stages.
    registry : Registry, optional
        Asked instead of all stages there are; then nothing is taken from the cache.
    runs_code : bool
        Options may name Python of the project, which will be executed.
    """

    def __init__(self, local: Path | None = None, registry: Registry | None = None, *, runs_code: bool = False) -> None:
        self.local, self._registry, self._runs_code = local, registry, runs_code
        self._found = {} if registry is not None else _origins(local)
        self._codes = Cache(cache_name("codes", PACKAGE))
        self._methods = Cache(cache_name("methods", PACKAGE) if registry is None else None)
        self._versions = (platform.python_version(), importlib.metadata.version("pydantic"))
        self._reader = CodeReader(self._codes)

    @property
    def registry(self) -> Registry:
        """The registry, made when first asked for: this imports what declares stages."""
        if self._registry is None:
            from aatri.pipeline.methods import registry

            self._registry = registry.find_stages(self.local) if self.local else registry.find_stages()
        return self._registry

    def recall(self, spec: Spec, stage: StageSpec) -> Prepared | None:
        """A stage as the cache knows it, or None."""
        origin = self._found.get(stage.use)
        if origin is None or origin.file is None:
            return None
        try:
            code = self._reader.code_of(origin.module, origin.file)
            entry = self._methods.get(self._entry(stage, code)) or self._methods.get(
                self._entry(stage, code, spec.base)
            )
            if not entry or "uses" not in entry or "needs" not in entry:
                return None
            uses = entry["uses"] if entry["uses"] is None else tuple(entry["uses"])
            needs = tuple(Need.from_plain(need) for need in entry["needs"])
            return Prepared(from_plain(entry["method"]), entry["options"], entry["files"], uses, code, needs)
        except (OSError, AttributeError, KeyError, TypeError, ValueError):
            return None  # no such file, or a damaged cache

    def prepare(self, spec: Spec, stage: StageSpec, errors: Faults) -> Prepared | None:
        """A stage as its plugin declares it; None if its options are wrong (see `errors`).

        Raises
        ------
        PluginError
            If there is no such variant, or it breaks its contract.
        """
        from aatri.pipeline.spec.options import input_files, option_names, validated

        card = self.registry.card(stage.use)
        method = self.method(stage.use)
        before = len(errors)
        options = validated(spec, stage, card, errors, runs_code=self._runs_code)
        if len(errors) > before:
            return None
        uses, needs = card.used_with(options), card.needed_with(options)
        plain = options.model_dump(mode="json") if options is not None else {}
        files = {name: str(path) for name, path in input_files(options).items()} if options is not None else {}
        origin = self._found.get(stage.use)
        module, path = (origin.module, origin.file) if origin else (card.function.__module__, None)
        source = path or Path(inspect.getsourcefile(card.function) or "")
        code = self._reader.code_of(module, source)
        if origin is not None and origin.file is not None:
            entry = {
                "method": method.plain(),
                "options": plain,
                "files": files,
                "uses": uses,
                "needs": [asdict(need) for need in needs],
            }
            self._methods.put(self._entry(stage, code, spec.base if files else None), entry)
            self._methods.put(_of_options(stage.use, code), sorted(option_names(card)))
        return Prepared(method, plain, files, uses, code, needs)

    def method(self, use: str) -> Method:
        """A method as its plugin declares it."""
        card = self.registry.card(use)
        return method_of(card, self.registry.role(card.role))

    def option_names(self, use: str) -> frozenset[str]:
        """Names of the options of a variant at the top level, from the cache where its code has not changed."""
        origin, key = self._found.get(use), ""
        if origin is not None and origin.file is not None:
            with contextlib.suppress(OSError):
                key = _of_options(use, self._reader.code_of(origin.module, origin.file))
        names = self._methods.get(key)
        if not isinstance(names, list):
            from aatri.pipeline.spec.options import option_names

            names = sorted(option_names(self.registry.card(use)))
            if key:
                self._methods.put(key, names)
        return frozenset(names)

    def save(self) -> None:
        """Keep what was found."""
        self._codes.save()
        self._methods.save()

    def codes(self, uses: Iterable[str]) -> list[Code]:
        """The code of stages, as far as it can be read without importing them."""
        origins = [self._found[use] for use in sorted(set(uses)) if use in self._found]
        codes = []
        for origin in origins:
            if origin.file is not None:
                with contextlib.suppress(OSError):
                    codes.append(self._reader.code_of(origin.module, origin.file))
        return codes

    def _entry(self, stage: StageSpec, code: Code, base: Path | None = None) -> str:
        """Name of an entry; `base` counts only where options name files."""
        role = self._found.get(stage.use.partition("/")[0])
        declared = of_file(role.file, self._codes, file_sha256) if role is not None and role.file else ""
        written = json.dumps(stage.options, sort_keys=True)
        parts = [stage.use, code.digest, declared, written, str(base), str(self._runs_code), *self._versions]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _of_options(use: str, code: Code) -> str:
    """Name of the entry of the options of a variant."""
    return f"{use} {code.digest}"


def _origins(local: Path | None) -> dict[str, discovery.Origin]:
    """Where roles and variants come from; without those met twice, which the registry will complain of."""
    origins: dict[str, discovery.Origin] = {}
    doubtful = set()
    for one in [*discovery.built_in(), *discovery.installed(), *(discovery.in_project(local) if local else ())]:
        if not one.declared:
            continue
        other = origins.setdefault(one.name, one.origin)
        if other is not one.origin and not other.is_same(one.origin):
            doubtful.add(one.name)
    return {name: origin for name, origin in origins.items() if name not in doubtful}
