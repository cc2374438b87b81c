"""Wiring: stages with their plugins, ports and options, checked before anything runs, in the order of execution.

Plugins exist and keep to their role; every name under `from` is a port of the role and its source a stage of the right
kind; required ports are there; options and gates are valid; there is no cycle. All errors are reported at once.
"""

from __future__ import annotations

import graphlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from aatri.errors import Faults, PluginError, SpecError, raise_all
from aatri.ids import did_you_mean
from aatri.pipeline.methods.catalogue import Catalogue, Method, Prepared
from aatri.pipeline.spec.gates import read_gates
from aatri.pipeline.spec.pipeline_file import Spec, StageSpec

if TYPE_CHECKING:
    from aatri.pipeline.methods.registry import Registry


@dataclass(frozen=True, kw_only=True)
class StageNode(Prepared):
    """A stage ready to run."""

    name: str
    inputs: Mapping[str, str]
    unused: Mapping[str, str]
    """Port -> stage: those that its variant uses, and those given beside them."""
    written: Mapping[str, Any]
    """The options as written."""


@dataclass(frozen=True)
class _Role:
    """Ports of a role and what it gives, as kinds."""

    ports: Mapping[str, str]
    kind: str


def wire(spec: Spec, source: Catalogue | Registry) -> tuple[StageNode, ...]:
    """The stages in the order of execution; among those ready at once, in the order of the file.

    Raises
    ------
    AatriError
        Every wrong wire and option (SpecError) and plugin (PluginError), at once.
    """
    catalogue = source if isinstance(source, Catalogue) else Catalogue(registry=source)
    errors = Faults(SpecError)
    recalled = {name: catalogue.recall(spec, stage) for name, stage in spec.stages.items()}
    roles = _roles(spec, catalogue, recalled, errors)
    nodes = {}
    for name, stage in spec.stages.items():
        if name not in roles:
            continue
        _check_inputs(spec, stage, roles, errors)
        prepared = recalled[name] or _prepared(spec, stage, catalogue, roles, errors)
        if prepared is not None:
            _check_required(spec, stage, prepared.method, roles, errors)
            nodes[name] = _node(stage, prepared)
    read_gates(spec, errors)
    order = _order(spec, errors)
    raise_all(errors)
    catalogue.save()
    return tuple(nodes[name] for name in order)


def upstream(nodes: tuple[StageNode, ...], name: str) -> frozenset[str]:
    """The stages that a stage uses, directly or not."""
    sources = {node.name: set(node.inputs.values()) for node in nodes}
    reached: set[str] = set()
    waiting = [name]
    while waiting:
        new = sources[waiting.pop()] - reached
        reached |= new
        waiting += new
    return frozenset(reached)


def downstream(nodes: tuple[StageNode, ...], name: str) -> tuple[str, ...]:
    """The stages that use a stage, directly or not, in order."""
    reached = {name}
    for node in nodes:
        if reached & set(node.inputs.values()):
            reached.add(node.name)
    return tuple(node.name for node in nodes if node.name in reached and node.name != name)


def _node(stage: StageSpec, prepared: Prepared) -> StageNode:
    own_ports = {port.name for port in prepared.method.ports}
    used = {port: source for port, source in stage.inputs.items() if port in own_ports}
    unused = {port: source for port, source in stage.inputs.items() if port not in own_ports}
    return StageNode(**vars(prepared), name=stage.name, inputs=used, unused=unused, written=stage.options)


def _roles(
    spec: Spec, catalogue: Catalogue, recalled: Mapping[str, Prepared | None], errors: Faults
) -> dict[str, _Role]:
    roles = {}
    for name, stage in spec.stages.items():
        prepared = recalled[name]
        if prepared is not None:
            roles[name] = _Role(prepared.method.role_ports, prepared.method.kind)
            continue
        try:
            role = catalogue.registry.role(stage.use.partition("/")[0])
            roles[name] = _Role({port: kind.kind for port, kind in role.ports.items()}, role.kind.kind)
        except PluginError as error:
            errors.append(_placed(error, spec.where(name, "use")))
    return roles


def _prepared(
    spec: Spec, stage: StageSpec, catalogue: Catalogue, roles: Mapping[str, _Role], errors: Faults
) -> Prepared | None:
    """The stage by its plugin; what is missing among its inputs is told even if its options are wrong."""
    before = len(errors)
    try:
        prepared = catalogue.prepare(spec, stage, errors)
        if prepared is None:
            wrong_options = errors[before:]
            del errors[before:]
            _check_required(spec, stage, catalogue.method(stage.use), roles, errors)
            errors += wrong_options
    except PluginError as error:
        errors.append(_placed(error, spec.where(stage.name, "use")))
        return None
    return prepared


def _placed(error: PluginError, where: str) -> PluginError:
    what = f"{error.where}: {error.what}" if error.where else error.what
    return PluginError(what, where=where, remedy=error.remedy)


def _check_inputs(spec: Spec, stage: StageSpec, roles: Mapping[str, _Role], errors: Faults) -> None:
    ports = roles[stage.name].ports
    role = stage.use.partition("/")[0]
    for port, source in stage.inputs.items():
        if port not in ports:
            hint = did_you_mean(port, ports) or f"; it has {', '.join(ports) or 'none'}"
            errors.add(f"{role} has no port {port!r}{hint}", spec.where_key(stage.name, "from", port))
        elif source not in spec.stages:
            errors.add(
                f"no stage {source!r}{did_you_mean(source, spec.stages)}",
                spec.where(stage.name, "from", port),
                _candidates(spec, stage.name, port, ports, roles),
            )
        elif source in roles and roles[source].kind != ports[port]:
            takes, gives = ports[port], roles[source].kind
            errors.add(
                f"{stage.name}.{port} wants a {takes}, but {source} gives {gives}",
                spec.where(stage.name, "from", port),
                _candidates(spec, stage.name, port, ports, roles),
            )


def _check_required(spec: Spec, stage: StageSpec, method: Method, roles: Mapping[str, _Role], errors: Faults) -> None:
    for port in method.ports:
        if not port.optional and port.name not in stage.inputs:
            errors.add(
                f"{stage.name} ({method.name}) needs port {port.name} ({port.kind})",
                spec.where(stage.name, "from"),
                _candidates(spec, stage.name, port.name, roles[stage.name].ports, roles),
            )


def _candidates(spec: Spec, stage: str, port: str, ports: Mapping[str, str], roles: Mapping[str, _Role]) -> str:
    """Stages of the right kind, but for the stage itself and those that wait for it."""
    kind, waiting = ports[port], _waiting_for(spec, stage)
    fitting = [n for n in spec.stages if n in roles and roles[n].kind == kind and n not in waiting]
    if not fitting:
        return f"add a stage that gives it, and `from: {{{port}: THAT_STAGE}}`"
    return f"`from: {{{port}: STAGE}}`, where STAGE is {' or '.join(fitting)}"


def _waiting_for(spec: Spec, stage: str) -> set[str]:
    """A stage and all that use it, directly or not."""
    reached, size = {stage}, 0
    while size < len(reached):
        size = len(reached)
        reached |= {name for name, other in spec.stages.items() if reached & set(other.inputs.values())}
    return reached


def _order(spec: Spec, errors: Faults) -> list[str]:
    position = {name: k for k, name in enumerate(spec.stages)}
    sources = {
        name: [source for source in stage.inputs.values() if source in position] for name, stage in spec.stages.items()
    }
    sorter = graphlib.TopologicalSorter(sources)
    try:
        sorter.prepare()
    except graphlib.CycleError as failure:
        errors.append(_cycle(spec, list(failure.args[1]), position))
        return []
    order: list[str] = []
    ready = list(sorter.get_ready())
    while ready:
        first = min(ready, key=position.__getitem__)
        ready.remove(first)
        order.append(first)
        sorter.done(first)
        ready.extend(sorter.get_ready())
    return order


def _cycle(spec: Spec, cycle: list[str], position: Mapping[str, int]) -> SpecError:
    """The cycle as data flow, told from its stage that comes first in the file."""
    ring = cycle[:-1]
    start = min(range(len(ring)), key=lambda k: position[ring[k]])
    ring = ring[start:] + ring[:start]
    first, source = ring[0], ring[-1]
    port = next(port for port, origin in spec.stages[first].inputs.items() if origin == source)
    return SpecError(
        f"stages wait for each other: {' -> '.join([*ring, first])}",
        where=spec.where(first, "from", port),
        remedy="remove one of these links",
    )
